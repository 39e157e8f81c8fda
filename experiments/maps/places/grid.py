"""Grids of points on the faces of solids, and looking up what is stored at them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.maps.places.rays import CYLINDER, MISS
from experiments.maps.places.shapes import Array
from samplers.compiled import kernel


@dataclass(frozen=True, eq=False)
class Grid:
    """Grid points of all faces: face (s, f) owns size[s, f] from offset[s, f], row by row."""

    offset: NDArray[np.int64]
    size: NDArray[np.int64]
    point: Array
    normal: Array
    solid: NDArray[np.int64]


def grid_of(bounds: Array, kind: NDArray[np.int64], room: bool, spacing: float, most: int) -> Grid:
    """Points about `spacing` apart, at least 2 and at most `most` along a face's side."""
    offset = np.zeros((len(bounds), 6), np.int64)
    size = np.zeros((len(bounds), 6, 2), np.int64)
    points, normals, solids = [], [], []
    total = 0
    for s, box in enumerate(bounds):
        for f in range(6):
            if kind[s] == CYLINDER and f not in (0, 2, 3):
                continue
            point, normal, shape = _face_grid(box, f, kind[s] == CYLINDER, spacing, most)
            inward = room and s == 0
            points.append(point - 1e-4 * normal if inward else point + 1e-4 * normal)
            normals.append(-normal if inward else normal)
            solids.append(np.full(len(point), s))
            offset[s, f], size[s, f] = total, shape
            total += len(point)
    return Grid(
        offset, size, np.concatenate(points), np.concatenate(normals), np.concatenate(solids)
    )


def _face_grid(
    box: Array, face: int, round_: bool, spacing: float, most: int
) -> tuple[Array, Array, tuple[int, int]]:
    low, high = box[:3], box[3:]
    axis = face // 2
    a, b = (axis + 1) % 3, (axis + 2) % 3
    mantle = round_ and face == 0
    width, depth = high[a] - low[a], high[b] - low[b]
    if mantle:
        width, depth = high[1] - low[1], math.pi * (high[0] - low[0])
    n, m = (int(np.clip(math.ceil(side / spacing), 2, most)) for side in (width, depth))
    p, q = (np.indices((n, m)).reshape(2, -1) + 0.5) / np.array([[n], [m]])
    point, normal = np.empty((n * m, 3)), np.zeros((n * m, 3))
    if mantle:
        turn = q * 2.0 * math.pi
        normal[:, 0], normal[:, 2] = np.cos(turn), np.sin(turn)
        point[:] = 0.5 * (low + high) + 0.5 * (high[0] - low[0]) * normal
        point[:, 1] = low[1] + p * width
    else:
        point[:, axis] = (high if face % 2 else low)[axis]
        point[:, a], point[:, b] = low[a] + p * width, low[b] + q * depth
        normal[:, axis] = 1.0 if face % 2 else -1.0
    return point, normal, (n, m)


@kernel
def _grid_place(size, bounds, kind, solid, face, p):
    """Row and column of a point on a face, in steps of its grid, 0 at the first grid point."""
    box = bounds[solid]
    if kind[solid] == CYLINDER and face == 0:
        x = (p[1] - box[1]) / (box[4] - box[1])
        turn = math.atan2(p[2] - 0.5 * (box[2] + box[5]), p[0] - 0.5 * (box[0] + box[3]))
        y = turn / (2.0 * math.pi)
        y -= math.floor(y)
    else:
        a, b = (face // 2 + 1) % 3, (face // 2 + 2) % 3
        x = (p[a] - box[a]) / (box[a + 3] - box[a])
        y = (p[b] - box[b]) / (box[b + 3] - box[b])
    return x * size[solid, face, 0] - 0.5, y * size[solid, face, 1] - 0.5


@kernel
def lookup(values, offset, size, bounds, kind, solid, face, p, out):
    """Bilinear irradiance (3,) at a point on a face, written to `out`."""
    n, m = size[solid, face, 0], size[solid, face, 1]
    mantle = kind[solid] == CYLINDER and face == 0
    x, y = _grid_place(size, bounds, kind, solid, face, p)
    i, j = math.floor(x), math.floor(y)
    x, y = min(max(x - i, 0.0), 1.0), min(max(y - j, 0.0), 1.0)
    i0, i1 = min(max(i, 0), n - 1), min(max(i + 1, 0), n - 1)
    if mantle:
        j0, j1 = j % m, (j + 1) % m
    else:
        j0, j1 = min(max(j, 0), m - 1), min(max(j + 1, 0), m - 1)
    base = offset[solid, face]
    for c in range(3):
        top = values[base + i0 * m + j0, c] * (1.0 - y) + values[base + i0 * m + j1, c] * y
        low = values[base + i1 * m + j0, c] * (1.0 - y) + values[base + i1 * m + j1, c] * y
        out[c] = top * (1.0 - x) + low * x


@kernel
def look_up_all(values, offset, size, bounds, kind, hit, point, out):
    """Irradiance (n, 3) at points on faces; rays that hit nothing are left alone."""
    for n in range(len(point)):
        if hit[n, 0] != MISS:
            lookup(values, offset, size, bounds, kind, hit[n, 0], hit[n, 1], point[n], out[n])


@kernel
def cell_of(offset, size, bounds, kind, solid, face, p):
    """Index of the grid point whose cell on a face holds the point p."""
    x, y = _grid_place(size, bounds, kind, solid, face, p)
    n, m = size[solid, face, 0], size[solid, face, 1]
    i, j = min(max(math.floor(x + 0.5), 0), n - 1), min(max(math.floor(y + 0.5), 0), m - 1)
    return offset[solid, face] + i * m + j
