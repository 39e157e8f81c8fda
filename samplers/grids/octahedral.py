"""The equal-area octahedral map: the sphere as a square, without seams that jump or poles.

Each octant is a triangle of the square, the upper half its inner diamond and the lower half its
four corners. With U and V in [−1, 1] and r = |U| + |V| on the upper half, y = 1 − r² and the
azimuth runs evenly through each quadrant; on the lower half, both are mirrored at the diamond's
edge. Equal areas of the square are equal solid angles, 4π sr in all.

Source: Clarberg, "Fast equal-area mapping of the (hemi)sphere using SIMD", Journal of Graphics
Tools 13(3), 2008. Here the axis of the octahedron is the map's, +Y, and U points to −Z, where
azimuths begin.
"""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.grids.map_kernels import ROWS
from samplers.sphere import sine_cosine, turns
from samplers.threads import for_blocks


@kernel
def square_to_direction(u, v, out):
    """Write the unit direction (3,) at (u, v) in [0, 1]²."""
    x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
    a, b = abs(x), abs(y)
    upper = a + b <= 1.0
    if not upper:
        a, b = 1.0 - b, 1.0 - a
    r = a + b
    quarter = b / r if r > 0.0 else 0.0
    if x < 0.0:
        turn = 0.5 - 0.25 * quarter if y >= 0.0 else 0.5 + 0.25 * quarter
    else:
        turn = 0.25 * quarter if y >= 0.0 else 1.0 - 0.25 * quarter
    height = (1.0 - r) * (1.0 + r)
    horizontal = r * math.sqrt(max(0.0, 2.0 - r * r))
    sine, cosine = sine_cosine(turn)
    out[0], out[1], out[2] = sine * horizontal, height if upper else -height, -cosine * horizontal


@kernel
def direction_to_square(x, y, z):
    """(u, v) in [0, 1]² of a direction of about unit length."""
    flat = x * x + z * z
    # 1 − |y| without cancellation near the axis.
    r = math.sqrt(min(flat / (1.0 + abs(y)), 1.0))
    place = 4.0 * turns(x, -z)
    quadrant = min(int(place), 3)
    quarter = place - quadrant
    if quadrant & 1:
        quarter = 1.0 - quarter
    a, b = r * (1.0 - quarter), r * quarter
    if y < 0.0:
        a, b = 1.0 - b, 1.0 - a
    if quadrant == 1 or quadrant == 2:
        a = -a
    if quadrant >= 2:
        b = -b
    return 0.5 * (a + 1.0), 0.5 * (b + 1.0)


@kernel
def _mean_rows(value, row_of, side, parts, start, stop, out):
    """Means over texels of a square; row_of[k] is the map's row at r = k / (side · parts)."""
    height, width = value.shape
    size = side * parts
    for i in range(start, stop):
        for j in range(side):
            total = 0.0
            for fine_v in range(i * parts, (i + 1) * parts):
                y = 2 * fine_v + 1 - size
                for fine_u in range(j * parts, (j + 1) * parts):
                    x = 2 * fine_u + 1 - size
                    a, b = abs(x), abs(y)
                    upper = a + b <= size
                    if not upper:
                        a, b = size - b, size - a
                    quarter = b / (a + b) if a + b > 0 else 0.0
                    if x < 0:
                        turn = 0.5 - 0.25 * quarter if y >= 0 else 0.5 + 0.25 * quarter
                    else:
                        turn = 0.25 * quarter if y >= 0 else 1.0 - 0.25 * quarter
                    column = min(int(turn * width), width - 1)
                    row = row_of[a + b]
                    total += value[row if upper else height - 1 - row, column]
            out[i, j] = total / (parts * parts)


def octahedral_means(value: NDArray, side: int, parts: int) -> NDArray[np.float64]:
    """A latitude-longitude map (H, 2H) as a square (side, side), by parts² look-ups a texel.

    Places of look-ups are evenly spaced, so r takes few values: rows of the map come from a table,
    and columns need no trigonometry.
    """
    height, size = len(value), side * parts
    r = np.arange(size + 1) / size
    angle = 2.0 * np.arcsin(np.minimum(r * math.sqrt(0.5), 1.0))  # y = 1 − r² = cos θ
    row_of = np.minimum((angle / math.pi * height).astype(np.int64), height - 1)
    out = np.empty((side, side))
    for_blocks(lambda a, b: _mean_rows(value, row_of, side, parts, a, b, out), side, ROWS)
    return out
