"""Shading by a light distribution and BRDF sampling, combined by the power heuristic.

Of the samples at each shading point half come from the distribution (one more where the number is
odd) and half from the BRDF. A sample of density p, drawn n times, is weighted by (n p)² over the
sum of the squares of both techniques: Veach and Guibas, SIGGRAPH 1995, equation 20 with β = 2.
Both draw from one low-discrepancy sequence per pixel, so that sub-pixels stratify each other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import LANES, T_FAR, new_valid, occluded, query_arguments
from renderer.packet.lane_samples import look_up, packet_numbers, store_packets
from renderer.packet.lanes import aim_each, face_lights, packets_of
from renderer.packet.layout import BLUE, FACING, GREEN, PDF, RED, ZERO
from renderer.packet.reflectance import draw, reflect, reflect_ward
from renderer.rays import RayCount
from renderer.view import View
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.lighting import LightDistribution
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


@kernel
def weigh(packet, light, own, other, own_count, other_count, valid, count):
    """Turn radiance `light` (48,) into what each lane's sample carries and mark what is traced.

    own : (16,) float64, the sample's density under its own technique; other : under the other

    weight = (n own)² / ((n own)² + (m other)²), without overflow, for n samples of the own and m
    of the other technique; light = radiance · f_r · cosine · weight / (n own)
    """
    marked = 0
    for k in range(LANES):
        drawn = own[k] > 0.0
        density = own[k] if drawn else 1.0
        ratio = other_count * other[k] / (own_count * density)
        weight = 1.0 / (1.0 + ratio * ratio)
        scale = weight / (density * own_count)
        facing = packet[FACING * LANES + k] != ZERO
        red = light[k] * packet[RED * LANES + k] * scale
        green = light[LANES + k] * packet[GREEN * LANES + k] * scale
        blue = light[2 * LANES + k] * packet[BLUE * LANES + k] * scale
        light[k], light[LANES + k], light[2 * LANES + k] = red, green, blue
        carries = (red != 0.0) | (green != 0.0) | (blue != 0.0)
        used = drawn & (k < count) & facing & carries
        valid[k] = -1 if used else 0
        marked += 1 if used else 0
    return marked


@kernel
def _add_unblocked(packet, valid, light, total):
    for k in range(LANES):
        lit = (valid[k] != 0) & (packet[T_FAR * LANES + k] >= ZERO)
        total[k] += light[k] if lit else 0.0
        total[LANES + k] += light[LANES + k] if lit else 0.0
        total[2 * LANES + k] += light[2 * LANES + k] if lit else 0.0


@kernel
def _gather(
    scene, packets, ward, points, material, materials, radiance, direction, pdf, is_light,
    own_count, other_count, total,
):  # fmt: skip
    """Add the estimates of one technique to `total` (packets, 48); returns the rays traced.

    direction, pdf : (rows, 3) and (rows,), the samples and their density as light samples
    """
    valid, arguments = new_valid(), query_arguments(False)
    texel = np.empty(2 * LANES, np.int32)
    light, own, other = np.empty(3 * LANES), np.empty(LANES), np.empty(LANES)
    traced = 0
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        count = min(LANES, points[1] - start)
        for s in range(own_count):
            first = (s * len(packets) + b) * LANES
            aim_each(packet, direction, first)
            if face_lights(packet) == 0:
                continue
            look_up(packet, radiance, texel, light)
            reflect(packet)
            if ward:
                reflect_ward(packet, start, points[1], material, materials)
            for k in range(LANES):
                brdf_pdf = np.float64(packet[PDF * LANES + k])
                light_pdf = np.float64(pdf[first + k])
                own[k] = light_pdf if is_light else brdf_pdf
                other[k] = brdf_pdf if is_light else light_pdf
            marked = weigh(packet, light, own, other, own_count, other_count, valid, count)
            if marked > 0:
                occluded(scene, valid, packet, arguments)
                _add_unblocked(packet, valid, light, total[b])
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
    out: NDArray[np.float32],
) -> RayCount:
    """Put the mean estimates of the points start … stop into out (n, 3)."""
    surface = (view.position, view.normal, view.geometric, view.toward_eye)
    packets, ward = packets_of(points, *surface, view.material, view.materials)
    total = np.zeros((len(packets), 3 * LANES))
    rays = {LIGHT_STREAM: 0, BRDF_STREAM: 0}
    for stream, own, other in (
        (LIGHT_STREAM, split.light, split.brdf),
        (BRDF_STREAM, split.brdf, split.light),
    ):
        if own == 0:
            continue
        u = np.empty((len(packets) * own * LANES, 3), np.float32)
        packet_numbers(
            points, view.pixel, view.subpixel, view.subpixels, first * own, own, seed, stream,
            bool(getattr(lighting, "independent", False)), u,
        )  # fmt: skip
        if stream == LIGHT_STREAM:
            direction, pdf = lighting.sample(u)
        else:
            direction = np.empty_like(u)
            draw(packets, ward, points, view.material, view.materials, u, own, direction)
            pdf = lighting.pdf(direction) if other else np.zeros(len(u), np.float32)
        rays[stream] = _gather(
            view.embree.handle, packets, ward, points, view.material, view.materials, radiance,
            direction, pdf, stream == LIGHT_STREAM, own, other, total,
        )  # fmt: skip
    store_packets(total, points, out)
    drawn = (points[1] - points[0]) * (split.light + split.brdf)
    traced = rays[LIGHT_STREAM], rays[BRDF_STREAM]
    return RayCount(shadow=traced[0], brdf=traced[1], skipped=drawn - sum(traced))


def shade_distribution(
    view: View,
    environment: EnvironmentMap,
    lighting: LightDistribution,
    seed: int,
    split: SampleSplit | None = None,
    first: int = 0,
    spans: NDArray[np.int64] | None = None,
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points by `lighting.count` samples at each.

    seed : chooses the scrambling of the low-discrepancy points
    split : samples per technique; by default half and half of `lighting.count`
    first : number of estimates of this size that went before, whose points are skipped
    spans : (m, 2), the runs of points to shade; all by default, the others stay 0
    """
    split = split or SampleSplit.half_and_half(lighting.count)
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
            view, (start, stop), lighting, environment.radiance, split, first, seed, out
        )
        counts.append(rays)

    for_blocks(shade, len(runs), 1)
    return out, sum(counts, RayCount())
