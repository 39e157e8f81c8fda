"""Shading points of sixteen hits at a time: where they lie, their normals, the way to the eye."""

import math

import numpy as np

from renderer.packet.embree import LANES
from samplers.compiled import inner

OFFSET = 2.0**-20
"""Distance of a shading point from its surface in units of its largest coordinate: float32 moves a
position by 2⁻²⁴ of it, sixteen times less."""
OFFSET_EXTENT = 2.0**-16
"""And in units of its triangle's extent: what Embree's float32 intersections of that triangle can
be off, with a margin for triangles of bad shape."""
LEAST_COSINE = 1e-4
"""Smallest cosine between the shading normal and the direction to the eye."""
CORNER, CORNER_NORMAL, WEIGHT = 0, 9, 18
GIVEN_ROWS = 20
POSITION, NORMAL, GEOMETRIC, TOWARD_EYE, DEPTH = 0, 3, 6, 9, 12
FOUND_ROWS = 13
"""Rows of sixteen hits: corners, their normals, u and v; and what `find_surfaces` finds."""


@inner
def _unit(x, y, z):
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@inner
def _reach(x, y, z):
    return max(abs(x), abs(y), abs(z))


@inner
def _row(table, row, k):
    """Three numbers of lane k, from three rows on, as float64."""
    i = row * LANES + k
    return (
        np.float64(table[i]), np.float64(table[i + LANES]), np.float64(table[i + 2 * LANES]),
    )  # fmt: skip


@inner
def _put_row(table, row, k, x, y, z):
    i = row * LANES + k
    table[i], table[i + LANES], table[i + 2 * LANES] = x, y, z


@inner
def find_surfaces(eye_x, eye_y, eye_z, given, found):
    """Position, shading and geometric normal, direction to the eye and depth of sixteen hits.

    given : (GIVEN_ROWS · 16,), found : (FOUND_ROWS · 16,), float32; computed in float64
    """
    for k in range(LANES):
        ax, ay, az = _row(given, CORNER, k)
        bx, by, bz = _row(given, CORNER + 3, k)
        cx, cy, cz = _row(given, CORNER + 6, k)
        u = np.float64(given[WEIGHT * LANES + k])
        v = np.float64(given[(WEIGHT + 1) * LANES + k])
        ex, ey, ez, fx, fy, fz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        px, py, pz = ax + u * ex + v * fx, ay + u * ey + v * fy, az + u * ez + v * fz
        gx, gy, gz = _unit(ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx)
        tx, ty, tz = eye_x - px, eye_y - py, eye_z - pz
        depth = math.sqrt(tx * tx + ty * ty + tz * tz)
        scale = 1.0 / depth
        tx, ty, tz = tx * scale, ty * scale, tz * scale
        side = -1.0 if gx * tx + gy * ty + gz * tz < 0.0 else 1.0
        gx, gy, gz = side * gx, side * gy, side * gz
        extent = max(
            _reach(ax - px, ay - py, az - pz),
            _reach(bx - px, by - py, bz - pz),
            _reach(cx - px, cy - py, cz - pz),
        )
        w = 1.0 - u - v
        ax, ay, az = _row(given, CORNER_NORMAL, k)
        bx, by, bz = _row(given, CORNER_NORMAL + 3, k)
        cx, cy, cz = _row(given, CORNER_NORMAL + 6, k)
        sx, sy, sz = w * ax + u * bx + v * cx, w * ay + u * by + v * cy, w * az + u * bz + v * cz
        square = sx * sx + sy * sy + sz * sz
        none = square < 1e-12
        sx, sy, sz = gx if none else sx, gy if none else sy, gz if none else sz
        scale = 1.0 / math.sqrt(1.0 if none else square)
        scale = -scale if sx * gx + sy * gy + sz * gz < 0.0 else scale
        sx, sy, sz = sx * scale, sy * scale, sz * scale
        lift = max(LEAST_COSINE - (sx * tx + sy * ty + sz * tz), 0.0)
        sx, sy, sz = _unit(sx + lift * tx, sy + lift * ty, sz + lift * tz)
        step = OFFSET * _reach(px, py, pz) + OFFSET_EXTENT * extent
        _put_row(found, POSITION, k, px + step * gx, py + step * gy, pz + step * gz)
        _put_row(found, NORMAL, k, sx, sy, sz)
        _put_row(found, GEOMETRIC, k, gx, gy, gz)
        _put_row(found, TOWARD_EYE, k, tx, ty, tz)
        found[DEPTH * LANES + k] = depth


@inner
def load_corners(vertex, vertex_normal, corners, hit, u, v, k, given):
    for c in range(3):
        corner = np.uint32(corners[hit, c])
        for axis in range(3):
            given[(CORNER + 3 * c + axis) * LANES + k] = vertex[corner, axis]
            given[(CORNER_NORMAL + 3 * c + axis) * LANES + k] = vertex_normal[corner, axis]
    given[WEIGHT * LANES + k], given[(WEIGHT + 1) * LANES + k] = u, v


@inner
def store_surfaces(found, first, count, surface):
    """The first `count` lanes to the points first … first + count − 1."""
    position, normal, geometric, toward_eye, depth = surface
    for k in range(count):
        i = first + k
        for axis in range(3):
            position[i, axis] = found[(POSITION + axis) * LANES + k]
            normal[i, axis] = found[(NORMAL + axis) * LANES + k]
            geometric[i, axis] = found[(GEOMETRIC + axis) * LANES + k]
            toward_eye[i, axis] = found[(TOWARD_EYE + axis) * LANES + k]
        depth[i] = found[DEPTH * LANES + k]
