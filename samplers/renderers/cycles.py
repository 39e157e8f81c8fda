"""Cycles: a table of the texture's size, at least 4096 × 2048, drawn by inversion.

Each cell holds the mean of R, G and B at its centre times sin θ there. A row is found by binary
search in the marginal distribution, then a column in the row's own; the direction is uniform in
both angles within the cell. No compensation. (A sun of the sky model is a light of its own there,
which no image has.)

Source: Blender's Cycles as read in 2026, `scene/light.cpp` and `kernel/light/background.h`; the
rules, not the code.

The table is large whatever the map's size: 8 bytes a cell, 67 MB at the least, and it is filled
cell by cell, which takes some tenths of a second.

Parameters
    compensation : False (default, as it ships); True takes the mean over the sphere off, as others
        do (see `compensation.py`)
    least_width : 4096 (default), the width below which no table goes
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from samplers.base import register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.tabulated import UniformDistribution
from samplers.grids.weight_table import WeightTable
from samplers.lighting import LightDistribution
from samplers.reference import Reference
from samplers.renderers.compensation import RendererTable, channel_mean, compensated
from samplers.renderers.lat_long import LatLongDistribution


@kernel
def _fill(radiance, start, stop, prefix, row_total):
    """Rows of running sums of the map, looked up at the table's cells, times sin θ."""
    rows, columns = prefix.shape
    height, width = radiance.shape
    for r in range(start, stop):
        row = min(int((r + 0.5) * height / rows), height - 1)
        sin_theta, total = math.sin((r + 0.5) * math.pi / rows), 0.0
        for c in range(columns):
            total += radiance[row, min(int((c + 0.5) * width / columns), width - 1)] * sin_theta
            prefix[r, c] = total
        row_total[r] = total


@register("cycles")
@dataclass(frozen=True)
class Cycles(RendererTable):
    """The table of Blender's Cycles, beside BRDF sampling."""

    label: ClassVar[str] = "Cycles (Blender 2026)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Blender",
            "Cycles, an open source production renderer",
            "Blender Foundation",
            2026,
            kind="misc",
            url="https://www.cycles-renderer.org",
        ),
    )

    least_width: int = field(default=4096, metadata={"fixed": "the renderer's own, as it ships"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.least_width < 2 or self.least_width % 2:
            raise EnvlightError(f"cycles: least_width {self.least_width}; use an even number")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        radiance = channel_mean(environment.radiance)
        if self.compensation and not environment.is_black:
            radiance = compensated(radiance, environment.row_solid_angle)
        columns = max(environment.width, self.least_width)
        table = WeightTable.filled(
            (columns // 2, columns),
            lambda a, b, prefix, total: _fill(radiance, a, b, prefix, total),
        )
        if not table.total > 0.0:
            return UniformDistribution(count)
        return LatLongDistribution(table, count, columns * columns // 2)
