"""Small emitters, rasterised with exact energy.

An emitter is a closed loop of directions filled with one radiance: the sun's disc, a lamp, a tube.
With longitude φ and height z = cos θ as coordinates the sphere unrolls onto a rectangle without any
change of area (Archimedes), each texel is a rectangle there, and the share of a texel inside a loop
is found exactly from the loop's edges: each edge adds the signed area to its right, and a running
sum along the row completes it. What a loop adds to the map is then scaled to its true solid angle,
so that an emitter's flux is the same at every resolution, over the seam and over a pole.

Cost: O(edges + texels of the loop's bounding box).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.maps.places.shapes import Array
from samplers.compiled import kernel
from samplers.sphere import cap_solid_angle, normalized

LONGEST_STEP = 0.05
"""An edge is halved until it spans at most this much longitude, in radians."""


@dataclass(frozen=True, eq=False)
class Emitter:
    """loop : (k, 3) unit directions round the emitter; radiance : (3,); solid_angle : in sr."""

    loop: Array
    radiance: Array
    solid_angle: float


def frame(axis: ArrayLike) -> tuple[Array, Array]:
    """Two unit vectors that make a right-handed frame with the unit `axis` (3,)."""
    axis = np.asarray(axis, np.float64)
    helper = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def disc(direction: ArrayLike, half_angle: float, radiance: ArrayLike, edges: int = 96) -> Emitter:
    """A spherical cap of uniform radiance."""
    axis = normalized(direction, [0.0, 1.0, 0.0])
    u, v = frame(axis)
    turn = np.arange(edges)[:, None] * (2.0 * math.pi / edges)
    ring = np.cos(turn) * u + np.sin(turn) * v
    loop = math.cos(half_angle) * axis + math.sin(half_angle) * ring
    return Emitter(loop, np.asarray(radiance, np.float64), float(cap_solid_angle(half_angle)))


def polygon(corners: ArrayLike, radiance: ArrayLike) -> Emitter:
    """A spherical polygon, star-shaped about its mean; corners (k, 3) of any positive length."""
    loop = normalized(corners, [0.0, 1.0, 0.0])
    return Emitter(loop, np.asarray(radiance, np.float64), abs(polygon_solid_angle(loop)))


def polygon_solid_angle(loop: Array) -> float:
    """Signed solid angle of a loop of unit directions, as a fan of triangles round its mean.

    Van Oosterom & Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 1983.
    """
    centre = normalized(loop.mean(axis=0), loop[0])
    following = np.roll(loop, -1, axis=0)
    triple = np.cross(loop, following) @ centre
    below = 1.0 + loop @ centre + following @ centre + np.sum(loop * following, axis=1)
    return float(2.0 * np.arctan2(triple, below).sum())


def _unrolled(loop: Array) -> tuple[Array, Array]:
    """Longitude without jumps and z of a closed loop, its first point repeated at the end.

    A loop round a pole does not close in longitude; it is closed along the pole's edge.
    """
    points = [loop[0]]
    for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
        points.extend(_steps(start, end, 12))
    path = np.array(points)
    phi = np.unwrap(np.arctan2(path[:, 0], -path[:, 2]))
    z = path[:, 1].copy()
    if abs(phi[-1] - phi[0]) > math.pi:
        pole = 1.0 if loop[:, 1].mean() > 0.0 else -1.0
        phi = np.concatenate([phi, [phi[-1], phi[0], phi[0]]])
        z = np.concatenate([z, [pole, pole, z[0]]])
    return phi, z


def _steps(start: Array, end: Array, depth: int) -> list[Array]:
    """Points after `start` up to `end` along the great circle, close in longitude."""
    turn = math.atan2(start[0], -start[2]) - math.atan2(end[0], -end[2])
    turn = abs((turn + math.pi) % (2.0 * math.pi) - math.pi)
    if depth == 0 or (turn <= LONGEST_STEP and float(start @ end) > 1.0 - LONGEST_STEP**2):
        return [end]
    middle = normalized(start + end, start)
    return _steps(start, middle, depth - 1) + _steps(middle, end, depth - 1)


@kernel
def _accumulate(x, z, top, left, edge_z, area):
    """Signed area in units of (column × z) that the path x, z encloses to its right, per texel."""
    rows = area.shape[0]
    for n in range(len(x) - 1):
        xa, za, xb, zb = x[n], z[n], x[n + 1], z[n + 1]
        if za == zb:
            continue
        sign = 1.0
        if za < zb:
            xa, za, xb, zb, sign = xb, zb, xa, za, -1.0
        slope = (xb - xa) / (zb - za)
        for r in range(rows):
            high, low = min(za, edge_z[top + r]), max(zb, edge_z[top + r + 1])
            if high <= low:
                continue
            x0, x1 = xa + (high - za) * slope, xa + (low - za) * slope
            if x0 > x1:
                x0, x1 = x1, x0
            height, first, last = high - low, math.floor(x0), math.floor(x1)
            for column in range(first, last + 1):
                a, b = max(x0, column), min(x1, column + 1.0)
                share = 1.0 if first == last else (b - a) / (x1 - x0)
                middle = 0.5 * (a + b) - column
                c = column - left
                area[r, c] += sign * height * share * (1.0 - middle)
                area[r, c + 1] += sign * height * share * middle
    for r in range(rows):
        for c in range(1, area.shape[1]):
            area[r, c] += area[r, c - 1]


def coverage(emitter: Emitter, height: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows (r,), columns (c,) and the share (r, c) of each texel that an emitter covers.

    A column may stand twice where a loop goes round a pole; the shares then add up.
    """
    width = 2 * height
    phi, z = _unrolled(emitter.loop)
    x = phi * (width / (2.0 * math.pi))
    edge_z = np.cos(np.arange(height + 1) * (math.pi / height))
    theta = np.arccos(np.clip([z.max(), z.min()], -1.0, 1.0)) * (height / math.pi)
    top, bottom = max(int(theta[0]) - 1, 0), min(int(theta[1]) + 2, height)
    left, right = math.floor(x.min()), math.floor(x.max()) + 1
    area = np.zeros((bottom - top, right - left + 2))
    _accumulate(x, z, top, left, edge_z, area)
    area = np.abs(area[:, : right - left])
    total = area.sum() * (2.0 * math.pi / width)
    area *= emitter.solid_angle / total
    share = area / (edge_z[top:bottom] - edge_z[top + 1 : bottom + 1])[:, None]
    return np.arange(top, bottom), np.arange(left, right) % width, share


def add_emitters(radiance: Array, emitters: list[Emitter]) -> None:
    """Add the emitters to a map (H, 2H, 3) in place."""
    for emitter in emitters:
        row, column, share = coverage(emitter, len(radiance))
        np.add.at(radiance, (row[:, None], column[None, :]), share[:, :, None] * emitter.radiance)
