"""Drawing a cell of a grid by descent through coarser and coarser sums of four.

At each level one of two random numbers chooses the row and the other the column among four cells,
by their sums, and what is left of the numbers goes on. Neighbouring numbers stay neighbours, in
both axes alike. Source: Clarberg, Jarosz, Akenine-Möller and Jensen, "Wavelet importance sampling",
SIGGRAPH 2005, section 4 (hierarchical sample warping).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel

BELOW_ONE = 1.0 - 2.0**-53


@kernel
def _choose(value, first, second):
    """Whether the second of two weights is chosen, and what is left of the number."""
    share = first / (first + second)
    if value < share:
        return False, min(value / share, BELOW_ONE)
    return True, min((value - share) / (1.0 - share), BELOW_ONE)


@kernel
def descend(sums, start, width, x, y):
    """Row and column of the cell that the numbers x, y in [0, 1) choose, and what is left of them.

    sums, start, width : of a `MipTable`
    """
    row = column = 0
    for level in range(len(start) - 1, -1, -1):
        at = start[level] + 2 * row * width[level] + 2 * column
        below = at + width[level]
        low, y = _choose(y, sums[at] + sums[at + 1], sums[below] + sums[below + 1])
        if low:
            at = below
        right, x = _choose(x, sums[at], sums[at + 1])
        row, column = 2 * row + low, 2 * column + right
    return row, column, x, y


@dataclass(frozen=True, eq=False)
class MipTable:
    """A grid of weights and its sums of four, down to four cells, one after another.

    sums : (n,) float64, all levels, each with an even number of rows and columns
    start, width : (levels,) where each begins, from the finest on, and its columns
    """

    sums: NDArray[np.float64]
    start: NDArray[np.int64]
    width: NDArray[np.int64]

    @classmethod
    def of(cls, weight: NDArray[np.float64]) -> "MipTable":
        """The table of weights (rows, columns), none negative, some positive."""
        levels = [_even(weight)]
        while levels[-1].size > 4:
            last = levels[-1]
            rows, columns = last.shape[0] // 2, last.shape[1] // 2
            levels.append(_even(last.reshape(rows, 2, columns, 2).sum(axis=(1, 3))))
        size = np.array([level.size for level in levels])
        return cls(
            np.concatenate([level.ravel() for level in levels]),
            np.cumsum(size) - size,
            np.array([level.shape[1] for level in levels]),
        )

    @property
    def total(self) -> float:
        """Sum of all weights."""
        return float(self.sums[-4:].sum())

    @property
    def nbytes(self) -> int:
        return self.sums.nbytes + self.start.nbytes + self.width.nbytes


def _even(grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """The grid with a row or column of zeros more where there are odd ones."""
    return np.pad(grid, [(0, size % 2) for size in grid.shape])
