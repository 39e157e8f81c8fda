"""Shading by a light distribution and BRDF sampling, combined by the power heuristic.

Of the samples at each shading point half come from the distribution (one more where the number is
odd) and half from the BRDF. A sample of density p, drawn n times, is weighted by (n p)² over the
sum of the squares of both techniques: Veach and Guibas, SIGGRAPH 1995, equation 20 with β = 2.
Both draw from one low-discrepancy sequence per pixel, so that sub-pixels stratify each other.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer import brdf
from renderer.embree import LANES, new_packet, new_valid, query_arguments
from renderer.low_discrepancy import fill_points
from renderer.rays import RayCount, flush_rays, new_ray_values, push_ray
from renderer.skips import DEFAULT, Skips
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.lighting import LightDistribution
from samplers.sphere import pixel_directions, pixel_of
from samplers.threads import for_blocks

BATCH = 1 << 15
"""Samples handled at once by a thread: the arrays between the stages stay in its cache."""
POINT_BLOCK = 1024
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


@njit(nogil=True, cache=True)
def _power_weight(own, other):
    """own² / (own² + other²) without overflow."""
    if own <= 0.0:
        return 0.0
    ratio = other / own
    return 1.0 / (1.0 + ratio * ratio)


@njit(nogil=True, cache=True)
def draw_brdf(points, normal, toward_eye, material, materials, u, count, direction, pdf):
    """Draw `count` directions from the BRDF at each of the points, and their densities."""
    for i in range(points[0], points[1]):
        row = materials[material[i]]
        for s in range(count):
            j = (i - points[0]) * count + s
            lx, ly, lz, density = brdf.sample(
                row, normal[i, 0], normal[i, 1], normal[i, 2],
                toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2], u[j, 0], u[j, 1], u[j, 2],
            )  # fmt: skip
            direction[j, 0], direction[j, 1], direction[j, 2] = lx, ly, lz
            pdf[j] = density


@njit(nogil=True, cache=True)
def _gather(
    scene, points, position, normal, geometric, toward_eye, material, materials, radiance,
    direction, own_pdf, light_pdf, own_is_light, own_count, other_count, skip_away, skip_zero,
    total,
):  # fmt: skip
    """Add the estimates of one technique to `total`; returns rays traced and samples skipped."""
    packet, valid, arguments = new_packet(), new_valid(), query_arguments(False)
    owner, value = new_ray_values()
    height = radiance.shape[0]
    traced = skipped = lanes = 0
    for i in range(points[0], points[1]):
        row = materials[material[i]]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        vx, vy, vz = toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2]
        for s in range(own_count):
            j = (i - points[0]) * own_count + s
            skipped += 1
            lx, ly, lz = direction[j, 0], direction[j, 1], direction[j, 2]
            cosine = nx * lx + ny * ly + nz * lz
            above = geometric[i, 0] * lx + geometric[i, 1] * ly + geometric[i, 2] * lz
            facing = cosine > 0.0 and above > 0.0
            if own_pdf[j] <= 0.0 or (skip_away and not facing):
                continue
            red = green = blue = 0.0
            if facing:
                y, x = pixel_of(lx, ly, lz, height)
                red, green, blue = radiance[y, x, 0], radiance[y, x, 1], radiance[y, x, 2]
            if red != 0.0 or green != 0.0 or blue != 0.0:
                fr, fg, fb, brdf_pdf = brdf.evaluate_with_pdf(
                    row, nx, ny, nz, vx, vy, vz, lx, ly, lz
                )
                weight = 1.0
                if other_count > 0:
                    other = brdf_pdf if own_is_light else np.float64(light_pdf[j])
                    weight = _power_weight(own_count * np.float64(own_pdf[j]), other_count * other)
                scale = weight * cosine / (np.float64(own_pdf[j]) * own_count)
                red, green, blue = red * fr * scale, green * fg * scale, blue * fb * scale
            if skip_zero and facing and red == 0.0 and green == 0.0 and blue == 0.0:
                continue
            push_ray(packet, owner, value, lanes, position, i, lx, ly, lz, red, green, blue)
            skipped -= 1
            lanes += 1
            if lanes == LANES:
                flush_rays(scene, packet, valid, owner, value, lanes, points[0], total, arguments)
                traced += lanes
                lanes = 0
    if lanes > 0:
        flush_rays(scene, packet, valid, owner, value, lanes, points[0], total, arguments)
        traced += lanes
    return traced, skipped


def _shade_points(
    view: View,
    points: tuple[int, int],
    lighting: LightDistribution,
    radiance: NDArray[np.float32],
    split: SampleSplit,
    first: int,
    seed: int,
    skips: Skips,
) -> tuple[NDArray[np.float64], RayCount]:
    """Mean estimate (points, 3) of the points start … stop."""
    start, stop = points
    total = np.zeros((stop - start, 3))
    rays = {}
    surface = (view.position, view.normal, view.geometric, view.toward_eye, view.material)
    none = np.empty(0, np.float32)
    for is_light, own, other, stream in (
        (True, split.light, split.brdf, LIGHT_STREAM),
        (False, split.brdf, split.light, BRDF_STREAM),
    ):
        if own == 0:
            rays[is_light] = (0, 0)
            continue
        u = np.empty(((stop - start) * own, 3), np.float32)
        fill_points(
            view.pixel[start:stop], view.subpixel[start:stop], view.subpixels,
            first * own, own, seed, stream, u,
        )  # fmt: skip
        if is_light:
            direction, pdf = lighting.sample(u)
            density = pdf.astype(np.float64)
            light_pdf = none
        else:
            direction, density = np.empty_like(u), np.empty(len(u))
            draw_brdf(
                points, view.normal, view.toward_eye, view.material, view.materials, u, own,
                direction, density,
            )  # fmt: skip
            light_pdf = lighting.pdf(direction) if other else none
        rays[is_light] = _gather(
            view.embree.handle, points, *surface, view.materials, radiance,
            direction, density, light_pdf, is_light, own, other, skips.facing_away, skips.zero,
            total,
        )  # fmt: skip
    return total, RayCount(
        shadow=rays[True][0], brdf=rays[False][0], skipped=rays[True][1] + rays[False][1]
    )


def _covers(lighting: LightDistribution, environment: EnvironmentMap) -> bool:
    """Whether every texel with light can be drawn."""
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
        total, rays = _shade_points(
            view, (start, stop), lighting, environment.radiance, split, first, seed, skips
        )
        out[start:stop] = total
        counts.append(rays)

    for_blocks(shade, len(runs), 1)
    return out, sum(counts, RayCount())
