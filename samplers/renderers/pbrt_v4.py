"""pbrt-v4: an equal-area octahedral square, drawn by inversion, compensated for BRDF sampling.

The map is a square image of equal-area texels, as wide as the latitude-longitude map it is made
from, 6 × 6 look-ups a texel. A texel's weight is the mean of R, G and B. For next-event estimation
the mean of all weights is taken off and the rest clamped at 0; where nothing is left, the density
is uniform. A row is drawn from the marginal distribution, then a column from the row's own, by
binary search; the direction is uniform within the texel.

Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", fourth edition 2023, 12.5.2 and
A.5.3, and `imgtool makeequiarea` as read in 2026; the rules, not the code. There the light is the
square itself, filtered; here it is the map.

Parameters
    compensation : True (default, as it ships); False keeps the whole density. Two samples at least,
        one of the light and one of the BRDF, which finds what is taken off.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.octahedral import octahedral_means
from samplers.grids.tabulated import COMPENSATED_COUNT, UniformDistribution
from samplers.grids.weight_table import WeightTable, cell_weight
from samplers.lighting import LightDistribution
from samplers.reference import Reference
from samplers.renderers.compensation import RendererTable, channel_mean, compensated
from samplers.renderers.square import SPHERE, cells_of, directions_at

PARTS = 6
"""Look-ups of the map along each side of a texel."""


@kernel
def _weights(cell, prefix, scale, pdf):
    for i in range(len(cell)):
        pdf[i] = cell_weight(prefix, cell[i, 0], cell[i, 1]) * scale


@dataclass(frozen=True, eq=False, repr=False)
class InvertedSquare:
    """Directions by inversion of the weights of a square's texels."""

    table: WeightTable
    count: int
    map_reads: int

    @property
    def nbytes(self) -> int:
        return self.table.nbytes

    def _pdf(self, cell: NDArray[np.int64]) -> NDArray[np.float32]:
        pdf = np.empty(len(cell), np.float32)
        _weights(cell, self.table.prefix, self.table.prefix.size / (SPHERE * self.table.total), pdf)
        return pdf

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        place, direction = self.table.places(u), np.empty((len(u), 3), np.float32)
        directions_at(place, len(self.table.prefix), direction)
        return direction, self._pdf(place.astype(np.int64))

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        cell = np.empty((len(direction), 2), np.int64)
        cells_of(direction, len(self.table.prefix), cell)
        return self._pdf(cell)


@register("pbrt-v4")
@dataclass(frozen=True)
class PbrtV4(RendererTable):
    """The table of pbrt-v4's image light, beside BRDF sampling."""

    label: ClassVar[str] = "pbrt-v4 (Pharr 2023)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Matt Pharr, Wenzel Jakob, Greg Humphreys",
            "Physically based rendering: from theory to implementation, fourth edition",
            "MIT Press",
            2023,
            kind="book",
        ),
    )
    minimum_count: ClassVar[int] = COMPENSATED_COUNT

    compensation: bool = field(
        default=True, metadata={"fixed": "measured by the experiment `renderers`"}
    )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.is_black:
            return UniformDistribution(count)
        side = environment.width
        weight = octahedral_means(channel_mean(environment.radiance), side, PARTS)
        if self.compensation:
            weight = compensated(weight, np.ones(side))
        table = WeightTable.of(weight)
        if not table.total > 0.0:  # all light fell between the look-ups
            return UniformDistribution(count)
        return InvertedSquare(table, count, (side * PARTS) ** 2)
