"""Vertex normals: smooth where a surface is smooth, split where it has an edge.

The corners of two triangles at a shared edge belong together if the triangles meet there at less
than the crease angle and agree about the outside. Each connected group of corners at a vertex
becomes one vertex of the mesh, whose normal is the mean of its triangles' normals, weighted with
area times corner angle. The area lets a flat face keep its own normal beside a narrow bevel; the
angle makes the result independent of the diagonal along which a rectangle is cut. Where the
normals of a group cancel, as on a sheet folded back on itself, one triangle's normal stands for
all.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.modelling.shape import Shape
from renderer.scene import Mesh


def shade(shape: Shape, crease: float = 40.0) -> Mesh:
    """The mesh of a shape, with normals that are smooth but for edges sharper than `crease`.

    shape : welded where it is to be smooth; no triangle without area
    crease : in degrees; 0 gives flat triangles, 180 no edge at all
    """
    corner = shape.vertex[shape.triangle]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    group = (
        shape.triangle.ravel() if crease >= 180.0 else _corner_groups(shape.triangle, unit, crease)
    )
    weight = _corner_angles(corner)[..., None] * normal[:, None, :]
    count = int(group.max()) + 1
    total = np.stack(
        [np.bincount(group, weight[..., axis].ravel(), count) for axis in range(3)], axis=1
    )
    vertex = np.empty((count, 3))
    vertex[group] = corner.reshape(-1, 3)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    cancelled = np.flatnonzero((length <= 1e-12 * length.max())[group, 0])
    total[group[cancelled]] = unit[cancelled // 3]
    length[group[cancelled]] = 1.0
    return Mesh(
        vertex.astype(np.float32),
        (total / length).astype(np.float32),
        group.reshape(-1, 3).astype(np.int32),
    )


def _corner_angles(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3) angle of each triangle at each of its corners."""
    ahead = np.roll(corner, -1, axis=1) - corner
    behind = np.roll(corner, 1, axis=1) - corner
    crossed = np.linalg.norm(np.cross(ahead, behind), axis=2)
    return np.arctan2(crossed, np.einsum("mij,mij->mi", ahead, behind))


def _corner_groups(
    triangle: NDArray[np.int64], unit: NDArray[np.float64], crease: float
) -> NDArray[np.int64]:
    """(3m,) number of the group that each corner belongs to."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    tail = triangle.ravel()
    head = np.roll(triangle, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    key = low * (int(triangle.max()) + 1) + high
    order = np.argsort(key, kind="stable")
    first, second = order[:-1], order[1:]
    cosine = np.einsum("ij,ij->i", unit[first // 3], unit[second // 3])
    same_winding = (key[first] == key[second]) & (tail[first] == head[second])
    smooth = same_winding & (cosine > np.cos(np.radians(crease)))
    first, second = first[smooth], second[smooth]

    # Edge 3t + i runs from corner i to corner i + 1 of triangle t; the neighbour's runs backwards.
    first_next = first - first % 3 + (first + 1) % 3
    second_next = second - second % 3 + (second + 1) % 3
    left = np.concatenate([first, first_next])
    right = np.concatenate([second_next, second])
    graph = coo_matrix((np.ones(len(left), np.int8), (left, right)), (len(tail), len(tail)))
    return connected_components(graph, directed=False)[1].astype(np.int64)
