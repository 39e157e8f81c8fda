"""The largest importance in any rectangle of a map, from a pyramid of maxima.

Level l holds the maximum over blocks of 2^l × 2^l pixels, where a pixel's importance is its
luminance times a weight of its row. A rectangle is covered by at most 3 × 3 blocks of one level, so
the answer is never too small and a small sun is never missed. Level 0 is the map itself and is not
stored; the others lie one after another in one flat float64 array.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.threads import for_blocks

ROWS = 32
"""Rows of a pyramid level per block of work."""


@dataclass(frozen=True, eq=False)
class MaxPyramid:
    """luminance (H, W) float32 and row_weight (H,) float64; their product is the importance.

    start : (levels,) int64, where each level begins in `maximum`; level 0 has no entries there
    maximum : flat float64
    """

    luminance: NDArray[np.float32]
    row_weight: NDArray[np.float64]
    start: NDArray[np.int64]
    maximum: NDArray[np.float64]

    @property
    def largest(self) -> float:
        """The importance of the most important pixel."""
        return float(self.maximum[-1])


@kernel
def _first_level(luminance, row_weight, start, stop, out):
    height, width = luminance.shape
    for r in range(start, stop):
        for c in range(out.shape[1]):
            largest = 0.0
            for row in range(2 * r, min(2 * r + 2, height)):
                brightest = luminance[row, 2 * c]
                if 2 * c + 1 < width:
                    brightest = max(brightest, luminance[row, 2 * c + 1])
                largest = max(largest, np.float64(brightest) * row_weight[row])
            out[r, c] = largest


@kernel
def _next_level(finer, start, stop, out):
    height, width = finer.shape
    for r in range(start, stop):
        for c in range(out.shape[1]):
            largest = 0.0
            for row in range(2 * r, min(2 * r + 2, height)):
                for column in range(2 * c, min(2 * c + 2, width)):
                    largest = max(largest, finer[row, column])
            out[r, c] = largest


def max_pyramid(luminance: NDArray[np.float32], row_weight: NDArray[np.float64]) -> MaxPyramid:
    """The pyramid of luminance × row_weight, up to a level of one block."""
    shape = [luminance.shape]
    while len(shape) == 1 or shape[-1] != (1, 1):
        height, width = shape[-1]
        shape.append(((height + 1) // 2, (width + 1) // 2))
    size = [0] + [height * width for height, width in shape[1:]]
    start = np.concatenate([[0], np.cumsum(size)])[:-1].astype(np.int64)
    maximum = np.empty(sum(size))
    finer: NDArray = luminance
    for level in range(1, len(shape)):
        out = maximum[start[level] : start[level] + size[level]].reshape(shape[level])

        def rows(a: int, b: int, finer: NDArray = finer, out: NDArray = out) -> None:
            if finer is luminance:
                _first_level(luminance, row_weight, a, b, out)
            else:
                _next_level(finer, a, b, out)

        for_blocks(rows, len(out), ROWS)
        finer = out
    return MaxPyramid(luminance, row_weight, start, maximum)


@kernel
def largest_in(luminance, row_weight, start, maximum, top, left, bottom, right):
    """An upper bound of the importance in rows top..bottom and columns left..right, inclusive.

    It is the exact maximum over the blocks of the finest level of which 3 × 3 are enough.
    """
    level = 0
    while (bottom >> level) - (top >> level) > 2 or (right >> level) - (left >> level) > 2:
        level += 1
    largest = 0.0
    if level == 0:
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                largest = max(largest, np.float64(luminance[row, column]) * row_weight[row])
        return largest
    width = ((luminance.shape[1] - 1) >> level) + 1
    for row in range(top >> level, (bottom >> level) + 1):
        for column in range(left >> level, (right >> level) + 1):
            largest = max(largest, maximum[start[level] + row * width + column])
    return largest
