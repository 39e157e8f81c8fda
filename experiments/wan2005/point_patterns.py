"""Patterns that are meant to cover the sphere evenly, each with about a wanted number of points.

All but Hammersley's exist only for certain numbers, so each takes the nearest one: lattices of
n × 2n points, 6 n² texels of a cube, 10 n² + 2 vertices of a divided icosahedron, 12 n² quads.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from samplers.grids.healpix_quads import quad_points
from samplers.sphere import pixel_directions

Points = NDArray[np.float64]


def _nearest(count: int, size: Callable[[int], int], first: int = 1) -> int:
    """The n ≥ first whose size(n) is closest to `count`."""
    n = first
    while size(n + 1) <= count:
        n += 1
    return n if abs(size(n) - count) <= abs(size(n + 1) - count) else n + 1


def lattice(count: int) -> Points:
    """Centres of a grid of n × 2n cells, equal in latitude and longitude."""
    return pixel_directions(_nearest(count, lambda n: 2 * n * n)).reshape(-1, 3)


def cube_map(count: int) -> Points:
    """Centres of the texels of the six faces of a cube, n × n each, on the sphere."""
    n = _nearest(count, lambda n: 6 * n * n)
    side = (2.0 * np.arange(n) + 1.0) / n - 1.0
    a, b = (grid.reshape(-1) for grid in np.meshgrid(side, side))
    one = np.ones_like(a)
    faces = [
        np.roll(np.stack([sign * one, a, b], axis=1), axis, axis=1)
        for axis in range(3)
        for sign in (1.0, -1.0)
    ]
    return _unit(np.concatenate(faces))


def icosahedron(count: int) -> Points:
    """Vertices of the icosahedron whose triangles are cut into n² each, pushed to the sphere."""
    from scipy.spatial import ConvexHull

    n = _nearest(count, lambda n: 10 * n * n + 2)
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    corners = np.array([(0.0, s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)])
    vertex = np.concatenate([np.roll(corners, axis, axis=1) for axis in range(3)])
    steps = [(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]
    weight = np.array(steps, np.float64) / n
    points = np.concatenate([weight @ vertex[face] for face in ConvexHull(vertex).simplices])
    # Neighbouring triangles share the points of their common edges.
    _, first = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True)
    return _unit(points[np.sort(first)])


def hammersley(count: int) -> Points:
    """Hammersley's points in base 2: heights (i + ½)/N, azimuths the bit-reversed i."""
    index = np.arange(count)
    azimuth, digit, rest = np.zeros(count), 0.5, index.copy()
    while rest.any():
        azimuth += digit * (rest & 1)
        digit, rest = digit / 2.0, rest >> 1
    z = 1.0 - (2.0 * index + 1.0) / count
    radius, phi = np.sqrt((1.0 - z) * (1.0 + z)), 2.0 * math.pi * azimuth
    return np.stack([radius * np.cos(phi), z, radius * np.sin(phi)], axis=1)


def healpix(count: int) -> Points:
    """Centres of HEALPix' 12 n² quads; n a power of two, as in a quad-tree."""
    level = _nearest(count, lambda k: 12 * 4**k, first=0)
    side = np.arange(2**level)
    grid = np.meshgrid([level], np.arange(12), side, side, indexing="ij")
    quad = np.stack(grid, axis=-1).reshape(-1, 4).astype(np.int64)
    return quad_points(quad, np.zeros(quad.shape))


def _unit(points: Points) -> Points:
    return points / np.linalg.norm(points, axis=1, keepdims=True)


PATTERNS: dict[str, Callable[[int], Points]] = {
    "lat-long lattice": lattice,
    "cube map": cube_map,
    "icosahedron": icosahedron,
    "Hammersley base 2": hammersley,
    "HEALPix": healpix,
}
