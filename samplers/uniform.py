"""Uniform directions: the naive floor that every other sampler has to beat.

The sphere is cut into `count` cells of equal solid angle, bands of equal height in cos θ split in
azimuth, so that each cell is about as wide as it is high. One light stands at the energy centroid
of each cell and carries the cell's integral of radiance. Importance plays no part: a sun gets one
light only because it lies in one cell. Stratified sampling of the sphere is textbook material; the
equal-area bands follow Leopardi, "A partition of the unit sphere into regions of equal area and
small diameter", 2006, with the number of cells per band rounded so that they sum to the count.

Parameters
    light_extent : how far a light's cluster reaches, by which interleaved sampling perturbs it:
        "mean", "largest" or "full", the same for all samplers (`samplers.lighting`)
    sets : "perturbed" (default) or "independent", eight sets of its own
        (`samplers.independent_sets`)
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.environment import EnvironmentMap
from samplers.grids.regions import lights_of_regions
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets


def cells_per_band(count: int) -> NDArray[np.int64]:
    """Cells in each band from pole to pole; they sum to `count` and make squarish cells."""
    bands = max(1, round(math.sqrt(count * math.pi / 4.0)))
    edge = np.linspace(0.0, math.pi, bands + 1)
    share = np.cumsum((np.cos(edge[:-1]) - np.cos(edge[1:])) / 2.0) * count
    return np.diff(np.concatenate([[0], np.round(share).astype(np.int64)]))


@register("uniform")
@dataclass(frozen=True)
class Uniform(LightSampler):
    """Lights in equal-area cells, whatever the map shows."""

    label: ClassVar[str] = "Uniform"

    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        cells = cells_per_band(count)
        cells = cells[cells > 0]
        height, width = environment.height, environment.width
        below = np.cumsum(cells) / count
        theta = np.arccos(np.clip(1.0 - 2.0 * below, -1.0, 1.0))
        row = np.concatenate([[0], np.round(theta / math.pi * height).astype(np.int64)])
        row[-1] = height
        regions = []
        for top, bottom, number in zip(row[:-1], row[1:], cells, strict=True):
            column = np.round(np.linspace(0.0, width, number + 1)).astype(np.int64)
            regions += [
                (top, left, bottom, right)
                for left, right in pairwise(column)
                if bottom > top and right > left
            ]
        region = np.array(regions, np.int64).reshape(-1, 4)
        return lights_of_regions(environment, region, light_extent=self.light_extent)
