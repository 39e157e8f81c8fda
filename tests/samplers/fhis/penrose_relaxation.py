"""Recompute the table of corrections: `python -m tests.samplers.fhis.penrose_relaxation`.

The points of a Penrose tiling are regular, but not evenly spaced. Their neighbourhoods repeat,
though: those with equal structural index at equal importance index look nearly alike. So Lloyd's
relaxation, which moves each point to the centroid of its Voronoi cell, is run with one shared
displacement per pair of indices, the average over all points of that pair in the tile's own frame.

Source: Ostromoukhov, Donohue, Jodoin, "Fast hierarchical importance sampling with blue noise
properties", ACM Transactions on Graphics 23(3), 2004. The paper leaves the number of steps open;
after 20 the spread of the cells' areas no longer falls. A row is relaxed at several importances at
once, the upper end of its range among them, so that structural indices which first occur there get
a displacement too. Indices that do not occur in a row stay zero.

The whole table takes a minute or two, once; it is kept as data beside the package's code.
"""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.fhis.max_pyramid import max_pyramid
from samplers.fhis.penrose import PHI, POINTS_PER_INTEGRAL, UNIT, births
from samplers.fhis.penrose_correction import INDICES, TABLE_FILE, Anchors, anchors, displacement

STEPS = 20
LEVEL = 10
"""Level of the points: 3500 to 8700 of them, enough neighbourhoods of every kind."""
WITHIN_ROW = (0.125, 0.375, 0.625, 0.875, 0.999)
"""Where in a row's range of importance the points are made."""
BORDER = 6.0
"""Points nearer to the root's border than this, in mean spacings, are not averaged."""

SIDE = 0.99 / PHI**2
CORNER = (0.005, 0.005)
"""A root triangle that fits into the unit square."""


def uniform_points(threshold: float) -> tuple[NDArray[np.float64], Anchors]:
    """Undisplaced positions (n, 2) of the points of a constant importance, and their frames."""
    constant = max_pyramid(np.ones((1, 1), np.float32), np.ones(1))
    born = births(constant, threshold, CORNER, SIDE)
    return born.position, anchors(born, np.full(len(born.code), threshold), SIDE)


def spacing(threshold: float) -> float:
    """1/√density of the points of a constant importance."""
    return SIDE / math.sqrt(POINTS_PER_INTEGRAL * threshold)


def inner(position: NDArray[np.float64], distance: float) -> NDArray[np.bool_]:
    """Which positions (n, 2) lie in the root, farther than `distance` from its border."""
    base = np.array([UNIT[15], UNIT[17]]) * SIDE * np.array([[PHI**2], [PHI]])
    corner = np.array(CORNER) + np.array([[0.0, 0.0], base[0], base[1]])
    edge = np.roll(corner, -1, axis=0) - corner
    normal = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1)[:, None]
    return ((position @ normal.T - np.sum(corner * normal, axis=1)) > distance).all(axis=1)


def voronoi_cells(position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Area (n,) and centroid (n, 2) of the Voronoi cells; NaN for unbounded ones.

    A cell is the fan of triangles from its point to its edges."""
    from scipy.spatial import Voronoi

    diagram = Voronoi(position)
    vertex = np.array(diagram.ridge_vertices)
    bounded = (vertex >= 0).all(axis=1)
    owner = diagram.ridge_points
    area, moment = np.zeros(len(position)), np.zeros((len(position), 2))
    a, b = (diagram.vertices[vertex[bounded, k]] for k in range(2))
    for side in range(2):
        point = owner[bounded, side]
        p, q = a - position[point], b - position[point]
        triangle = 0.5 * np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
        np.add.at(area, point, triangle)
        np.add.at(moment, point, triangle[:, None] * (p + q) / 3.0)
    area[owner[~bounded]] = np.nan
    return area, position + moment / area[:, None]


def relaxed_row(row: int, steps: int = STEPS) -> NDArray[np.float64]:
    """One row (21, 2) of the table, for the importance index `row`."""
    threshold = [
        PHI ** (2.0 * (LEVEL + (row + part) / INDICES)) / math.sqrt(5.0) for part in WITHIN_ROW
    ]
    sets = [(*uniform_points(value), BORDER * spacing(value)) for value in threshold]
    table = np.zeros((INDICES, INDICES, 2))
    for _ in range(steps):
        total, number = np.zeros((INDICES, 2)), np.zeros(INDICES)
        for position, anchor, border in sets:
            _, centroid = voronoi_cells(position + displacement(anchor, table))
            used = inner(position, border)
            wanted = centroid[used] - position[used]
            along, across = anchor.along[used], anchor.across[used]
            size = np.sum(along**2, axis=1)
            local = np.stack(
                [np.sum(wanted * along, axis=1) / size, np.sum(wanted * across, axis=1) / size],
                axis=1,
            )
            np.add.at(total, anchor.structure[used], local)
            number += np.bincount(anchor.structure[used], minlength=INDICES)
        table[row] = total / np.maximum(number, 1.0)[:, None]
    return table[row]


def relaxed_table(steps: int = STEPS) -> NDArray[np.float64]:
    """The correction table (21, 21, 2)."""
    return np.stack([relaxed_row(row, steps) for row in range(INDICES)])


if __name__ == "__main__":
    TABLE_FILE.parent.mkdir(exist_ok=True)
    np.save(TABLE_FILE, relaxed_table())
