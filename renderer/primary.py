"""Primary rays: what each sub-pixel of a picture sees, and the shading points there."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.geometry import Geometry
from renderer.packet.embree import (
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
from renderer.packet.surfaces import (
    FOUND_ROWS,
    GIVEN_ROWS,
    find_surfaces,
    load_corners,
    store_surfaces,
)
from renderer.scene import Camera
from samplers.compiled import kernel
from samplers.errors import EnvlightError
from samplers.threads import for_blocks, groups_of

RAY_BLOCK = 8192
"""Primary rays handed to a thread at once, at least."""
_BITS = 21
LARGEST = 1 << 20
"""Columns, rows and sub-pixels that `packed_ray` has room for."""


@dataclass(frozen=True, eq=False)
class ShadingPoints:
    """What the sub-pixels see, in the order of their rays; fields as in `view.View`.

    count : (g,) int64, rays of each group that see a surface
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


@kernel
def packed_ray(x, y, subpixel):
    """A ray as one number, which is taken apart without a division."""
    return (y << (2 * _BITS)) | (x << _BITS) | subpixel


@kernel
def _unpacked(ray):
    """Column and row of a ray's pixel, and its sub-pixel."""
    mask = (1 << _BITS) - 1
    return (ray >> _BITS) & mask, ray >> (2 * _BITS), ray & mask


@kernel
def _direction(lens, across, upward):
    """Unit direction through a point of the picture's plane, in [−1, 1]².

    lens : right · half width, up · half height and forward, nine numbers
    """
    dx = lens[6] + across * lens[0] + upward * lens[3]
    dy = lens[7] + across * lens[1] + upward * lens[4]
    dz = lens[8] + across * lens[2] + upward * lens[5]
    scale = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx * scale, dy * scale, dz * scale


@kernel
def _plane(grid, size, x, y, subpixel):
    """Where in the picture's plane the centre of a sub-pixel of the pixel (x, y) lies."""
    across = (x + grid[subpixel, 0]) * (2.0 / size[0]) - 1.0
    return across, 1.0 - (y + grid[subpixel, 1]) * (2.0 / size[1])


@kernel
def _directions(lens, place, packet):
    """Directions of sixteen rays into the flat packet; place (32,), across and upward."""
    for k in range(LANES):
        dx, dy, dz = _direction(lens, place[k], place[LANES + k])
        packet[DIR_X * LANES + k] = dx
        packet[DIR_Y * LANES + k] = dy
        packet[DIR_Z * LANES + k] = dz


class Rays(NamedTuple):
    """Primary rays as kernels take them.

    lens : see `_direction`; grid : (subpixels, 2), the sub-pixels' centres in the unit square
    size : columns and rows of the picture; ray, group : see `find_points`
    """

    eye: tuple[float, ...]
    lens: tuple[float, ...]
    grid: NDArray[np.float64]
    size: tuple[int, int]
    ray: NDArray[np.int64]
    group: NDArray[np.int64]


class Hits(NamedTuple):
    """What rays meet first. triangle : (n,), −1 for none; barycentric : (n, 2)"""

    triangle: NDArray[np.int32]
    barycentric: NDArray[np.float32]


class Meshes(NamedTuple):
    """All triangles of a scene: `renderer.geometry.Geometry`."""

    vertex: NDArray[np.float32]
    normal: NDArray[np.float32]
    corners: NDArray[np.int32]
    owner: NDArray[np.int32]


@kernel
def _trace(scene, usual, rays, visit, together, start, stop, hits, count):
    """Closest hits of the rays of the groups start … stop, and how many each group has."""
    eye, lens, grid, size, ray, group = rays
    triangle, barycentric = hits
    packet, valid, arguments = new_hit_packet(), new_valid(), query_arguments(True)
    flat, hit = packet.reshape(-1), packet.view(np.int32)
    place, row = np.zeros(2 * LANES), np.zeros(LANES, np.int64)
    for k in range(LANES):
        packet[ORG_X, k], packet[ORG_Y, k], packet[ORG_Z, k] = eye
    for g in range(start, stop, together):
        begin, end = group[g], group[min(g + together, stop)]
        for first in range(begin, end, LANES):
            used = min(LANES, end - first)
            for k in range(used):
                row[k] = begin + visit[first + k]
                x, y, subpixel = _unpacked(ray[row[k]])
                place[k], place[LANES + k] = _plane(grid, size, x, y, subpixel)
            for k in range(LANES):
                valid[k] = -1 if k < used else 0
            _directions(lens, place, flat)
            intersect(scene, usual, valid, packet, arguments)
            for k in range(used):
                triangle[row[k]] = hit[HIT_TRIANGLE, k]
                barycentric[row[k], 0] = packet[HIT_U, k]
                barycentric[row[k], 1] = packet[HIT_V, k]
    for g in range(start, stop):
        count[g] = 0
        for i in range(group[g], group[g + 1]):
            count[g] += 1 if triangle[i] >= 0 else 0


@kernel
def _fill(rays, meshes, start, stop, hits, first, surface, seen, background):
    """Shading points and background of the groups start … stop, at their places.

    surface, seen, background : arrays of `ShadingPoints`, in their order there
    """
    eye, lens, grid, size, ray, group = rays
    triangle, barycentric = hits
    material, seen_pixel, seen_subpixel = seen
    background_pixel, background_direction = background
    given = np.zeros(GIVEN_ROWS * LANES, np.float32)
    found = np.empty(FOUND_ROWS * LANES, np.float32)
    i, waiting = first[start], 0
    j = group[start] - i
    for row in range(group[start], group[stop]):
        hit = triangle[row]
        x, y, subpixel = _unpacked(ray[row])
        pixel = y * size[0] + x
        if hit < 0:
            background_pixel[j] = pixel
            dx, dy, dz = _direction(lens, *_plane(grid, size, x, y, subpixel))
            background_direction[j, 0] = dx
            background_direction[j, 1] = dy
            background_direction[j, 2] = dz
            j += 1
            continue
        u, v = barycentric[row, 0], barycentric[row, 1]
        load_corners(meshes.vertex, meshes.normal, meshes.corners, hit, u, v, waiting, given)
        material[i], seen_pixel[i], seen_subpixel[i] = meshes.owner[hit], pixel, subpixel
        i, waiting = i + 1, waiting + 1
        if waiting == LANES:
            find_surfaces(eye[0], eye[1], eye[2], given, found)
            store_surfaces(found, i - LANES, LANES, surface)
            waiting = 0
    if waiting > 0:
        find_surfaces(eye[0], eye[1], eye[2], given, found)
        store_surfaces(found, i - waiting, waiting, surface)


def find_points(
    geometry: Geometry,
    camera: Camera,
    size: tuple[int, int],
    aspect: float,
    subpixels: int,
    ray: NDArray[np.int64],
    visit: NDArray[np.int32],
    group: NDArray[np.int64],
    together: int,
) -> ShadingPoints:
    """Trace a ray through each of the sub-pixels; the points come in the order of the rays.

    Where a ray meets the edge of two triangles, `visit` may decide which of them it names.

    size : width and height of the picture in pixels; aspect : its width over its height
    subpixels : a square number, the points of a regular grid in each pixel
    ray : (n,), as `packed_ray` makes them
    visit : (n,), the order in which rays are best traced as packets: of each `together` groups,
        the places of their rays after the first one
    group : (g + 1,), bounds of the runs of rays that are counted together
    """
    side, total, groups = math.isqrt(subpixels), len(ray), len(group) - 1
    right, up, forward = camera_axes(camera)
    half = math.tan(math.radians(camera.field_of_view) / 2.0)
    axes = np.concatenate([right * (half * aspect), up * half, forward])
    lens = tuple(float(x) for x in axes)
    row, column = np.divmod(np.arange(subpixels), side)
    grid = (np.stack([column, row], axis=1) + 0.5) / side
    rays = Rays(tuple(float(x) for x in camera.eye), lens, grid, size, ray, group)
    hits = Hits(np.empty(total, np.int32), np.empty((total, 2), np.float32))
    count = np.empty(groups, np.int64)
    step = -(-groups_of(groups, total, RAY_BLOCK) // together) * together

    def trace(a: int, b: int) -> None:
        embree = geometry.embree
        _trace(embree.handle, embree.usual, rays, visit, together, a, b, hits, count)

    for_blocks(trace, groups, step)
    first = np.concatenate([[0], np.cumsum(count)])
    found = int(first[-1])
    position, normal, geometric, toward_eye = (np.empty((found, 3), np.float32) for _ in range(4))
    surface = (position, normal, geometric, toward_eye, np.empty(found, np.float32))
    seen = np.empty(found, np.int32), np.empty(found, np.int32), np.empty(found, np.int32)
    meshes = Meshes(geometry.vertex, geometry.normal, geometry.triangle, geometry.owner)
    background = np.empty(total - found, np.int32), np.empty((total - found, 3), np.float32)

    def fill(a: int, b: int) -> None:
        _fill(rays, meshes, a, b, hits, first, surface, seen, background)

    for_blocks(fill, groups, step)
    return ShadingPoints(*surface, *seen, *background, count)
