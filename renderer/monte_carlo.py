"""Shading by a light distribution and BRDF sampling, combined by the power heuristic.

Of the samples at each shading point half come from the distribution (one more where the number is
odd) and half from the BRDF. A sample of density p, drawn n times, is weighted by (n p)² over the
sum of the squares of both techniques: Veach and Guibas, SIGGRAPH 1995, equation 20 with β = 2.
Both draw from one low-discrepancy sequence per pixel, so that sub-pixels stratify each other.
"""

import weakref
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.packet.embree import (
    LANES,
    T_FAR,
    new_valid,
    occluded_block,
    query_arguments,
)
from renderer.packet.lane_samples import block_numbers, blocks_of, draw_brdf, look_up, store_blocks
from renderer.packet.lanes import (
    BLUE,
    FACING,
    GREEN,
    PDF,
    RED,
    ZERO,
    aim_each,
    face_lights,
    reflect,
    reflect_ward,
)
from renderer.rays import RayCount
from renderer.skips import DEFAULT, Skips
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.lighting import LightDistribution
from samplers.sphere import pixel_directions
from samplers.threads import for_blocks

BATCH = 1 << 15
"""Samples handled at once by a thread: the arrays between the stages stay in its cache."""
POINT_BLOCK = 4096
LIGHT_STREAM, BRDF_STREAM = 0, 1


@dataclass(frozen=True)
class SampleSplit:
    """Samples per shading point of each technique."""

    light: int
    brdf: int

    @classmethod
    def half_and_half(cls, count: int) -> "SampleSplit":
        """`count` samples, the odd one to the light."""
        return cls(count - count // 2, count // 2)

    @classmethod
    def light_only(cls, count: int) -> "SampleSplit":
        """`count` samples of the light: unbiased where its density covers all of the light."""
        return cls(count, 0)


@njit(nogil=True, cache=True, error_model="numpy")
def _weigh(block, light, own, other, own_count, other_count, trace_away, trace_zero, valid, count):
    """Turn radiance `light` (48,) into what each lane's sample carries and mark what is traced.

    own : (16,) float64, the sample's density under its own technique; other : under the other

    The power weight is own² / (own² + other²), without overflow.
    """
    marked = 0
    for k in range(LANES):
        drawn = own[k] > 0.0
        density = own[k] if drawn else 1.0
        ratio = other_count * other[k] / (own_count * density)
        weight = 1.0 / (1.0 + ratio * ratio)
        scale = weight / (density * own_count)
        facing = block[FACING * LANES + k] != ZERO
        red = light[k] * block[RED * LANES + k] * scale
        green = light[LANES + k] * block[GREEN * LANES + k] * scale
        blue = light[2 * LANES + k] * block[BLUE * LANES + k] * scale
        light[k], light[LANES + k], light[2 * LANES + k] = red, green, blue
        carries = (red != 0.0) | (green != 0.0) | (blue != 0.0) | trace_zero
        used = drawn & (k < count) & ((facing & carries) | (trace_away & (not facing)))
        valid[k] = -1 if used else 0
        marked += 1 if used else 0
    return marked


@njit(nogil=True, cache=True)
def _add_unblocked(block, valid, light, total):
    for k in range(LANES):
        lit = (valid[k] != 0) & (block[T_FAR * LANES + k] >= ZERO)
        total[k] += light[k] if lit else 0.0
        total[LANES + k] += light[LANES + k] if lit else 0.0
        total[2 * LANES + k] += light[2 * LANES + k] if lit else 0.0


@njit(nogil=True, cache=True)
def _gather(
    scene, blocks, ward, points, material, materials, radiance, direction, pdf, is_light,
    own_count, other_count, skip_away, skip_zero, total,
):  # fmt: skip
    """Add the estimates of one technique to `total` (blocks, 48); returns the rays traced.

    direction, pdf : (rows, 3) and (rows,), the samples and their density as light samples
    """
    valid, arguments = new_valid(), query_arguments(False)
    texel = np.empty(2 * LANES, np.int32)
    light, own, other = np.empty(3 * LANES), np.empty(LANES), np.empty(LANES)
    traced = 0
    for b in range(len(blocks)):
        block, start = blocks[b], points[0] + b * LANES
        count = min(LANES, points[1] - start)
        for s in range(own_count):
            first = (b * own_count + s) * LANES
            aim_each(block, direction, first)
            if face_lights(block) == 0 and skip_away:
                continue
            look_up(block, radiance, texel, light)
            reflect(block)
            if ward:
                reflect_ward(block, start, points[1], material, materials)
            for k in range(LANES):
                brdf_pdf = np.float64(block[PDF * LANES + k])
                light_pdf = np.float64(pdf[first + k])
                own[k] = light_pdf if is_light else brdf_pdf
                other[k] = brdf_pdf if is_light else light_pdf
            marked = _weigh(
                block, light, own, other, own_count, other_count, not skip_away, not skip_zero,
                valid, count,
            )  # fmt: skip
            if marked > 0:
                occluded_block(scene, valid, block, arguments)
                _add_unblocked(block, valid, light, total[b])
                traced += marked
    return traced


def _shade_points(
    view: View,
    points: tuple[int, int],
    lighting: LightDistribution,
    radiance: NDArray[np.float32],
    split: SampleSplit,
    first: int,
    seed: int,
    skips: Skips,
    out: NDArray[np.float32],
) -> RayCount:
    """Put the mean estimates of the points start … stop into out (n, 3)."""
    surface = (view.position, view.normal, view.geometric, view.toward_eye)
    blocks, ward = blocks_of(points, *surface, view.material, view.materials)
    total = np.zeros((len(blocks), 3 * LANES))
    rays = {LIGHT_STREAM: 0, BRDF_STREAM: 0}
    for stream, own, other in (
        (LIGHT_STREAM, split.light, split.brdf),
        (BRDF_STREAM, split.brdf, split.light),
    ):
        if own == 0:
            continue
        u = np.empty((len(blocks) * own * LANES, 3), np.float32)
        block_numbers(
            points, view.pixel, view.subpixel, view.subpixels, first * own, own, seed, stream,
            bool(getattr(lighting, "independent", False)), u,
        )  # fmt: skip
        if stream == LIGHT_STREAM:
            direction, pdf = lighting.sample(u)
        else:
            direction = np.empty_like(u)
            draw_brdf(blocks, ward, points, view.material, view.materials, u, own, direction)
            pdf = lighting.pdf(direction) if other else np.zeros(len(u), np.float32)
        rays[stream] = _gather(
            view.embree.handle, blocks, ward, points, view.material, view.materials, radiance,
            direction, pdf, stream == LIGHT_STREAM, own, other,
            skips.facing_away, skips.zero, total,
        )  # fmt: skip
    store_blocks(total, points, out)
    drawn = (points[1] - points[0]) * (split.light + split.brdf)
    traced = rays[LIGHT_STREAM], rays[BRDF_STREAM]
    return RayCount(shadow=traced[0], brdf=traced[1], skipped=drawn - sum(traced))


_covering: weakref.WeakKeyDictionary[
    EnvironmentMap, tuple[weakref.ref[LightDistribution], bool]
] = weakref.WeakKeyDictionary()
"""What was found of the distribution that was last asked for under a map."""


def _covers(lighting: LightDistribution, environment: EnvironmentMap) -> bool:
    """Whether every texel with light can be drawn; looked up once for all images of a light set."""
    last, answer = _covering.get(environment, (None, False))
    if last is None or last() is not lighting:
        answer = _draws_all_light(lighting, environment)
        # Objects with slots have no weak references.
        with suppress(TypeError):
            _covering[environment] = weakref.ref(lighting), answer
    return answer


def _draws_all_light(lighting: LightDistribution, environment: EnvironmentMap) -> bool:
    direction = pixel_directions(environment.height)[environment.luminance > 0.0]
    return bool((lighting.pdf(direction.astype(np.float32)) > 0.0).all())


def shade_distribution(
    view: View,
    environment: EnvironmentMap,
    lighting: LightDistribution,
    seed: int,
    split: SampleSplit | None = None,
    first: int = 0,
    spans: NDArray[np.int64] | None = None,
    skips: Skips = DEFAULT,
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points by `lighting.count` samples at each.

    seed : chooses the scrambling of the low-discrepancy points
    split : samples per technique; by default half and half of `lighting.count`, unless BRDF
        sampling is skipped
    first : number of estimates of this size that went before, whose points are skipped
    spans : (m, 2), the runs of points to shade; all by default, the others stay 0
    """
    if split is None:
        alone = skips.lambert_brdf and view.is_lambertian and _covers(lighting, environment)
        split = (SampleSplit.light_only if alone else SampleSplit.half_and_half)(lighting.count)
    out = np.zeros((len(view), 3), np.float32)
    counts: list[RayCount] = []
    step = max(1, min(POINT_BLOCK, BATCH // max(split.light, split.brdf, 1)))
    spans = np.array([[0, len(view)]]) if spans is None else spans
    runs = [
        (start, min(start + step, stop))
        for low, stop in spans.tolist()
        for start in range(low, stop, step)
    ]

    def shade(index: int, _: int) -> None:
        start, stop = runs[index]
        rays = _shade_points(
            view, (start, stop), lighting, environment.radiance, split, first, seed, skips, out
        )
        counts.append(rays)

    for_blocks(shade, len(runs), 1)
    return out, sum(counts, RayCount())
