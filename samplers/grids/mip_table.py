"""Drawing a cell of a grid by descent through coarser and coarser sums of four.

At each level one of two random numbers chooses the row and the other the column among four cells,
by their sums, and what is left of the numbers goes on. Neighbouring numbers stay neighbours, in
both axes alike. Source: Clarberg, Jarosz, Akenine-Möller and Jensen, "Wavelet importance sampling",
SIGGRAPH 2005, section 4 (hierarchical sample warping).
"""

import math
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
def descend_from(sums, start, width, level, row, column, x, y):
    """`descend` from a cell of a level, whose cells are 2^level ones of the grid wide and high."""
    for below_it in range(level - 1, -1, -1):
        at = start[below_it] + 2 * row * width[below_it] + 2 * column
        below = at + width[below_it]
        low, y = _choose(y, sums[at] + sums[at + 1], sums[below] + sums[below + 1])
        if low:
            at = below
        right, x = _choose(x, sums[at], sums[at + 1])
        row, column = 2 * row + low, 2 * column + right
    return row, column, x, y


@kernel
def descend(sums, start, width, x, y):
    """Row and column of the cell that the numbers x, y in [0, 1) choose, and what is left of them.

    sums, start, width : of a `MipTable`
    """
    return descend_from(sums, start, width, len(start), 0, 0, x, y)


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
        shapes = [_even(weight.shape)]
        while math.prod(shapes[-1]) > 4:
            shapes.append(_even(tuple(size // 2 for size in shapes[-1])))
        size = np.array([math.prod(shape) for shape in shapes])
        start = np.cumsum(size) - size
        sums, grid = np.zeros(size.sum()), weight
        for at, shape in zip(start, shapes, strict=True):
            level = sums[at : at + math.prod(shape)].reshape(shape)
            level[: grid.shape[0], : grid.shape[1]] = grid
            rows, columns = (half // 2 for half in shape)
            grid = level.reshape(rows, 2, columns, 2).sum(axis=(1, 3))
        return cls(sums, start, np.array([shape[1] for shape in shapes]))

    @property
    def total(self) -> float:
        """Sum of all weights."""
        return float(self.sums[-4:].sum())

    @property
    def nbytes(self) -> int:
        return self.sums.nbytes + self.start.nbytes + self.width.nbytes


def _even(shape: tuple[int, ...]) -> tuple[int, ...]:
    """The shape with a row or column more where there are odd ones."""
    return tuple(size + size % 2 for size in shape)
