"""Light that has bounced: irradiance tables on the faces of a place's solids.

Every face carries a grid of irradiance. Lamps, windows and the sun reach it directly, past the
other solids; then a fixed set of cosine-distributed rays per grid point gathers what the surfaces
around reflect and what shows of the sky, twice. What the eye sees directly of the sun is left out
of the tables, since its shadows are sharp and are traced per sample.

Cost: points × (light samples + 2 × rays) × solids, whatever the resolution of the map.
Source: Ward, Rubinstein & Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH
1988 (gathering from hemispheres at sparse points), with a regular grid for its points.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from experiments.embedded.solids import CYLINDER, FAR, MISS, nearest, occluded, panel_at
from samplers.sphere import pixel_of
from samplers.threads import for_blocks

Array = NDArray[np.float64]

RAYS = 80
BOUNCES = 2
POINTS_PER_BLOCK = 256


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
    return Grid(offset, size, np.concatenate(points), np.concatenate(normals),
                np.concatenate(solids))  # fmt: skip


def _face_grid(
    box: Array, face: int, round_: bool, spacing: float, most: int
) -> tuple[Array, Array, tuple[int, int]]:
    low, high = box[:3], box[3:]
    axis = face // 2
    a, b = (axis + 1) % 3, (axis + 2) % 3
    mantle = round_ and face == 0
    sides = (high[1] - low[1], math.pi * (high[0] - low[0])) if mantle else (high - low)[[a, b]]
    n, m = (int(np.clip(math.ceil(side / spacing), 2, most)) for side in sides)
    p, q = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(m) + 0.5) / m, indexing="ij")
    p, q = p.ravel(), q.ravel()
    point, normal = np.empty((n * m, 3)), np.zeros((n * m, 3))
    if mantle:
        turn = q * 2.0 * math.pi
        normal[:, 0], normal[:, 2] = np.cos(turn), np.sin(turn)
        point[:] = 0.5 * (low + high) + 0.5 * (high[0] - low[0]) * normal
        point[:, 1] = low[1] + p * sides[0]
    else:
        point[:, axis] = (high if face % 2 else low)[axis]
        point[:, a], point[:, b] = low[a] + p * sides[0], low[b] + q * sides[1]
        normal[:, axis] = 1.0 if face % 2 else -1.0
    return point, normal, (n, m)


@njit(nogil=True, cache=True)
def lookup(values, offset, size, bounds, kind, solid, face, p, out):
    """Bilinear irradiance (3,) at a point on a face, written to `out`."""
    box = bounds[solid]
    n, m = size[solid, face, 0], size[solid, face, 1]
    mantle = kind[solid] == CYLINDER and face == 0
    if mantle:
        x = (p[1] - box[1]) / (box[4] - box[1])
        turn = math.atan2(p[2] - 0.5 * (box[2] + box[5]), p[0] - 0.5 * (box[0] + box[3]))
        y = turn / (2.0 * math.pi)
        y -= math.floor(y)
    else:
        a, b = (face // 2 + 1) % 3, (face // 2 + 2) % 3
        x = (p[a] - box[a]) / (box[a + 3] - box[a])
        y = (p[b] - box[b]) / (box[b + 3] - box[b])
    x, y = x * n - 0.5, y * m - 0.5
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


@njit(nogil=True, cache=True)
def look_up_all(values, offset, size, bounds, kind, hit, point, out):
    """Irradiance (n, 3) at points on faces; rays that hit nothing are left alone."""
    for n in range(len(point)):
        if hit[n, 0] != MISS:
            lookup(values, offset, size, bounds, kind, hit[n, 0], hit[n, 1], point[n], out[n])


@njit(nogil=True, cache=True)
def _direct(point, normal, lights, table, bounds, kind, room, start, stop, out):
    """Irradiance of light samples, rows of twelve numbers.

    They are position, normal (0: it shines all round), weight, window flag, a floor for squared
    distances, and the exponent of the cosine at the lamp. The weight is radiance × area, or
    intensity for a light that shines all round; a window's is multiplied by the sky's radiance from
    where it is looked through.
    """
    d = np.empty(3)
    for n in range(start, stop):
        for c in range(3):
            out[n, c] = 0.0
        for j in range(len(lights)):
            for k in range(3):
                d[k] = lights[j, k] - point[n, k]
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            distance = math.sqrt(square)
            for k in range(3):
                d[k] /= distance
            cosine = normal[n, 0] * d[0] + normal[n, 1] * d[1] + normal[n, 2] * d[2]
            if cosine <= 0.0:
                continue
            aim = -(lights[j, 3] * d[0] + lights[j, 4] * d[1] + lights[j, 5] * d[2])
            if lights[j, 3] == 0.0 and lights[j, 4] == 0.0 and lights[j, 5] == 0.0:
                aim = 1.0
            if aim <= 0.0 or occluded(point[n], d, bounds, kind, room, distance - 0.02):
                continue
            factor = cosine * aim ** lights[j, 11] / (square + lights[j, 10])
            if lights[j, 9] > 0.0:
                row, column = pixel_of(d[0], d[1], d[2], table.shape[0])
                for c in range(3):
                    out[n, c] += factor * lights[j, 6 + c] * table[row, column, c]
            else:
                for c in range(3):
                    out[n, c] += factor * lights[j, 6 + c]


@njit(nogil=True, cache=True)
def _gather(point, normal, rays, values, albedo, offset, size, table, bounds, kind, room,
            panel_place, panel_bounds, start, stop, out):  # fmt: skip
    """Irradiance from surfaces that reflect `values`, and from the sky where a ray escapes."""
    d, p, e, u, v = np.empty(3), np.empty(3), np.empty(3), np.zeros(3), np.empty(3)
    for n in range(start, stop):
        w = normal[n]
        u[:] = 0.0
        u[1 if abs(w[1]) < 0.9 else 0] = 1.0
        dot = u[0] * w[0] + u[1] * w[1] + u[2] * w[2]
        u -= dot * w
        u /= math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        v[0], v[1], v[2] = (
            w[1] * u[2] - w[2] * u[1],
            w[2] * u[0] - w[0] * u[2],
            w[0] * u[1] - w[1] * u[0],
        )
        for c in range(3):
            out[n, c] = 0.0
        for r in range(len(rays)):
            for k in range(3):
                d[k] = rays[r, 0] * u[k] + rays[r, 1] * v[k] + rays[r, 2] * w[k]
            t, solid, face = nearest(point[n], d, bounds, kind, room, FAR)
            if solid == MISS:
                row, column = pixel_of(d[0], d[1], d[2], table.shape[0])
                for c in range(3):
                    out[n, c] += table[row, column, c] * math.pi / len(rays)
                continue
            for k in range(3):
                p[k] = point[n, k] + t * d[k]
            if panel_at(solid, face, p, panel_place, panel_bounds) != MISS:
                continue
            lookup(values, offset, size, bounds, kind, solid, face, p, e)
            for c in range(3):
                out[n, c] += e[c] * albedo[solid, c] / len(rays)


def cosine_rays(count: int) -> Array:
    """A spiral of directions (count, 3) about +z with density cos θ/π."""
    k = np.arange(count) + 0.5
    radius, turn = np.sqrt(k / count), k * (math.pi * (3.0 - math.sqrt(5.0)))
    return np.stack(
        [radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1.0 - k / count)], axis=1
    )


def irradiance(
    grid: Grid,
    solids: tuple[Array, NDArray[np.int64], bool],
    panels: tuple[NDArray[np.int64], Array],
    albedo: Array,
    lights: Array,
    sunlight: Array,
    table: Array,
) -> Array:
    """Irradiance (points, 3) at the grid's points, without what the sun sends directly.

    solids : bounds, kind and whether the first is a room; panels : place and bounds
    albedo : (solids, 3); lights : (m, 12) light samples; sunlight : (points, 3) direct irradiance
    table : (h, 2h, 3) the sky, for rays that escape and for windows
    """
    count = len(grid.point)
    direct, bounced = np.empty((count, 3)), np.empty((count, 3))
    rays = cosine_rays(RAYS)

    def light(start: int, stop: int) -> None:
        _direct(grid.point, grid.normal, lights, table, *solids, start, stop, direct)

    for_blocks(light, count, POINTS_PER_BLOCK)
    total = direct + sunlight
    for _ in range(BOUNCES):

        def gather(start: int, stop: int, values: Array = total) -> None:
            _gather(grid.point, grid.normal, rays, values, albedo, grid.offset, grid.size, table,
                    *solids, *panels, start, stop, bounced)  # fmt: skip

        for_blocks(gather, count, POINTS_PER_BLOCK)
        total = direct + sunlight + bounced
    return direct + bounced
