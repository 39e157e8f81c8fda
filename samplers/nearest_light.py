"""Assign every pixel of a latitude-longitude grid to the nearest light, and sum up the cells.

These are spherical Voronoi cells, up to the size of a pixel. Pixels come in blocks: a light that is
farther from the block's centre than the nearest one by more than the block's diameter owns none of
its pixels, which leaves few candidates per block. Distances are chords, which keep their digits for
lights that nearly coincide, unlike an arc cosine.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from samplers.sphere import TWO_PI, row_solid_angle
from samplers.threads import for_blocks

BLOCK = 16
"""Pixels per side of a block."""
BANDS = 4
"""Rows of blocks that share one set of partial sums."""


@njit(cache=True)
def _chord2(ax, ay, az, bx, by, bz):
    dx, dy, dz = ax - bx, ay - by, az - bz
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def _pixel(row, column, r, c):
    """Direction of a pixel's centre from sine and cosine of its row's and its column's angle."""
    return column[c, 0] * row[r, 0], row[r, 1], -column[c, 1] * row[r, 0]


@njit(cache=True)
def _candidates(row, column, direction, top, left, bottom, right, chord, out):
    """Indices of the lights that may be nearest to a pixel of the block; returns their number."""
    mx, my, mz = _pixel(row, column, (top + bottom) // 2, (left + right) // 2)
    radius = 0.0
    for r in range(top, bottom):
        for c in range(left, right):
            x, y, z = _pixel(row, column, r, c)
            radius = max(radius, _chord2(x, y, z, mx, my, mz))
    nearest = 8.0
    for i in range(len(direction)):
        x, y, z = direction[i]
        chord[i] = _chord2(x, y, z, mx, my, mz)
        nearest = min(nearest, chord[i])
    # A little more than needed, so that rounding leaves no tie out.
    reach = (math.sqrt(nearest) + 2.0 * math.sqrt(radius)) * (1.0 + 1e-9) + 1e-12
    count = 0
    for i in range(len(direction)):
        if chord[i] <= reach * reach:
            out[count] = i
            count += 1
    return count


@njit(nogil=True, cache=True)
def _sum_cells(row, column, solid_angle, radiance, repeat, direction, start, stop, out):
    """Add solid angle, solid angle × angle and flux of the pixels of rows start..stop to `out`."""
    width = len(column)
    chord, candidate = np.empty(len(direction)), np.empty(len(direction), np.int64)
    for top in range(start, stop, BLOCK):
        bottom = min(top + BLOCK, stop)
        for left in range(0, width, BLOCK):
            right = min(left + BLOCK, width)
            count = _candidates(row, column, direction, top, left, bottom, right, chord, candidate)
            for r in range(top, bottom):
                for c in range(left, right):
                    x, y, z = _pixel(row, column, r, c)
                    nearest, owner = 8.0, candidate[0]
                    for k in range(count):
                        lx, ly, lz = direction[candidate[k]]
                        distance = _chord2(x, y, z, lx, ly, lz)
                        if distance < nearest:
                            nearest, owner = distance, candidate[k]
                    angle = 2.0 * math.asin(min(1.0, 0.5 * math.sqrt(nearest)))
                    out[owner, 0] += solid_angle[r]
                    out[owner, 1] += solid_angle[r] * angle
                    for channel in range(3):
                        value = np.float64(radiance[r // repeat, c // repeat, channel])
                        out[owner, 2 + channel] += solid_angle[r] * value


def nearest_light_cells(
    direction: NDArray[np.float64], radiance: NDArray[np.float32], repeat: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Solid angle (n,), mean angle to the light (n,) and flux (n, 3) of the lights' cells.

    direction : (n, 3) unit, at least one; of lights at equal distance the first owns the pixel
    radiance : (H, 2H, 3); each of its pixels is cut into `repeat` × `repeat` before the assignment
    The mean angle of a light without any pixel is NaN.
    """
    height = len(radiance) * repeat
    solid_angle = row_solid_angle(height, 2 * height)
    theta = (np.arange(height) + 0.5) * (math.pi / height)
    phi = (np.arange(2 * height) + 0.5) * (0.5 * TWO_PI / height)
    row, column = (np.stack([np.sin(a), np.cos(a)], axis=1) for a in (theta, phi))
    rows = BLOCK * BANDS
    parts = np.zeros(((height + rows - 1) // rows, len(direction), 5))
    direction = np.ascontiguousarray(direction)

    def work(start: int, stop: int) -> None:
        _sum_cells(
            row, column, solid_angle, radiance, repeat, direction, start, stop, parts[start // rows]
        )

    for_blocks(work, height, rows)
    total = parts.sum(axis=0)
    with np.errstate(invalid="ignore"):
        return total[:, 0], total[:, 1] / total[:, 0], total[:, 2:]
