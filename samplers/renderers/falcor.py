"""Falcor and RTXDI: an equal-area octahedral square of 512², drawn by descent through its mips.

A texel's weight is the mean luminance of 8 × 8 look-ups. From the coarsest level down, one of four
texels is chosen by their weights, the random numbers being stretched and used again; the direction
is uniform within the texel. The table's size is the same for every map. No compensation.

Source: Falcor as read in 2026, `Rendering/Lights/EnvMapSampler`; the rules, not the code.

Parameters
    compensation : False (default, as it ships); True takes the mean over the sphere off, as others
        do (see `compensation.py`)
    side : 512 (default), of the square
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.mip_table import MipTable, descend
from samplers.grids.octahedral import octahedral_means
from samplers.grids.tabulated import INSET, UniformDistribution
from samplers.lighting import LightDistribution
from samplers.reference import Reference
from samplers.renderers.compensation import RendererTable, compensated
from samplers.renderers.square import SPHERE, cells_of, directions_at

PARTS = 8
"""Look-ups of the map along each side of a texel."""


@kernel
def _places(u, sums, start, width, place):
    for i in range(len(u)):
        row, column, x, y = descend(sums, start, width, np.float64(u[i, 0]), np.float64(u[i, 1]))
        place[i, 0] = row + min(max(y, INSET), 1.0 - INSET)
        place[i, 1] = column + min(max(x, INSET), 1.0 - INSET)


@kernel
def _weights(cell, sums, width, scale, pdf):
    for i in range(len(cell)):
        pdf[i] = sums[cell[i, 0] * width + cell[i, 1]] * scale


@dataclass(frozen=True, eq=False, repr=False)
class DescendedSquare:
    """Directions by descent through the mips of a square's texels."""

    table: MipTable
    side: int
    count: int
    map_reads: int

    @property
    def nbytes(self) -> int:
        return self.table.nbytes

    def _pdf(self, cell: NDArray[np.int64]) -> NDArray[np.float32]:
        pdf = np.empty(len(cell), np.float32)
        scale = self.side**2 / (SPHERE * self.table.total)
        _weights(cell, self.table.sums, self.table.width[0], scale, pdf)
        return pdf

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        place, direction = np.empty((len(u), 2)), np.empty((len(u), 3), np.float32)
        _places(u, self.table.sums, self.table.start, self.table.width, place)
        directions_at(place, self.side, direction)
        return direction, self._pdf(place.astype(np.int64))

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        cell = np.empty((len(direction), 2), np.int64)
        cells_of(direction, self.side, cell)
        return self._pdf(cell)


@register("falcor")
@dataclass(frozen=True)
class Falcor(RendererTable):
    """The table of Falcor's environment sampler, beside BRDF sampling."""

    label: ClassVar[str] = "Falcor (Kallweit 2022)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Simon Kallweit, Petrik Clarberg, Craig Kolb, Tomáš Davidovič, Kai-Hwa Yao, "
            "Theresa Foley, Yong He, Lifan Wu, Lucy Chen, Tomas Akenine-Möller, Chris Wyman, "
            "Cyril Crassin, Nir Benty",
            "The Falcor rendering framework",
            "NVIDIA",
            2022,
            kind="misc",
            url="https://github.com/NVIDIAGameWorks/Falcor",
        ),
    )

    side: int = field(default=512, metadata={"fixed": "the renderer's own, as it ships"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side < 1:
            raise EnvlightError(f"falcor: side {self.side}; use a number from 1")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.is_black:
            return UniformDistribution(count)
        weight = octahedral_means(environment.luminance, self.side, PARTS)
        if self.compensation:
            weight = compensated(weight, np.ones(self.side))
        table = MipTable.of(weight)
        if not table.total > 0.0:  # all light fell between the look-ups
            return UniformDistribution(count)
        return DescendedSquare(table, self.side, count, (self.side * PARTS) ** 2)
