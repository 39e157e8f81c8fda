"""A view: a scene seen by its camera at a resolution, with its shading points found once.

Every sampler and environment shades the same points, so they are computed once per (scene,
resolution, sub-pixels). Points are ordered by square tiles of pixels, and within a tile by the
cell of a 4 × 2 pattern, so that the points that share a set of interleaved lights lie together:
packets of rays towards one light then start close to each other.
"""

import math
import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.brdf import pack
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
    EmbreeScene,
    intersect,
    new_hit_packet,
    new_valid,
    query_arguments,
)
from renderer.materials import Lambert
from renderer.scene import Camera, Scene
from samplers.errors import EnvlightError
from samplers.threads import for_blocks

TILE = 16
"""Pixels along the side of a tile."""
CELLS_X, CELLS_Y = 4, 2
CELLS = CELLS_X * CELLS_Y
"""Cells of the interleaving pattern: neighbouring pixels that may use different sets of lights."""
RAY_BLOCK = 8192
OFFSET = 2.0**-20
"""Distance of a shading point from its surface in units of its largest coordinate: float32 moves a
position by 2⁻²⁴ of it, sixteen times less."""
OFFSET_EXTENT = 2.0**-16
"""And in units of its triangle's extent: what Embree's float32 intersections of that triangle can
be off, with a margin for triangles of bad shape."""
LEAST_COSINE = 1e-4
"""Smallest cosine between the shading normal and the direction to the eye."""


@dataclass(frozen=True, eq=False)
class View:
    """Shading points and background of a picture.

    position : (n, 3) float32, just above the surface on the eye's side
    normal, geometric : (n, 3) float32, unit shading and geometric normals on the eye's side
    toward_eye : (n, 3) float32, unit
    depth : (n,) float32, distance to the eye
    material : (n,) int32, row of `materials`
    pixel : (n,) int32, row-major index of the point's pixel
    subpixel : (n,) int32, 0 … subpixels − 1
    group : (g + 1,) int64, bounds of the runs of points of one tile and pattern cell
    group_cell : (g,) int64, the runs' cells
    tile : (t + 1,) int64, bounds of the runs of points of one tile
    background_pixel : (b,) int32, background_direction : (b, 3) float32, sub-pixels that see no
        surface
    materials : (m, 11) float64, see `brdf.pack`
    """

    scene: Scene
    width: int
    height: int
    subpixels: int
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    geometric: NDArray[np.float32]
    toward_eye: NDArray[np.float32]
    depth: NDArray[np.float32]
    material: NDArray[np.int32]
    pixel: NDArray[np.int32]
    subpixel: NDArray[np.int32]
    group: NDArray[np.int64]
    group_cell: NDArray[np.int64]
    tile: NDArray[np.int64]
    background_pixel: NDArray[np.int32]
    background_direction: NDArray[np.float32]
    materials: NDArray[np.float64]
    embree: EmbreeScene = field(repr=False)
    _reduced: dict[int, "View"] = field(default_factory=dict, init=False, repr=False)
    _lock: Any = field(default_factory=threading.Lock, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.position)

    def reduced(self, factor: int) -> "View":
        """The same picture at 1/factor of the resolution, rounded up; found once."""
        with self._lock:
            if factor not in self._reduced:
                width, height = -(-self.width // factor), -(-self.height // factor)
                self._reduced[factor] = make_view(
                    self.scene, width, height, self.subpixels, self.width / self.height
                )
            return self._reduced[factor]

    @property
    def is_lambertian(self) -> bool:
        """Whether every visible surface is ideally diffuse."""
        visible = np.unique(self.material)
        return all(isinstance(self.scene.objects[i].material, Lambert) for i in visible)

    @property
    def coverage(self) -> NDArray[np.float64]:
        """Share of each pixel's sub-pixels that see a surface, (height, width)."""
        count = np.bincount(self.pixel, minlength=self.width * self.height)
        return (count / self.subpixels).reshape(self.height, self.width)

    def to_image(self, point_radiance: NDArray, background: NDArray | None) -> NDArray[np.float32]:
        """Average of the points' radiance (n, 3) and the background's (b, 3) over each pixel."""
        image = np.empty((self.height * self.width, 3))
        for channel in range(3):
            image[:, channel] = np.bincount(
                self.pixel, point_radiance[:, channel], minlength=len(image)
            )
            if background is not None:
                image[:, channel] += np.bincount(
                    self.background_pixel, background[:, channel], minlength=len(image)
                )
        return (image / self.subpixels).reshape(self.height, self.width, 3).astype(np.float32)


def _sample_order(width: int, height: int, subpixels: int) -> tuple[NDArray, NDArray, NDArray]:
    """Pixel, sub-pixel and (tile, cell) key of all samples, in the order of the view."""
    y, x = np.divmod(np.arange(width * height), width)
    tile = (y // TILE) * -(-width // TILE) + x // TILE
    cell = (y % CELLS_Y) * CELLS_X + x % CELLS_X
    key = tile * CELLS + cell
    pixel = np.argsort(key, kind="stable")
    return (
        np.repeat(pixel, subpixels),
        np.tile(np.arange(subpixels), len(pixel)),
        np.repeat(key[pixel], subpixels),
    )


def _run_bounds(key: NDArray[np.int64]) -> NDArray[np.int64]:
    """Bounds of the runs of equal keys, (runs + 1,)."""
    if len(key) == 0:
        return np.zeros(1, np.int64)
    return np.concatenate([[0], np.flatnonzero(np.diff(key)) + 1, [len(key)]])


def camera_axes(camera: Camera) -> tuple[NDArray, NDArray, NDArray]:
    """Unit right, up and forward vectors; right is forward × up."""
    forward = np.subtract(camera.target, camera.eye).astype(np.float64)
    length = np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    if length == 0.0 or np.linalg.norm(right) <= 1e-12 * length:
        raise EnvlightError("camera: eye and target coincide, or up is along the view; move one")
    forward, right = forward / length, right / np.linalg.norm(right)
    return right, np.cross(right, forward), forward


def _camera_rays(
    camera: Camera,
    width: int,
    height: int,
    aspect: float,
    subpixels: int,
    pixel: NDArray,
    subpixel: NDArray,
) -> NDArray[np.float32]:
    """Unit directions through the centres of a regular grid of sub-pixels."""
    side = math.isqrt(subpixels)
    sub_y, sub_x = np.divmod(subpixel, side)
    y, x = np.divmod(pixel, width)
    right, up, forward = camera_axes(camera)
    half = math.tan(math.radians(camera.field_of_view) / 2.0)
    across = ((x + (sub_x + 0.5) / side) / width * 2.0 - 1.0) * half * aspect
    upward = (1.0 - (y + (sub_y + 0.5) / side) / height * 2.0) * half
    ray = forward + across[:, None] * right + upward[:, None] * up
    return (ray / np.linalg.norm(ray, axis=1, keepdims=True)).astype(np.float32)


@njit(nogil=True, cache=True)
def _trace(scene, eye, ray, start, stop, triangle, barycentric):
    packet, valid, arguments = new_hit_packet(), new_valid(), query_arguments(True)
    for first in range(start, stop, LANES):
        count = min(LANES, stop - first)
        for k in range(LANES):
            valid[k] = -1 if k < count else 0
        for k in range(count):
            packet[ORG_X, k], packet[ORG_Y, k], packet[ORG_Z, k] = eye
            packet[DIR_X, k] = ray[first + k, 0]
            packet[DIR_Y, k] = ray[first + k, 1]
            packet[DIR_Z, k] = ray[first + k, 2]
        intersect(scene, valid, packet, arguments)
        hit = packet.view(np.int32)
        for k in range(count):
            triangle[first + k] = hit[HIT_TRIANGLE, k]
            barycentric[first + k, 0] = packet[HIT_U, k]
            barycentric[first + k, 1] = packet[HIT_V, k]


@njit(nogil=True, cache=True)
def _unit(x, y, z):
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@njit(nogil=True, cache=True)
def _surface(eye, vertex, vertex_normal, triangle, hit, barycentric, start, stop, out):
    """Position, shading normal, geometric normal, direction to the eye and depth of the hits."""
    position, normal, geometric, toward_eye, depth = out
    for i in range(start, stop):
        a, b, c = triangle[hit[i]]
        u, v = np.float64(barycentric[i, 0]), np.float64(barycentric[i, 1])
        w = 1.0 - u - v
        origin = vertex[a].astype(np.float64)
        e, f = vertex[b] - origin, vertex[c] - origin
        p = origin + u * e + v * f
        gx, gy, gz = _unit(
            e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]
        )
        tx, ty, tz = eye[0] - p[0], eye[1] - p[1], eye[2] - p[2]
        depth[i] = math.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = _unit(tx, ty, tz)
        if gx * tx + gy * ty + gz * tz < 0.0:
            gx, gy, gz = -gx, -gy, -gz
        s = w * vertex_normal[a] + u * vertex_normal[b] + v * vertex_normal[c]
        if s[0] * s[0] + s[1] * s[1] + s[2] * s[2] < 1e-12:
            sx, sy, sz = gx, gy, gz
        else:
            sx, sy, sz = _unit(s[0], s[1], s[2])
        if sx * gx + sy * gy + sz * gz < 0.0:
            sx, sy, sz = -sx, -sy, -sz
        facing = sx * tx + sy * ty + sz * tz
        if facing < LEAST_COSINE:
            lift = LEAST_COSINE - facing
            sx, sy, sz = _unit(sx + lift * tx, sy + lift * ty, sz + lift * tz)
        reach = extent = 0.0
        for k in range(3):
            reach = max(reach, abs(p[k]))
            for corner in (a, b, c):
                extent = max(extent, abs(vertex[corner, k] - p[k]))
        step = OFFSET * reach + OFFSET_EXTENT * extent
        position[i, 0] = p[0] + step * gx
        position[i, 1] = p[1] + step * gy
        position[i, 2] = p[2] + step * gz
        normal[i, 0], normal[i, 1], normal[i, 2] = sx, sy, sz
        geometric[i, 0], geometric[i, 1], geometric[i, 2] = gx, gy, gz
        toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2] = tx, ty, tz


@dataclass(frozen=True, eq=False)
class _Geometry:
    """All of a scene's triangles in one mesh."""

    vertex: NDArray[np.float32]
    normal: NDArray[np.float32]
    triangle: NDArray[np.int32]
    owner: NDArray[np.int32]

    @classmethod
    def of(cls, scene: Scene) -> "_Geometry":
        meshes = [item.mesh for item in scene.objects]
        first = np.cumsum([0] + [len(mesh.vertex) for mesh in meshes[:-1]])
        return cls(
            np.concatenate([mesh.vertex for mesh in meshes]),
            np.concatenate([mesh.normal for mesh in meshes]),
            np.concatenate([m.triangle + start for m, start in zip(meshes, first, strict=True)]),
            np.repeat(np.arange(len(meshes), dtype=np.int32), [len(m.triangle) for m in meshes]),
        )


def make_view(
    scene: Scene, width: int, height: int, subpixels: int = 4, aspect: float | None = None
) -> View:
    """Find what each of the `subpixels` (a square number) of each pixel sees.

    aspect : width over height of the picture, width / height by default: pixels are square

    Costs one ray per sub-pixel and, at most, about 70 bytes for each that sees a surface.
    """
    if width < 1 or height < 1:
        raise EnvlightError(f"view: {width}×{height} pixels; at least 1×1 is needed")
    if subpixels < 1 or math.isqrt(subpixels) ** 2 != subpixels:
        raise EnvlightError(f"view: {subpixels} sub-pixels; use a square number: 1, 4, 9, 16")
    geometry = _Geometry.of(scene)
    embree = EmbreeScene(geometry.vertex, geometry.triangle)
    pixel, subpixel, key = _sample_order(width, height, subpixels)
    ray = _camera_rays(
        scene.camera, width, height, aspect or width / height, subpixels, pixel, subpixel
    )
    hit, barycentric = np.empty(len(ray), np.int32), np.empty((len(ray), 2), np.float32)
    eye = tuple(float(x) for x in scene.camera.eye)
    for_blocks(
        lambda a, b: _trace(embree.handle, eye, ray, a, b, hit, barycentric), len(ray), RAY_BLOCK
    )
    seen = hit >= 0
    hit, barycentric, key = hit[seen], barycentric[seen], key[seen]
    position, normal, geometric, toward_eye = (
        np.empty((len(hit), 3), np.float32) for _ in range(4)
    )
    depth = np.empty(len(hit), np.float32)
    surface = (position, normal, geometric, toward_eye, depth)

    def points(start: int, stop: int) -> None:
        _surface(
            eye, geometry.vertex, geometry.normal, geometry.triangle, hit, barycentric,
            start, stop, surface,
        )  # fmt: skip

    for_blocks(points, len(hit), RAY_BLOCK)
    group = _run_bounds(key)
    return View(
        scene,
        width,
        height,
        subpixels,
        position=position,
        normal=normal,
        geometric=geometric,
        toward_eye=toward_eye,
        depth=depth,
        material=geometry.owner[hit],
        pixel=pixel[seen].astype(np.int32),
        subpixel=subpixel[seen].astype(np.int32),
        group=group,
        group_cell=key[group[:-1]] % CELLS,
        tile=_run_bounds(key // CELLS),
        background_pixel=pixel[~seen].astype(np.int32),
        background_direction=ray[~seen],
        materials=pack([item.material for item in scene.objects]),
        embree=embree,
    )
