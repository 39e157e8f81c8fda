"""Shading by a light distribution and BRDF sampling, combined by the power heuristic.

Of the samples at each shading point half come from the distribution (one more where the number is
odd) and half from the BRDF: `packet/estimate.py`. Both draw from one low-discrepancy sequence per
pixel, so that sub-pixels stratify each other. A table over the map's texels, whoever made it, is
drawn from in place; samples of other distributions are drawn first, many at once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.given_samples import require_good, require_shape
from renderer.packet.drawn_samples import BRDF_STREAM, LIGHT_STREAM
from renderer.packet.embree import LANES
from renderer.packet.estimate import shade_points, shade_points_and_diffuse
from renderer.packet.lane_samples import packet_numbers
from renderer.packet.lanes import packets_of
from renderer.packet.layout import Density, Given, Numbers
from renderer.packet.reflectance import draw
from renderer.rays import RayCount
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.grids.tabulated import NO_TABLE
from samplers.lighting import LightDistribution, TabulatedLight
from samplers.threads import block_of, for_blocks

BATCH = 1 << 15
"""Samples handled at once by a thread: the arrays between the stages stay in its cache."""
POINT_BLOCK = 4096
"""Points that a thread takes at once, at least where their samples are no more than a batch."""
NO_DENSITY = Density(NO_TABLE, np.frombuffer(b"", np.float32), 0.0)
NOT_GIVEN = Given(np.empty((0, 3), np.float32), np.empty(0), np.empty((0, 3), np.float32))


class SampleSplit(NamedTuple):
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


NO_SAMPLES = SampleSplit(0, 0)


def _given(
    view: View,
    points: tuple[int, int],
    lighting: LightDistribution,
    split: SampleSplit,
    before: SampleSplit,
    seed: int,
) -> Given:
    """Samples of both kinds, as `shade_points` takes them."""
    packets, ward = packets_of(points, *view.surface, view.material, view.materials)
    of_light = split.light * len(packets) * LANES
    u = np.empty((of_light + split.brdf * len(packets) * LANES, 3), np.float32)
    direction, density = np.empty_like(u), np.zeros(len(u))
    for stream, first, own, rows in (
        (LIGHT_STREAM, before.light, split.light, slice(0, of_light)),
        (BRDF_STREAM, before.brdf, split.brdf, slice(of_light, None)),
    ):
        packet_numbers(
            points, view.pixel, view.subpixel, view.subpixels, first, own, seed, stream,
            is_independent(lighting), u[rows],
        )  # fmt: skip
        here = direction[rows]
        if stream == LIGHT_STREAM and own:
            drawn, pdf = (np.asarray(array) for array in lighting.sample(u[rows]))
            require_shape(lighting, "directions", drawn, here.shape)
            require_shape(lighting, "densities", pdf, (len(here),))
            here[:], density[rows] = drawn, pdf
        elif own:
            draw(packets, ward, points, view.material, view.materials, u[rows], own, here)
            if split.light:
                pdf = np.asarray(lighting.pdf(here))
                require_shape(lighting, "densities", pdf, (len(here),))
                density[rows] = pdf
    require_good(lighting, direction[:of_light], density, NOT_GIVEN.radiance)
    return NOT_GIVEN._replace(direction=direction, density=density)


def density_in_place(lighting: object, environment: EnvironmentMap) -> Density | None:
    """The lighting's table where kernels can draw from it themselves: where it has one of the map's
    size."""
    if not isinstance(lighting, TabulatedLight):
        return None
    weight, size = lighting.weight, (environment.height, environment.width)
    if weight.shape != size or weight.dtype != np.float32 or not weight.flags.c_contiguous:
        return None
    if weight is environment.luminance:
        # Found from the radiance that is read anyway.
        return Density(lighting.table, NO_DENSITY.weight, float(lighting.offset))
    flat = np.frombuffer(weight.data.toreadonly(), np.float32)
    return Density(lighting.table, flat, float(lighting.offset))


def is_independent(lighting: object) -> bool:
    """Whether a distribution asks for independent numbers."""
    return bool(getattr(lighting, "independent", False))


def shade_distribution(
    view: View,
    environment: EnvironmentMap,
    lighting: LightDistribution,
    seed: int,
    split: SampleSplit | None = None,
    before: SampleSplit = NO_SAMPLES,
    spans: NDArray[np.int64] | None = None,
    diffuse: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points by `lighting.count` samples at each.

    seed : chooses the scrambling of the low-discrepancy points
    split : samples per technique; by default half and half of `lighting.count`
    before : samples of each technique that went before, whose random numbers are skipped
    spans : (m, 2), the runs of points to shade; all by default, the others stay 0
    diffuse : (n, 3), into which goes what the same samples carry of diffuse light before shadows
    Raises EnvlightError where the distribution gives samples or densities of other shapes than it
    promised, not of unit length, negative or not finite.
    """
    split = split or SampleSplit.half_and_half(lighting.count)
    out = np.zeros((len(view), 3), np.float32)
    counts: list[RayCount] = []
    batch = BATCH // max(split.light, split.brdf, 1)
    step = max(1, min(block_of(len(view), POINT_BLOCK), batch))
    step = max(LANES, step // LANES * LANES)
    spans = np.array([[0, len(view)]]) if spans is None else spans
    runs = [
        (start, min(start + step, stop))
        for low, stop in spans.tolist()
        for start in range(low, stop, step)
    ]
    in_place = density_in_place(lighting, environment)
    numbers = Numbers(seed, is_independent(lighting))

    def shade(index: int, _: int) -> None:
        span, given = runs[index], NOT_GIVEN
        if in_place is None:
            given = _given(view, span, lighting, split, before, seed)
        arguments = (
            view.embree.handle, view.points, span, environment.radiance, in_place or NO_DENSITY,
            given, split, before, numbers, out,
        )  # fmt: skip
        if diffuse is None:
            shadow, brdf = shade_points(*arguments)
        else:
            shadow, brdf = shade_points_and_diffuse(*arguments, diffuse)
        drawn = (span[1] - span[0]) * (split.light + split.brdf)
        counts.append(RayCount(shadow=shadow, brdf=brdf, skipped=drawn - shadow - brdf))

    for_blocks(shade, len(runs), 1)
    return out, sum(counts, RayCount())
