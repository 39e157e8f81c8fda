"""A map as a coarse latitude-longitude grid that keeps every pixel's energy.

Each pixel belongs to one cell of the grid. A cell keeps its solid angle, its flux and the moment
of its luminous flux, so that a sum over cells is the sum over their pixels at full resolution.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.grids.light_leaves import COLUMNS, LightLeaves, add_run
from samplers.sphere import normalized, pixel_directions
from samplers.threads import for_blocks

BLOCK = 8
"""Rows of cells per block."""


@dataclass(frozen=True, eq=False)
class ReducedMap:
    """h × 2h cells, each array in row-major order.

    direction : (n, 3) of the cells' centres; solid_angle : (n,) in sr
    flux : (n, 3) ∫ L dω; luminous_flux : (n,) ∫ Y dω; moment : (n, 3) ∫ Y ω dω
    """

    height: int
    direction: NDArray[np.float64]
    solid_angle: NDArray[np.float64]
    flux: NDArray[np.float64]
    luminous_flux: NDArray[np.float64]
    moment: NDArray[np.float64]

    def leaves(self) -> tuple[LightLeaves, NDArray[np.bool_]]:
        """The cells with energy as lights, and the mask (n,) of which cells they are."""
        lit = self.luminous_flux > 0.0
        leaves = LightLeaves(
            normalized(self.moment[lit], self.direction[lit]),
            self.solid_angle[lit],
            self.flux[lit],
            self.luminous_flux[lit],
            self.moment[lit],
        )
        return leaves, lit


@kernel
def _add_rows(radiance, nothing, row_solid_angle, sine, cosine, start, stop, cells):
    """Add the pixels whose cell lies in rows [start, stop) of the grid."""
    height, coarse = len(nothing), len(cells)
    for row in range(start, stop):
        for r in range(-(-row * height // coarse), -(-(row + 1) * height // coarse)):
            theta = (r + 0.5) * math.pi / height
            sin_theta, cos_theta = math.sin(theta), math.cos(theta)
            for column in range(2 * coarse):
                left, right = -(-column * height // coarse), -(-(column + 1) * height // coarse)
                add_run(radiance, nothing, r, left, right, sine, cosine, row_solid_angle[r],
                        sin_theta, cos_theta, cells[row, column])  # fmt: skip


def reduce_map(environment: EnvironmentMap, rows: int) -> ReducedMap:
    """The map in at most `rows` × 2 `rows` cells; no more than it has pixels."""
    height, width = environment.height, environment.width
    coarse = min(rows, height)
    cells = np.zeros((coarse, 2 * coarse, COLUMNS))
    phi = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
    sine, cosine = np.sin(phi), np.cos(phi)
    nothing = np.zeros((height, width), np.bool_)

    def add(start: int, stop: int) -> None:
        _add_rows(environment.radiance, nothing, environment.row_solid_angle, sine, cosine, start,
                  stop, cells)  # fmt: skip

    for_blocks(add, coarse, BLOCK)
    flat = cells.reshape(-1, COLUMNS)
    flux = flat[:, 1:4].copy()
    return ReducedMap(
        coarse,
        pixel_directions(coarse).reshape(-1, 3),
        flat[:, 0].copy(),
        flux,
        flux @ LUMINANCE_WEIGHTS,
        flat[:, 4:7].copy(),
    )
