"""Primary rays: what each sub-pixel of a picture sees, and the shading points there."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.embree import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    HIT_TRIANGLE,
    HIT_U,
    HIT_V,
    LANES,
    ORG_X,
    ORG_Y,
    ORG_Z,
    intersect,
    new_hit_packet,
    new_valid,
    query_arguments,
)
from renderer.geometry import Geometry
from renderer.scene import Camera
from samplers.errors import EnvlightError
from samplers.threads import for_blocks

RAY_BLOCK = 8192
"""Primary rays handed to a thread at once."""
OFFSET = 2.0**-20
"""Distance of a shading point from its surface in units of its largest coordinate: float32 moves a
position by 2⁻²⁴ of it, sixteen times less."""
OFFSET_EXTENT = 2.0**-16
"""And in units of its triangle's extent: what Embree's float32 intersections of that triangle can
be off, with a margin for triangles of bad shape."""
LEAST_COSINE = 1e-4
"""Smallest cosine between the shading normal and the direction to the eye."""


@dataclass(frozen=True, eq=False)
class ShadingPoints:
    """What the sub-pixels see, in the order of their pixels; fields as in `view.View`.

    count : (p,) int64, sub-pixels of each pixel that see a surface
    """

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    geometric: NDArray[np.float32]
    toward_eye: NDArray[np.float32]
    depth: NDArray[np.float32]
    material: NDArray[np.int32]
    pixel: NDArray[np.int32]
    subpixel: NDArray[np.int32]
    background_pixel: NDArray[np.int32]
    background_direction: NDArray[np.float32]
    count: NDArray[np.int64]


def camera_axes(camera: Camera) -> tuple[NDArray, NDArray, NDArray]:
    """Unit right, up and forward vectors; right is forward × up."""
    forward = np.subtract(camera.target, camera.eye).astype(np.float64)
    length = np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    if length == 0.0 or np.linalg.norm(right) <= 1e-12 * length:
        raise EnvlightError("camera: eye and target coincide, or up is along the view; move one")
    forward, right = forward / length, right / np.linalg.norm(right)
    return right, np.cross(right, forward), forward


@njit(nogil=True, cache=True, error_model="numpy")
def _directions(lens, across, upward, out):
    """Unit directions, rows of out (3, 16), through points of the picture's plane.

    lens : right · half width, up · half height and forward, (9,)
    across, upward : (16,) in [−1, 1]
    """
    for k in range(LANES):
        dx = lens[6] + across[k] * lens[0] + upward[k] * lens[3]
        dy = lens[7] + across[k] * lens[1] + upward[k] * lens[4]
        dz = lens[8] + across[k] * lens[2] + upward[k] * lens[5]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        out[0, k], out[1, k], out[2, k] = dx / length, dy / length, dz / length


@njit(nogil=True, cache=True, error_model="numpy")
def _trace(
    scene, eye, lens, grid, size, pixel, start, stop, triangle, barycentric, direction, count
):  # fmt: skip
    """Closest hits of all sub-pixels of the pixels start … stop, and how many each pixel has.

    grid : (subpixels, 2), the sub-pixels' centres in the unit square
    """
    packet, valid, arguments = new_hit_packet(), new_valid(), query_arguments(True)
    hit = packet.view(np.int32)
    subpixels = len(grid)
    width, height = np.float64(size[0]), np.float64(size[1])
    across, upward = np.zeros(LANES), np.zeros(LANES)
    for k in range(LANES):
        packet[ORG_X, k], packet[ORG_Y, k], packet[ORG_Z, k] = eye
    p, subpixel, end = start, 0, stop * subpixels
    y, x = divmod(pixel[p], size[0])
    for first in range(start * subpixels, end, LANES):
        used = min(LANES, end - first)
        for k in range(used):
            across[k] = (x + grid[subpixel, 0]) / width * 2.0 - 1.0
            upward[k] = 1.0 - (y + grid[subpixel, 1]) / height * 2.0
            subpixel += 1
            if subpixel == subpixels:
                p, subpixel = p + 1, 0
                if p < stop:
                    y, x = divmod(pixel[p], size[0])
        for k in range(LANES):
            valid[k] = -1 if k < used else 0
        _directions(lens, across, upward, packet[DIR_X : DIR_Z + 1])
        intersect(scene, valid, packet, arguments)
        for k in range(used):
            triangle[first + k] = hit[HIT_TRIANGLE, k]
            barycentric[first + k, 0] = packet[HIT_U, k]
            barycentric[first + k, 1] = packet[HIT_V, k]
            direction[first + k, 0] = packet[DIR_X, k]
            direction[first + k, 1] = packet[DIR_Y, k]
            direction[first + k, 2] = packet[DIR_Z, k]
    for p in range(start, stop):
        count[p] = 0
        for row in range(p * subpixels, (p + 1) * subpixels):
            count[p] += 1 if triangle[row] >= 0 else 0


@njit(nogil=True, cache=True, error_model="numpy")
def _unit(x, y, z):
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@njit(nogil=True, cache=True)
def _corner(table, i):
    return np.float64(table[i, 0]), np.float64(table[i, 1]), np.float64(table[i, 2])


@njit(nogil=True, cache=True)
def _reach(px, py, pz):
    return max(abs(px), abs(py), abs(pz))


@njit(nogil=True, cache=True, error_model="numpy")
def _surface(eye, vertex, vertex_normal, corners, u, v, i, out):
    """Position, shading and geometric normal, direction to the eye and depth of a hit."""
    position, normal, geometric, toward_eye, depth = out
    a, b, c = corners[0], corners[1], corners[2]
    ax, ay, az = _corner(vertex, a)
    bx, by, bz = _corner(vertex, b)
    cx, cy, cz = _corner(vertex, c)
    ex, ey, ez, fx, fy, fz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    px, py, pz = ax + u * ex + v * fx, ay + u * ey + v * fy, az + u * ez + v * fz
    gx, gy, gz = _unit(ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx)
    tx, ty, tz = eye[0] - px, eye[1] - py, eye[2] - pz
    depth[i] = math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = _unit(tx, ty, tz)
    if gx * tx + gy * ty + gz * tz < 0.0:
        gx, gy, gz = -gx, -gy, -gz
    w = 1.0 - u - v
    ax_, ay_, az_ = _corner(vertex_normal, a)
    bx_, by_, bz_ = _corner(vertex_normal, b)
    cx_, cy_, cz_ = _corner(vertex_normal, c)
    sx, sy, sz = (
        w * ax_ + u * bx_ + v * cx_, w * ay_ + u * by_ + v * cy_, w * az_ + u * bz_ + v * cz_,
    )  # fmt: skip
    if sx * sx + sy * sy + sz * sz < 1e-12:
        sx, sy, sz = gx, gy, gz
    else:
        sx, sy, sz = _unit(sx, sy, sz)
    if sx * gx + sy * gy + sz * gz < 0.0:
        sx, sy, sz = -sx, -sy, -sz
    facing = sx * tx + sy * ty + sz * tz
    if facing < LEAST_COSINE:
        lift = LEAST_COSINE - facing
        sx, sy, sz = _unit(sx + lift * tx, sy + lift * ty, sz + lift * tz)
    extent = max(
        _reach(ax - px, ay - py, az - pz),
        _reach(bx - px, by - py, bz - pz),
        _reach(cx - px, cy - py, cz - pz),
    )
    step = OFFSET * _reach(px, py, pz) + OFFSET_EXTENT * extent
    position[i, 0], position[i, 1], position[i, 2] = px + step * gx, py + step * gy, pz + step * gz
    normal[i, 0], normal[i, 1], normal[i, 2] = sx, sy, sz
    geometric[i, 0], geometric[i, 1], geometric[i, 2] = gx, gy, gz
    toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2] = tx, ty, tz


@njit(nogil=True, cache=True)
def _fill(
    eye, vertex, vertex_normal, corners, owner, pixel, subpixels, start, stop,
    triangle, barycentric, direction, first, surface, material, seen_pixel, seen_subpixel,
    background_pixel, background_direction,
):  # fmt: skip
    """Shading points and background of the pixels start … stop, at their places."""
    for p in range(start, stop):
        i, j = first[p], p * subpixels - first[p]
        for s in range(subpixels):
            row = p * subpixels + s
            hit = triangle[row]
            if hit < 0:
                background_pixel[j] = pixel[p]
                for axis in range(3):
                    background_direction[j, axis] = direction[row, axis]
                j += 1
                continue
            u, v = np.float64(barycentric[row, 0]), np.float64(barycentric[row, 1])
            _surface(eye, vertex, vertex_normal, corners[hit], u, v, i, surface)
            material[i], seen_pixel[i], seen_subpixel[i] = owner[hit], pixel[p], s
            i += 1


def find_points(
    geometry: Geometry,
    camera: Camera,
    size: tuple[int, int],
    aspect: float,
    subpixels: int,
    pixel: NDArray[np.int64],
) -> ShadingPoints:
    """Trace a regular grid of sub-pixels through each of the pixels, in the order given.

    size : width and height of the picture in pixels; aspect : its width over its height
    subpixels : a square number; pixel : (p,), row-major indices
    """
    side, total = math.isqrt(subpixels), len(pixel) * subpixels
    right, up, forward = camera_axes(camera)
    half = math.tan(math.radians(camera.field_of_view) / 2.0)
    lens = np.concatenate([right * (half * aspect), up * half, forward])
    row, column = np.divmod(np.arange(subpixels), side)
    grid = (np.stack([column, row], axis=1) + 0.5) / side
    eye = tuple(float(x) for x in camera.eye)
    hit, barycentric = np.empty(total, np.int32), np.empty((total, 2), np.float32)
    direction = np.empty((total, 3), np.float32)
    count = np.empty(len(pixel), np.int64)
    step = max(1, RAY_BLOCK // subpixels)

    def trace(a: int, b: int) -> None:
        _trace(
            geometry.embree.handle, eye, lens, grid, size, pixel, a, b, hit, barycentric, direction,
            count,
        )  # fmt: skip

    for_blocks(trace, len(pixel), step)
    first = np.concatenate([[0], np.cumsum(count)])
    found = int(first[-1])
    position, normal, geometric, toward_eye = (np.empty((found, 3), np.float32) for _ in range(4))
    surface = (position, normal, geometric, toward_eye, np.empty(found, np.float32))
    material, seen_pixel, seen_subpixel = (np.empty(found, np.int32) for _ in range(3))
    background = np.empty(total - found, np.int32), np.empty((total - found, 3), np.float32)

    def fill(a: int, b: int) -> None:
        _fill(
            eye, geometry.vertex, geometry.normal, geometry.triangle, geometry.owner,
            pixel, subpixels, a, b, hit, barycentric, direction, first, surface,
            material, seen_pixel, seen_subpixel, *background,
        )  # fmt: skip

    for_blocks(fill, len(pixel), step)
    return ShadingPoints(*surface, material, seen_pixel, seen_subpixel, *background, count)
