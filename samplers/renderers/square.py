"""What the two tables over the equal-area octahedral square share: its cells as directions.

All cells have the same solid angle, so a density is a cell's share of the weights, times the number
of cells, over 4π.
"""

import math

import numpy as np

from samplers.compiled import kernel
from samplers.grids.octahedral import direction_to_square, square_to_direction

SPHERE = 4.0 * math.pi


@kernel
def directions_at(place, side, direction):
    """Write the directions (n, 3) at the rows and columns `place` (n, 2) of a square."""
    way = np.empty(3)
    for i in range(len(place)):
        square_to_direction(place[i, 1] / side, place[i, 0] / side, way)
        direction[i, 0], direction[i, 1], direction[i, 2] = way[0], way[1], way[2]


@kernel
def cells_of(direction, side, cell):
    """Write the rows and columns (n, 2) int64 of the directions (n, 3)."""
    for i in range(len(direction)):
        u, v = direction_to_square(
            np.float64(direction[i, 0]), np.float64(direction[i, 1]), np.float64(direction[i, 2])
        )
        cell[i, 0] = min(int(v * side), side - 1)
        cell[i, 1] = min(int(u * side), side - 1)
