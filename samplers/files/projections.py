"""Maps in other projections as latitude-longitude maps, with the energy of each of their pixels.

A pixel of the picture stands for its solid angle, and its flux goes to the pixels of the map that
it covers. Which these are is asked at `SPLIT`² points of each. As points know solid angles only
roughly, they are weighted until the shares of every pixel, old and new, add up to what it has
(Sinkhorn's iteration), the picture's last: the energy of each is kept but for rounding, and an even
picture makes a nearly even map.

Pictures are seen from inside and not mirrored, the front being the middle of the latitude-longitude
map, +Z, and +X to the left of it. A mirror ball is photographed: what is left in its picture is
left of the camera, which is in front, and so it is mirrored.

=================  ==============  =================================================================
name               width : height  what is where
=================  ==============  =================================================================
lat-long           any             the whole sphere, at another size or aspect
cube-cross         4:3             left, front, right and back in the middle row, up and down above
                                   and below the front
cube-column        3:4             left, front and right in the second row, up above and down below
                                   the front, and below that the back, upside down
cube-row           6:1             right, left, up, down, front, back (+X, −X, +Y, −Y, +Z and −Z of
                                   OpenGL), side by side
cube-stack         1:6             the same, from top to bottom
octahedral         1:1             up in the middle, down in the corners, front below the middle,
                                   left to the left: (x, z) over |x| + |y| + |z|
angular            1:1             a disc; the angle from the front grows evenly, to the back at its
                                   rim
mirror-ball        1:1             a disc; the sine of half the angle from the front grows evenly
=================  ==============  =================================================================
"""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.files.stored_image import check_size
from samplers.sphere import direction_from_uv, row_solid_angle, uv_from_direction

Array = NDArray[np.float64]
Place = tuple[Array, Array]
SPLIT, ROUNDS = 4, 12
BAND = 32
"""Rows of the new map that are worked on at once."""
NODE = 0.5 + np.array([-0.5 + 1e-9, -math.sqrt(3.0 / 28.0), 0.0, math.sqrt(3.0 / 28.0), 0.5 - 1e-9])
LOBATTO, SIMPSON = np.array([9, 49, 64, 49, 9]) / 180.0, np.array([1, 4, 1]) / 6.0
"""Weights at all nodes on the unit interval, and at every other; densities jump beyond the ends."""
CELLS, CELL_ERROR = 1 << 13, 1e-9
"""Cells integrated at once; the sr that a smooth one may be off, and the part of the picture that a
rim's has, a tenth of it in doubt: 1e5 of them leave √1e5 · 1.6e-9 sr of 4π, 4e-8."""
ASPECT = 0.1
"""How far from 2 the aspect of what is taken for a latitude-longitude map may be."""


@dataclass(frozen=True)
class Projection:
    """A way to lay the sphere on a picture.

    place : u and v in [0, 1] of directions (..., 3), for an aspect of the picture's own
    density : solid angle over area of the unit square at u and v; 0 where nothing is shown
    aspects : width over height of pictures that are this as a rule
    rows : of a latitude-longitude map with about as many pixels in its middle, over the height
    """

    place: Callable[[Array], Place]
    density: Callable[[Array, Array], Array]
    aspects: tuple[float, ...]
    rows: float


SIDES = {
    "up": ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    "down": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
    "right": ((1, 0, 0), (0, 0, -1), (0, -1, 0)),
    "left": ((-1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "front": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "back": ((0, 0, -1), (-1, 0, 0), (0, -1, 0)),
    "BACK": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
}
"""Of a cube's faces, in coordinates to the right, up and to the front: where they lie, and what is
to the right and downwards in their pictures. Of two that share an edge the later one has it; "BACK"
is upside down."""


def _faces(cells: dict[str, tuple[int, int]], columns: int, rows: int) -> Projection:
    """A cube whose faces lie in cells (row, column) of a picture."""

    def place(d: Array) -> Place:
        way = d * (-1.0, 1.0, 1.0)
        depth = np.abs(way).max(axis=-1)
        u, v = np.empty(depth.shape), np.empty(depth.shape)
        for name in (name for name in SIDES if name in cells):
            toward, right, down = np.array(SIDES[name], np.float64)
            here, (row, column) = way @ toward == depth, cells[name]
            u[here] = (column + 0.5 * (1.0 + way[here] @ right / depth[here])) / columns
            v[here] = (row + 0.5 * (1.0 + way[here] @ down / depth[here])) / rows
        return u, v

    def density(u: Array, v: Array) -> Array:
        row, column = np.floor(v * rows), np.floor(u * columns)
        s, t = 2.0 * (u * columns - column) - 1.0, 2.0 * (v * rows - row) - 1.0
        shown = np.any([(row == r) & (column == c) for r, c in cells.values()], axis=0)
        return np.where(shown, 4.0 * columns * rows / (1.0 + s * s + t * t) ** 1.5, 0.0)

    return Projection(place, density, (columns / rows,), 2.0 / rows)


def _lat_long_density(u: Array, v: Array) -> Array:
    return 2.0 * math.pi**2 * np.sin(math.pi * v) + 0.0 * u


def _octahedral(d: Array) -> Place:
    x, y, z = np.moveaxis(d / np.abs(d).sum(axis=-1, keepdims=True), -1, 0)
    below = y < 0.0
    a = np.where(below, np.copysign(1.0 - np.abs(z), x), x)
    b = np.where(below, np.copysign(1.0 - np.abs(x), z), z)
    return 0.5 * (1.0 - a), 0.5 * (1.0 + b)


def _octahedral_density(u: Array, v: Array) -> Array:
    a, b = np.abs(2.0 * u - 1.0), np.abs(2.0 * v - 1.0)
    below = a + b > 1.0
    x, z = np.where(below, 1.0 - b, a), np.where(below, 1.0 - a, b)
    y = 1.0 - x - z
    return 4.0 / (x * x + y * y + z * z) ** 1.5


def _angular(d: Array) -> Place:
    across = np.hypot(d[..., 0], d[..., 1])
    r = np.arctan2(across, d[..., 2]) / math.pi
    scale = 0.5 * np.divide(r, across, out=np.ones_like(r), where=across > 0.0)
    return 0.5 - scale * d[..., 0], 0.5 - scale * d[..., 1]


def _angular_density(u: Array, v: Array) -> Array:
    r = np.hypot(2.0 * u - 1.0, 2.0 * v - 1.0)
    return np.where(r <= 1.0, 4.0 * math.pi**2 * np.sinc(r), 0.0)  # sinc r = sin πr / πr


def _mirror_ball(d: Array) -> Place:
    half = np.sqrt(2.0 * np.maximum(1.0 + d[..., 2], 1e-300))  # |d + z|, d + z being the normal
    return 0.5 * (1.0 + d[..., 0] / half), 0.5 * (1.0 - d[..., 1] / half)


def _mirror_ball_density(u: Array, v: Array) -> Array:
    return np.where(np.hypot(2.0 * u - 1.0, 2.0 * v - 1.0) <= 1.0, 16.0, 0.0)


MIDDLE = {"left": (1, 0), "front": (1, 1), "right": (1, 2), "up": (0, 1), "down": (2, 1)}
IN_ORDER = ("right", "left", "up", "down", "front", "back")
PROJECTIONS = {
    "lat-long": Projection(uv_from_direction, _lat_long_density, (), 1.0),
    "cube-cross": _faces(MIDDLE | {"back": (1, 3)}, 4, 3),
    "cube-column": _faces(MIDDLE | {"BACK": (3, 1)}, 3, 4),
    "cube-row": _faces({name: (0, i) for i, name in enumerate(IN_ORDER)}, 6, 1),
    "cube-stack": _faces({name: (i, 0) for i, name in enumerate(IN_ORDER)}, 1, 6),
    "octahedral": Projection(_octahedral, _octahedral_density, (1.0,), 1.0),
    "angular": Projection(_angular, _angular_density, (1.0,), 0.5),
    "mirror-ball": Projection(_mirror_ball, _mirror_ball_density, (1.0,), 1.0),
}


def candidates(width: int, height: int) -> list[str]:
    """The projections that pictures of this shape are as a rule."""
    found = [
        name
        for name, one in PROJECTIONS.items()
        if any(abs(width / height - aspect) * height < 1.0 for aspect in one.aspects)
    ]
    lat_long = abs(width / height - 2.0) <= 2.0 * ASPECT
    return found or (["lat-long"] if lat_long else [])


def to_lat_long(
    image: NDArray[np.float32], projection: str = "", height: int = 0, name: str = "unnamed"
) -> EnvironmentMap:
    """The latitude-longitude map of a picture of the sphere.

    image : (h, w, 3) float32, linear
    projection : its name; where it is empty, the only one that the picture's shape fits
    height : rows of the map; 0 for about the picture's own pixels

    Raises EnvlightError where the projection is unknown or cannot be told, or memory does not hold
    the map."""
    rows, columns = image.shape[:2]
    if not (np.isfinite(image).all() and image.min() >= 0.0):
        raise EnvlightError(f"map '{name}': radiance is NaN, infinite or negative; mend the file")
    size = f"map '{name}': {columns}×{rows} pixels"
    if not projection:
        found = candidates(columns, rows)
        if len(found) != 1:
            which = ", ".join(found or PROJECTIONS)
            raise EnvlightError(f"{size}; name their --projection: {which}")
        projection = found[0]
    if projection not in PROJECTIONS:
        raise EnvlightError(f"--projection {projection}: use {', '.join(PROJECTIONS)}")
    chosen = PROJECTIONS[projection]
    if chosen.aspects and projection not in candidates(columns, rows):
        raise EnvlightError(f"{size}; {projection} has an aspect of {chosen.aspects[0]:.4g}")
    height = height or max(1, round(rows * chosen.rows))
    check_size(Path(name), 2 * height, height, math.inf)
    return EnvironmentMap(_spread(chosen, image, height), name)


def _solid_angle(projection: Projection, rows: int, columns: int) -> Array:
    """What each pixel of the picture shows of the sphere, (h, w) in sr.

    Cells that a rim crosses, or for which Simpson's rule differs from Lobatto's, as at the folds of
    octahedra, are cut in four.
    """
    total = np.zeros(rows * columns)
    for first in range(0, rows * columns, CELLS):
        pixel = np.arange(first, min(first + CELLS, rows * columns))
        wide, high = 1.0 / columns, 1.0 / rows
        left, top = pixel % columns * wide, pixel // columns * high
        while len(pixel):
            found = (wide * high) * projection.density(
                left[:, None, None] + wide * NODE, top[:, None, None] + high * NODE[:, None]
            )
            fine, rough = found @ LOBATTO @ LOBATTO, found[:, ::2, ::2] @ SIMPSON @ SIMPSON
            rim = (found > 0.0).any(axis=(1, 2)) & (found == 0.0).any(axis=(1, 2))
            cut = np.where(rim, wide * high, np.abs(fine - rough)) > CELL_ERROR
            np.add.at(total, pixel[~cut], fine[~cut])
            wide, high = 0.5 * wide, 0.5 * high
            left = (left[cut, None] + wide * np.array([0.0, 1.0, 0.0, 1.0])).ravel()
            top = (top[cut, None] + high * np.array([0.0, 0.0, 1.0, 1.0])).ravel()
            pixel = np.repeat(pixel[cut], 4)
    return total.reshape(rows, columns)


def _owners(
    projection: Projection, rows: int, columns: int, height: int, top: int
) -> tuple[int, int, list[bytes]]:
    """The pixels of the picture, by number, at the points of a band: the first, the end, and all of
    each row packed, as those of all rows take more memory than all else."""
    u = (np.arange(SPLIT * 2 * height) + 0.5) / (SPLIT * 2 * height)
    first, end, packed = rows * columns, 0, []
    for number in range(top, min(top + BAND, height)):
        v = (SPLIT * number + np.arange(SPLIT) + 0.5) / (SPLIT * height)
        x, y = projection.place(direction_from_uv(u, v[:, None]))
        column = np.clip(x * columns, 0, columns - 1).astype(np.int32)
        owner = np.clip(y * rows, 0, rows - 1).astype(np.int32) * columns + column
        first, end = min(first, int(owner.min())), max(end, int(owner.max()) + 1)
        packed.append(zlib.compress(np.diff(owner.ravel(), prepend=np.int32(0)).tobytes(), 1))
    return first, end, packed


def _unpacked(packed: bytes) -> NDArray[np.int32]:
    """The pixels at the points of a row, (SPLIT, 2H, SPLIT)."""
    steps = np.frombuffer(zlib.decompress(packed), np.int32)
    return np.cumsum(steps, dtype=np.int32).reshape(SPLIT, -1, SPLIT)


def _sums(value: Array, owner: NDArray[np.int32], point: Array) -> Array:
    """The sums (2H,) of value (m,) times point (SPLIT,) over the points of a row's pixels."""
    return np.asarray((value[owner] * point[:, None, None]).sum(axis=(0, 2)))


@kernel
def _add_weights(point, new, first, owner, out):
    """Add the weights of the points of a row, point (SPLIT,) times new (2H,), to out (m,)."""
    for a in range(SPLIT):
        for j in range(len(new)):
            for b in range(SPLIT):
                out[owner[a, j, b] - first] += point[a] * new[j]


def _spread(projection: Projection, image: NDArray[np.float32], height: int) -> NDArray[np.float32]:
    """Radiance (H, 2H, 3) with the flux of every pixel of a picture."""
    rows, columns = image.shape[:2]
    bands = [
        (top, *_owners(projection, rows, columns, height, top)) for top in range(0, height, BAND)
    ]
    point = row_solid_angle(SPLIT * height, 2 * height * SPLIT).reshape(height, SPLIT)
    own = row_solid_angle(height, 2 * height)
    # New weights lie in the last two thirds of the radiance that they go into, band by band.
    result = np.empty((height, 2 * height, 3), np.float32)
    new = result.reshape(-1)[2 * height * height :].view(np.float64).reshape(height, -1)

    def of_pixels(old: Array | None) -> Array:
        """The weights of the points of each of the picture's pixels, summed; `new` follows `old`"""
        total = np.zeros(rows * columns)
        for top, first, end, packed in bands:
            part = np.zeros(end - first)
            for row, owner in enumerate(map(_unpacked, packed), top):
                if old is not None:
                    new[row] = own[row] / _sums(old, owner, point[row])
                _add_weights(point[row], new[row], first, owner, part)
            total[first:end] += part
        return total

    new[:] = 1.0
    counted = of_pixels(None)
    solid_angle = _solid_angle(projection, rows, columns).ravel()
    np.copyto(solid_angle, counted, where=solid_angle == 0.0)  # hit by a rounding alone
    # Pixels without a point, at rims where many show little, go to a neighbour.
    missed = np.flatnonzero((counted == 0.0) & (solid_angle > 0.0))
    to = missed
    if len(missed):
        near = distance_transform_edt(
            (counted == 0.0).reshape(rows, columns), return_distances=False, return_indices=True
        ).reshape(2, -1)[:, missed]
        to = near[0] * columns + near[1]
    picture = image.reshape(-1, 3)
    pixel, place = np.unique(to, return_inverse=True)
    flux = solid_angle[pixel, None] * picture[pixel].astype(np.float64)
    np.add.at(flux, place, solid_angle[missed, None] * picture[missed].astype(np.float64))
    np.add.at(solid_angle, to, solid_angle[missed])
    solid_angle[missed] = 0.0
    del counted
    old = np.ones(rows * columns)
    for _ in range(ROUNDS):
        weight = of_pixels(old)
        old = np.divide(solid_angle, weight, out=weight, where=weight > 0.0)
    share = np.divide(old, solid_angle, out=old, where=solid_angle > 0.0)
    for top, first, end, packed in bands:
        weight = new[top : top + BAND].copy()
        among = slice(*np.searchsorted(pixel, (first, end)))
        for channel in range(3):
            value = solid_angle[first:end] * picture[first:end, channel].astype(np.float64)
            value[pixel[among] - first] = flux[among, channel]
            value *= share[first:end]
            for row, owner in enumerate(map(_unpacked, packed)):
                part = _sums(value, owner - first, point[top + row])
                result[top + row, :, channel] = part * weight[row] / own[top + row]
    return result
