"""Median cut: regions of equal energy, one light at the centroid of each.

The map is one region at first. Every region is cut across its longer side where its energy is
halved, until there are enough; each then gives one directional light at its energy centroid with
the region's integral of radiance. A summed-area table makes a cut a binary search, so the cost is
O(n log(W + H)) after the table. The lights are a fixed quadrature: noise-free and biased.

Source: Debevec, "A median cut algorithm for light probe sampling", SIGGRAPH poster 2005.

Parameters
    order : "heap" (default) always cuts the region of largest energy and so meets any count;
        "rounds" cuts all regions once a round as the poster does, which rounds the count down to a
        power of two. The two agree for a power of two, but where cuts are uneven.
    position : "centroid" (default) or "middle" of a region. The poster names both.
    aspect : a region's width is scaled by the cosine of its middle latitude before the longer side
        is chosen, as the poster says; False compares pixels.
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
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.map_kernels import box_sum
from samplers.grids.regions import Region, lights_of_regions, region_middle, split_until
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.reference import Reference


@kernel
def _median(table, top, left, bottom, right, across_rows):
    """The cut position nearest to half of the region's energy; the middle where it has none."""
    low, high = (top, bottom) if across_rows else (left, right)
    total = box_sum(table, top, left, bottom, right)
    if not total > 0.0:
        return (low + high) // 2
    first, last = low + 1, high - 1
    while first < last:
        middle = (first + last) // 2
        below = (
            box_sum(table, top, left, middle, right)
            if across_rows
            else box_sum(table, top, left, bottom, middle)
        )
        if below < 0.5 * total:
            first = middle + 1
        else:
            last = middle
    if first > low + 1:
        here = (
            box_sum(table, top, left, first, right)
            if across_rows
            else box_sum(table, top, left, bottom, first)
        )
        before = (
            box_sum(table, top, left, first - 1, right)
            if across_rows
            else box_sum(table, top, left, bottom, first - 1)
        )
        if 0.5 * total - before <= here - 0.5 * total:
            return first - 1
    return first


@register("median-cut")
@dataclass(frozen=True)
class MedianCut(LightSampler):
    """Regions of equal energy, cut across their longer side (MC)."""

    label: ClassVar[str] = "Median cut (Debevec 2005)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Paul Debevec",
            "A median cut algorithm for light probe sampling",
            "SIGGRAPH Posters",
            2005,
            doi="10.1145/1186954.1187029",
        ),
    )

    order: Literal["heap", "rounds"] = "heap"
    position: Literal["centroid", "middle"] = "centroid"
    aspect: bool = True
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("the region of largest energy is cut", {"order": "heap"}),
        Reading("all regions are cut once a round", {"order": "rounds"}),
        Reading("lights at the energy centroid", {"position": "centroid"}),
        Reading("lights at the middle", {"position": "middle"}),
        Reading("longer side on the sphere", {"aspect": True}),
        Reading(
            "longer side in pixels",
            {"aspect": False},
            "its paper scales a region's width by the cosine of its latitude",
        ),
    )

    def __post_init__(self) -> None:
        if self.order not in ("heap", "rounds") or self.position not in ("centroid", "middle"):
            raise EnvlightError(
                "median-cut: order is 'heap' or 'rounds', position is 'centroid' or 'middle'"
            )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        regions, height = self._regions(environment, count), environment.height
        middle = region_middle(regions, height) if self.position == "middle" else None
        return lights_of_regions(environment, regions, middle, self.light_extent)

    def labels(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> NDArray[np.int32]:
        """The number (H, 2H) of the region that each texel lies in."""
        label = np.zeros((environment.height, environment.width), np.int32)
        for k, (top, left, bottom, right) in enumerate(self._regions(environment, count)):
            label[top:bottom, left:right] = k
        return label

    def _regions(self, environment: EnvironmentMap, count: int) -> NDArray[np.int64]:
        """Rectangles (n, 4) of the map."""
        table, height = environment.flux_table, environment.height

        def split(region: Region) -> tuple[Region, Region] | None:
            top, left, bottom, right = region
            if bottom - top == 1 and right - left == 1:
                return None
            latitude = math.pi * (0.5 - 0.5 * (top + bottom) / height)
            scale = math.cos(latitude) if self.aspect else 1.0
            across_rows = bottom - top > (right - left) * scale
            if (bottom - top if across_rows else right - left) == 1:
                across_rows = not across_rows
            cut = int(_median(table, top, left, bottom, right, across_rows))
            if across_rows:
                return (top, left, cut, right), (cut, left, bottom, right)
            return (top, left, bottom, cut), (top, cut, bottom, right)

        def energy(region: Region) -> float:
            return float(box_sum(table, *region))

        root = (0, 0, height, environment.width)
        return np.array(split_until(count, root, split, energy, self.order == "rounds"))
