"""A density over the unit square, constant in each cell of a grid, drawn by inversion.

A row is found by binary search in the running sums of the rows' totals, then a column in the row's
own running sums: Pharr, Jakob and Humphreys, "Physically Based Rendering", fourth edition 2023,
A.5.3. What a cell holds is the difference of two running sums, so that the density is exactly the
one that is drawn. One pass to build, O(log rows + log columns) a sample.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.grids.map_kernels import ROWS
from samplers.grids.running_sums import (
    DOWN,
    KEY,
    LOW,
    REAL_SIZE,
    RUN,
    WHOLE_SIZE,
    WITHIN,
    find_cells,
    guides_of,
    take,
)
from samplers.grids.tabulated import INSET
from samplers.threads import for_blocks


@kernel
def _sum_rows(weight, start, stop, prefix, row_total):
    for r in range(start, stop):
        total = 0.0
        for c in range(prefix.shape[1]):
            total += np.float64(weight[r, c])
            prefix[r, c] = total
        row_total[r] = total


@kernel
def _places(u, prefix, row_total, guide, marginal, marginal_guide, place):
    sums, guides = prefix.reshape(-1), guide.reshape(-1)
    whole, real = np.empty(WHOLE_SIZE, np.int32), np.empty(REAL_SIZE)
    for first in range(0, len(u), RUN):
        take(u, first, real)
        find_cells(sums, row_total, guides, marginal, marginal_guide, whole, real)
        for k in range(min(RUN, len(u) - first)):
            y = min(max(real[DOWN + k], INSET), 1.0 - INSET)
            x = min(max(real[WITHIN + k], INSET), 1.0 - INSET)
            place[first + k, 0] = whole[KEY + k] + y
            place[first + k, 1] = whole[LOW + k] + x


@kernel
def cell_weight(prefix, row, column):
    """What the cell holds."""
    below = prefix[row, column - 1] if column > 0 else 0.0
    return prefix[row, column] - below


@dataclass(frozen=True, eq=False)
class WeightTable:
    """Running sums of a grid's weights.

    prefix : (rows, columns) float64, along each row
    row_total, marginal : (rows,) float64, their last ones, and those summed up
    """

    prefix: NDArray[np.float64]
    row_total: NDArray[np.float64]
    marginal: NDArray[np.float64]
    guide: NDArray[np.int32]
    marginal_guide: NDArray[np.int32]

    @classmethod
    def of(cls, weight: NDArray[np.floating]) -> "WeightTable":
        """The table of weights (rows, columns), none negative, some positive."""
        return cls.filled(
            weight.shape, lambda a, b, prefix, total: _sum_rows(weight, a, b, prefix, total)
        )

    @classmethod
    def filled(cls, shape: tuple[int, ...], fill: Callable) -> "WeightTable":
        """The table whose rows a … b `fill(a, b, prefix, row_total)` writes."""
        prefix, row_total = np.empty(shape), np.empty(shape[0])
        for_blocks(lambda a, b: fill(a, b, prefix, row_total), shape[0], ROWS)
        marginal = np.cumsum(row_total)
        # One step of guide: whole rows are searched, as renderers do.
        return cls(
            prefix, row_total, marginal, guides_of(prefix, 1), guides_of(marginal[None], 1)[0]
        )

    @property
    def total(self) -> float:
        """Sum of all weights."""
        return float(self.marginal[-1])

    @property
    def nbytes(self) -> int:
        tables = (self.prefix, self.row_total, self.marginal, self.guide, self.marginal_guide)
        return sum(table.nbytes for table in tables)

    def places(self, u: NDArray[np.float32]) -> NDArray[np.float64]:
        """Row and column (n, 2), as real numbers, for random numbers u (n, 3).

        They keep a little away from the cells' edges, so that a direction rounded to float32 still
        lies in the cell that it was drawn from.
        """
        place = np.empty((len(u), 2))
        _places(
            u, self.prefix, self.row_total, self.guide, self.marginal, self.marginal_guide, place
        )
        return place
