"""HEALPix quads of any size: where they lie, and which longitudes they cover on a parallel.

A quad is a row (level, face, i, j): one of the 4^level cells of equal solid angle of one of the 12
faces. On a parallel it covers one interval of longitude, whose ends are formulas; neighbours share
them. A face is mapped to the unit square with equal area.

Source: Górski et al., "HEALPix: a framework for high-resolution discretization and fast analysis
of data distributed on the sphere", The Astrophysical Journal 622, 2005; Wan, Wong and Leung,
"Spherical Q²-tree for sampling dynamic environment sequences", EGSR 2005, equations 2–6 and 10.
"""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.grids.regions import GAUSS_NODE, GAUSS_WEIGHT
from samplers.lighting import LIGHT_EXTENT, LightExtent, extent_of


@kernel
def interval(face, x0, x1, y0, y1, y, sigma):
    """Longitudes between which a parallel lies in a quad, in quarter turns; low ≥ high if none.

    x0, x1, y0, y1 : sides of the quad in its face, in [0, 1]
    y, sigma : cosine of the polar angle, and √(3(1 − |y|))
    """
    band, first = face // 4, np.float64(face & 3)
    if 3.0 * abs(y) <= 2.0:
        across = 0.5 + 0.75 * (y - (1 - band) * (2.0 / 3.0))
        centre = first if band == 1 else first + 0.5
        return centre + max(x0 - across, across - y1), centre + min(x1 - across, across - y0)
    if band == 0 and y > 0.0:
        low = max((1.0 - y1) / sigma, 1.0 - (1.0 - x0) / sigma)
        return first + low, first + min((1.0 - y0) / sigma, 1.0 - (1.0 - x1) / sigma)
    if band == 2 and y < 0.0:
        low = max(x0 / sigma, 1.0 - y1 / sigma)
        return first + low, first + min(x1 / sigma, 1.0 - y0 / sigma)
    return 1.0, 0.0


@kernel
def height_at(face, x, y):
    """(cos θ, sin θ) at a place in a face; x, y in [0, 1]."""
    band, s = face // 4, x + y
    if (band == 0 and s > 1.0) or (band == 2 and s < 1.0):
        depth = (2.0 - s if band == 0 else s) ** 2 / 3.0
        cosine = 1.0 - depth if band == 0 else depth - 1.0
        return cosine, math.sqrt(depth * (2.0 - depth))
    cosine = ((1 - band) + (s - 1.0)) * (2.0 / 3.0)
    return cosine, math.sqrt((1.0 - cosine) * (1.0 + cosine))


@kernel
def direction_at(face, x, y):
    """The unit direction (3 numbers) at a place in a face; x, y in [0, 1]."""
    band, s = face // 4, x + y
    cosine, sine = height_at(face, x, y)
    if band == 0 and s > 1.0:
        quarter = (face & 3) + ((1.0 - y) / (2.0 - s) if s < 2.0 else 0.5)
    elif band == 2 and s < 1.0:
        quarter = (face & 3) + (x / s if s > 0.0 else 0.5)
    else:
        quarter = (face & 3) + (0.0 if band == 1 else 0.5) + 0.5 * (x - y)
    phi = quarter * (0.5 * math.pi)
    return math.sin(phi) * sine, cosine, -math.cos(phi) * sine


@kernel
def sides_of(quad):
    scale = 1.0 / (1 << quad[0])
    return quad[2] * scale, (quad[2] + 1) * scale, quad[3] * scale, (quad[3] + 1) * scale


@kernel
def _places(quad, offset, out):
    for i in range(len(quad)):
        x0, x1, y0, y1 = sides_of(quad[i])
        x = x0 + (0.5 + offset[i, 0]) * (x1 - x0)
        y = y0 + (0.5 + offset[i, 1]) * (y1 - y0)
        out[i, 0], out[i, 1], out[i, 2] = direction_at(quad[i, 1], x, y)


@kernel
def _angles(quad, direction, node, weight, out):
    """Mean and largest angle (n, 2) over a lattice of places in each quad."""
    for i in range(len(quad)):
        x0, x1, y0, y1 = sides_of(quad[i])
        dx, dy, dz = direction[i]
        total = largest = 0.0
        for a in range(len(node)):
            for b in range(len(node)):
                u = 0.5 * (x0 + x1) + 0.5 * (x1 - x0) * node[a]
                v = 0.5 * (y0 + y1) + 0.5 * (y1 - y0) * node[b]
                x, y, z = direction_at(quad[i, 1], u, v)
                cx, cy, cz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
                angle = math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), x * dx + y * dy + z * dz)
                total += 0.25 * weight[a] * weight[b] * angle
                largest = max(largest, angle)
        out[i, 0], out[i, 1] = total, largest


def quad_points(quad: NDArray[np.int64], offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit directions (n, 3) in the quads (n, 4), `offset` (n, 2) sides away from their centres."""
    out = np.empty((len(quad), 3))
    _places(quad, offset, out)
    return out


def quad_extent(
    quad: NDArray[np.int64],
    direction: NDArray[np.float64],
    light_extent: LightExtent = LIGHT_EXTENT,
) -> NDArray[np.float64]:
    """Extents (n,) of lights in the directions (n, 3) that stand for the quads.

    The mean is by 8 × 8 Gauss points; a face is mapped with equal area, so they count by solid
    angle. The largest is over 9 × 9 points that include corners and edges: no point within less
    than a hemisphere is farther than one on its border, and an edge bends little between two.
    """
    out = np.empty((len(quad), 2))

    def angles(node: NDArray, weight: NDArray) -> NDArray[np.float64]:
        _angles(quad, direction, node, weight, out)
        return out

    return extent_of(
        light_extent,
        lambda: angles(GAUSS_NODE, GAUSS_WEIGHT)[:, 0].copy(),
        lambda: angles(np.linspace(-1.0, 1.0, 9), np.zeros(9))[:, 1].copy(),
    )
