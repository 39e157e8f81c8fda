"""Variance minimisation: regions as compact as can be around their energy centroids.

The map is one region at first. A region is cut where the larger of its two parts' variances is
least, over both axes and all positions; each final region gives one directional light at its
energy centroid with its integral of radiance. The variance of a region is Σ L d², with L the
luminance × solid angle of a pixel and d its distance to the region's energy centroid: an
unnormalised second moment, so bright and wide regions are cut first.

Source: Viriyothai and Debevec, "Variance minimization light probe sampling", SIGGRAPH poster 2009.

Summed-area tables of energy and of its moments make a candidate cut cost O(1) and a split of a
region O(width + height). The lights are a fixed quadrature: noise-free and biased. Regions end at
the seam, so the lights of a map turned about the vertical axis are not the turned lights.

Parameters
    metric : how d is measured. "planar" (default), in pixels of the map, is the published rule;
        "spherical" takes the chord between directions, which the poles do not stretch.
    order : "heap" (default) always cuts the region of largest variance and so meets any count;
        "rounds" cuts all regions once a round as the poster does, which rounds the count down to a
        power of two.
    light_extent : how far a light's cluster reaches, by which interleaved sampling perturbs it:
        "mean", "largest" or "full", the same for all samplers (`samplers.lighting`)
    sets : "perturbed" (default) or "independent", eight sets of its own
        (`samplers.independent_sets`)

`experiments.questions.readings` compares them.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from samplers.base import LightSampler, Reading, register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.map_kernels import box_sum
from samplers.grids.regions import Region, lights_of_regions, split_until
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.reference import Reference


@kernel
def _variance_of(spherical, flux, a, b, c):
    """Σ L d² from Σ L and its moments: Σ L ω if spherical, else Σ Lx, Σ Ly and Σ L(x² + y²)."""
    if not flux > 0.0:
        return 0.0
    if spherical:
        return max(0.0, flux - (a * a + b * b + c * c) / flux)
    return max(0.0, c - (a * a + b * b) / flux)


@kernel
def region_variance(spherical, flux, moment, top, left, bottom, right):
    """Σ L d² of a region from its summed-area tables; never negative."""
    s = box_sum(flux, top, left, bottom, right)
    a = box_sum(moment[:, :, 0], top, left, bottom, right)
    b = box_sum(moment[:, :, 1], top, left, bottom, right)
    c = box_sum(moment[:, :, 2], top, left, bottom, right)
    return _variance_of(spherical, s, a, b, c)


@kernel
def _scan(spherical, near, far, near_moment, far_moment, low, high):
    """The cut of least larger variance on one axis, nearest to the middle among equals.

    near, far : lines (n,) of the flux table along the region's two edges, and (n, 3) of its moments
    Returns the larger variance and the position; infinity where the side is one pixel long.
    """
    s_low = far[low] - near[low]
    a_low = far_moment[low, 0] - near_moment[low, 0]
    b_low = far_moment[low, 1] - near_moment[low, 1]
    c_low = far_moment[low, 2] - near_moment[low, 2]
    s_all = (far[high] - near[high]) - s_low
    a_all = (far_moment[high, 0] - near_moment[high, 0]) - a_low
    b_all = (far_moment[high, 1] - near_moment[high, 1]) - b_low
    c_all = (far_moment[high, 2] - near_moment[high, 2]) - c_low
    least, best = math.inf, low
    for cut in range(low + 1, high):
        s = (far[cut] - near[cut]) - s_low
        a = (far_moment[cut, 0] - near_moment[cut, 0]) - a_low
        b = (far_moment[cut, 1] - near_moment[cut, 1]) - b_low
        c = (far_moment[cut, 2] - near_moment[cut, 2]) - c_low
        larger = max(
            _variance_of(spherical, s, a, b, c),
            _variance_of(spherical, s_all - s, a_all - a, b_all - b, c_all - c),
        )
        if larger < least or (
            larger == least and abs(2 * cut - low - high) < abs(2 * best - low - high)
        ):
            least, best = larger, cut
    return least, best


@kernel
def best_cut(spherical, flux, moment, top, left, bottom, right):
    """The cut of a region of two pixels or more: (across rows or not, position).

    Of two axes that do equally well the longer side is cut.
    """
    row_value, row = _scan(
        spherical, flux[:, left], flux[:, right], moment[:, left], moment[:, right], top, bottom
    )
    column_value, column = _scan(
        spherical, flux[top], flux[bottom], moment[top], moment[bottom], left, right
    )
    if row_value == column_value:
        across_rows = bottom - top > right - left
    else:
        across_rows = row_value < column_value
    return across_rows, row if across_rows else column


@register("variance-minimization")
@dataclass(frozen=True)
class VarianceMinimization(LightSampler):
    """Regions cut where the larger of the two parts' variances is least (VM)."""

    label: ClassVar[str] = "Variance min. (Viriyothai 2009)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Kuntee Viriyothai, Paul Debevec",
            "Variance minimization light probe sampling",
            "SIGGRAPH Posters",
            2009,
            doi="10.1145/1599301.1599393",
        ),
    )

    metric: Literal["planar", "spherical"] = "planar"
    order: Literal["heap", "rounds"] = "heap"
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("distances in pixels", {"metric": "planar"}),
        Reading(
            "distances on the sphere",
            {"metric": "spherical"},
            "the published rule measures in pixels",
        ),
        Reading("the region of largest variance is cut", {"order": "heap"}),
        Reading(
            "all regions are cut once a round",
            {"order": "rounds"},
            "it gives powers of two alone, fewer lights than are asked for between them",
        ),
    )

    def __post_init__(self) -> None:
        if self.metric not in ("planar", "spherical") or self.order not in ("heap", "rounds"):
            raise EnvlightError(
                "variance-minimization: metric is 'planar' or 'spherical', "
                "order is 'heap' or 'rounds'"
            )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        spherical = self.metric == "spherical"
        flux = environment.flux_table
        moment = environment.moment_table if spherical else environment.pixel_moment_table

        def split(region: Region) -> tuple[Region, Region] | None:
            top, left, bottom, right = region
            if bottom - top == 1 and right - left == 1:
                return None
            across_rows, cut = best_cut(spherical, flux, moment, top, left, bottom, right)
            if across_rows:
                return (top, left, cut, right), (cut, left, bottom, right)
            return (top, left, bottom, cut), (top, cut, bottom, right)

        def variance(region: Region) -> float:
            return region_variance(spherical, flux, moment, *region)

        root = (0, 0, environment.height, environment.width)
        regions = np.array(split_until(count, root, split, variance, self.order == "rounds"))
        return lights_of_regions(environment, regions, light_extent=self.light_extent)
