"""A view: a scene seen by its camera at a resolution, with its shading points found once.

Every sampler and environment shades the same points, so they are computed once per (scene,
resolution, sub-pixels). Points are ordered by square tiles of pixels, and within a tile by the
cell of a pattern of eight, so that the points that share a set of interleaved lights lie together:
packets of rays towards one light then start close to each other. The pattern runs over 4 × 2 pixels
and, in other steps, over each pixel's sub-pixels, so that a pixel averages several sets.
"""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.geometry import geometry_of
from renderer.packet.embree import EmbreeScene
from renderer.packet.layout import Points
from renderer.packet.material_table import pack
from renderer.primary import LARGEST, find_points, packed_ray
from renderer.scene import Scene
from renderer.scene.materials import Lambert
from samplers.compiled import kernel
from samplers.errors import EnvlightError
from samplers.threads import for_blocks

Kept = TypeVar("Kept")
Array = NDArray[np.float32]
Surface = tuple[Array, Array, Array, Array]
"""Positions, shading and geometric normals, and directions to the eye, (n, 3) each."""
TILE = 16
"""Pixels along the side of a tile."""
TILE_BLOCK = 32
CELLS_X, CELLS_Y = 4, 2
CELLS = CELLS_X * CELLS_Y
"""Cells of the interleaving pattern: neighbours that may use different sets of lights."""


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
    materials : (m, 11) float64, see `material_table.pack`
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
    _kept: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)
    _lock: Any = field(default_factory=threading.Lock, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.position)

    def __repr__(self) -> str:
        return f"View({self.scene.name!r}, {self.width}×{self.height}, {len(self)} points)"

    @property
    def surface(self) -> Surface:
        """What kernels take of the points that look at nothing else."""
        return self.position, self.normal, self.geometric, self.toward_eye

    @property
    def points(self) -> Points:
        """All that kernels take of the points."""
        return Points(
            *self.surface, self.material, self.materials, self.pixel, self.subpixel, self.subpixels
        )

    def kept(self, key: Any, find: Callable[[], Kept]) -> Kept:
        """What `find` finds, which belongs to the view alone: found once for each key.

        `find` must not ask this view for what it keeps.
        """
        with self._lock:
            if key not in self._kept:
                self._kept[key] = find()
            found: Kept = self._kept[key]
            return found

    def reduced(self, factor: int) -> "View":
        """The same picture at 1/factor of the resolution, rounded up; found once."""
        width, height = -(-self.width // factor), -(-self.height // factor)
        return self.kept(
            ("reduced", factor),
            lambda: make_view(self.scene, width, height, self.subpixels, self.width / self.height),
        )

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
        """Average of the points' radiance (n, 3) and the background's (b, 3) over each pixel.

        Raises EnvlightError where that is no finite float32: under maps near its largest value.
        """
        image = np.zeros((self.height * self.width, 3))

        def add_tiles(a: int, b: int) -> None:  # tiles share no pixel
            rows = slice(self.tile[a], self.tile[b])
            _add_to_pixels(self.pixel[rows], point_radiance[rows], image)

        for_blocks(add_tiles, len(self.tile) - 1, TILE_BLOCK)
        if background is not None:
            _add_to_pixels(self.background_pixel, background, image)
        with np.errstate(over="ignore"):
            result = (image / self.subpixels).astype(np.float32)
        return finite(result).reshape(self.height, self.width, 3)


def finite(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The image itself; raises EnvlightError where a value is infinite or NaN."""
    if not np.isfinite(image).all():
        raise EnvlightError(
            "image: a pixel is beyond the range of float32, or NaN; scale the map down"
        )
    return image


def _bounds(count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Bounds (runs + 1,) of consecutive runs of so many points, without empty runs."""
    return np.concatenate([[0], np.cumsum(count[count > 0])])


@kernel
def pattern_cell(x, y, subpixel, subpixels):
    """Cell of a sub-pixel: (4 (y mod 2) + x mod 4 + step · sub-pixel) mod 8.

    step = max(1, 8 // sub-pixels) spreads few sub-pixels over all eight cells.
    """
    step = max(1, CELLS // subpixels)
    return ((y % CELLS_Y) * CELLS_X + x % CELLS_X + step * subpixel) % CELLS


@kernel
def _add_to_pixels(pixel, radiance, image):
    for i in range(len(pixel)):
        p = pixel[i]
        image[p, 0] += radiance[i, 0]
        image[p, 1] += radiance[i, 1]
        image[p, 2] += radiance[i, 2]


@kernel
def _order_tiles(width, height, subpixels, first, last, ray, visit, group):
    """The rays of the tiles first … last, by cell, at their places; see `_ray_order`."""
    tiles_x, place = -(-width // TILE), np.empty(CELLS, np.int64)
    for tile in range(first, last):
        left, top = tile % tiles_x * TILE, tile // tiles_x * TILE
        right, bottom = min(left + TILE, width), min(top + TILE, height)
        for cell in range(CELLS):
            place[cell] = 0
        for y in range(top, bottom):
            for x in range(left, right):
                for s in range(subpixels):
                    place[pattern_cell(x, y, s, subpixels)] += 1
        begin = (top * width + left * (bottom - top)) * subpixels
        end, visited = begin, begin
        for cell in range(CELLS):
            end, place[cell] = end + place[cell], end
            group[tile * CELLS + cell + 1] = end
        for y in range(top, bottom):
            for x in range(left, right):
                for s in range(subpixels):
                    cell = pattern_cell(x, y, s, subpixels)
                    ray[place[cell]], visit[visited] = packed_ray(x, y, s), place[cell] - begin
                    place[cell], visited = place[cell] + 1, visited + 1


def _ray_order(
    width: int, height: int, subpixels: int
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
    """The picture's rays (n,) by tile and cell, and the bounds of those runs (8 · tiles + 1,).

    Between them, (n,), the places in its tile of each ray, pixel by pixel: in that order packets
    are narrow, which Embree traces faster.
    """
    tiles = -(-width // TILE) * -(-height // TILE)
    total = width * height * subpixels
    ray, visit = np.empty(total, np.int64), np.empty(total, np.int32)
    group = np.zeros(tiles * CELLS + 1, np.int64)
    for_blocks(
        lambda a, b: _order_tiles(width, height, subpixels, a, b, ray, visit, group),
        tiles,
        TILE_BLOCK,
    )
    return ray, visit, group


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
    if max(width, height, subpixels) > LARGEST:
        raise EnvlightError(
            f"view: {width}×{height} pixels of {subpixels} sub-pixels; none may exceed {LARGEST}"
        )
    geometry = geometry_of(scene)
    order = _ray_order(width, height, subpixels)
    points = find_points(
        geometry, scene.camera, (width, height), aspect or width / height, subpixels, *order, CELLS
    )
    seen = {name: value for name, value in vars(points).items() if name != "count"}
    by_tile = points.count.reshape(-1, CELLS).sum(axis=1)
    return View(
        scene,
        width,
        height,
        subpixels,
        **seen,
        group=_bounds(points.count),
        group_cell=np.flatnonzero(points.count) % CELLS,
        tile=_bounds(by_tile),
        materials=pack([item.material for item in scene.objects]),
        embree=geometry.embree,
    )
