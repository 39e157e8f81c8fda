"""The HEALPix grid, compiled: which cell of equal area holds a direction.

The sphere is cut into 12 base quads, each into side × side cells of exactly the same solid angle.
A cell is named by its face and its place in it, or by one NESTED number whose bits interleave that
place, so that four consecutive numbers are the children of one coarser cell. The grid's pole is
+Y and its longitude is this project's φ.

Source: Górski, Hivon, Banday, Wandelt, Hansen, Reinecke and Bartelmann, "HEALPix: a framework for
high-resolution discretization and fast analysis of data distributed on the sphere", The
Astrophysical Journal 622, 2005, section 4 and 5.
"""

import math

import numpy as np

from samplers.compiled import kernel


def cell_count(side: int) -> int:
    """Number of cells of the grid with side × side cells in each of its 12 faces."""
    return 12 * side * side


@kernel
def face_cell(y, sin_theta, quarter, side):
    """(face, i, j) of the cell that holds a direction; face in 0…11, i and j in 0…side−1.

    y : cosine of the polar angle; sin_theta : its sine, which keeps its digits at the poles
    quarter : φ in units of a quarter turn, in [0, 4)
    side : cells along an edge of a face, any positive integer
    """
    if 3.0 * abs(y) <= 2.0:
        across, up = side * (0.5 + quarter), side * 0.75 * y
        falling, rising = int(across - up), int(across + up)
        face_f, face_r = falling // side, rising // side
        if face_f == face_r:
            face = (face_f & 3) + 4
        elif face_f < face_r:
            face = face_f & 3
        else:
            face = (face_r & 3) + 8
        return face, rising - face_r * side, side - 1 - (falling - face_f * side)
    quadrant = min(int(quarter), 3)
    inside = quarter - quadrant
    reach = side * sin_theta * math.sqrt(3.0 / (1.0 + abs(y)))
    a, b = min(int(inside * reach), side - 1), min(int((1.0 - inside) * reach), side - 1)
    if y > 0.0:
        return quadrant, side - 1 - b, side - 1 - a
    return quadrant + 8, a, b


@kernel
def next_edge(y, sin_theta, quarter, side):
    """Where a walk along a parallel leaves the cell that holds the point, in quarter turns, ≤ 4."""
    if 3.0 * abs(y) <= 2.0:
        along, up = side * (0.5 + quarter), side * 0.75 * y
        step = min(math.floor(along - up) + up, math.floor(along + up) - up) + 1.0
        return min(step / side - 0.5, 4.0)
    quadrant = math.floor(quarter)
    inside = quarter - quadrant
    reach = side * sin_theta * math.sqrt(3.0 / (1.0 + abs(y)))
    forward = (math.floor(inside * reach) + 1.0) / reach
    backward = 1.0 - math.floor((1.0 - inside) * reach) / reach
    if backward <= inside:
        backward += 1.0 / reach
    return quadrant + min(forward, backward, 1.0)


@kernel
def spread_bits(value):
    """`value` (below 2³²) with a zero before each bit: the even bits of a NESTED number."""
    x = np.uint64(value)
    x = (x | (x << np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
    x = (x | (x << np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    x = (x | (x << np.uint64(2))) & np.uint64(0x3333333333333333)
    x = (x | (x << np.uint64(1))) & np.uint64(0x5555555555555555)
    return np.int64(x)


@kernel
def nested_index(face, i, j, side):
    """The NESTED number of cell (i, j) of a face; `side` is a power of two."""
    return face * side * side + (spread_bits(i) | (spread_bits(j) << 1))


@kernel
def quarter_turns(x, z):
    """φ of a direction in units of a quarter turn, in [0, 4)."""
    quarter = math.atan2(x, -z) * (2.0 / math.pi)
    if quarter < 0.0:
        quarter += 4.0
    return quarter if quarter < 4.0 else 0.0
