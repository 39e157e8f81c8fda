"""Assign every pixel of a latitude-longitude grid to the nearest light, and sum up the cells.

These are spherical Voronoi cells up to the size of a pixel. Pixels come in blocks: a light that the
plane between it and the light nearest to the block's middle parts from the whole block owns none of
its pixels, which leaves few candidates per block, also far from a crowd of lights. Distances are
chords, which keep their digits for lights that nearly coincide, unlike an arc cosine.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.lighting import LIGHT_EXTENT, LightExtent, extent_of, size_of
from samplers.sphere import DISC_MEAN, DISC_RIM, TWO_PI, row_solid_angle
from samplers.threads import for_blocks

ROUNDING = 1e-14
"""More than float64 can be off in half a squared chord: no tie is left out, nor decided by it."""
BLOCK = 16
"""Pixels per side of a block."""
REGION = 64
"""Pixels per side of a region, whose candidates are all that its blocks look at."""
ANGLE_ROWS = 256
"""Rows of pixels over which angles are taken, at most."""
SUMS = 7
"""Per cell: solid angle, flux in R, G and B, moment of luminous flux along x, y and z."""


@dataclass(frozen=True, eq=False)
class LightCells:
    """What lies nearer to each of n lights than to any other.

    solid_angle : (n,) in sr; flux : (n, 3) ∫ L dω; moment : (n, 3) ∫ Y ω dω
    owner : (h, w) int32, the lights of every `stride`-th pixel of every `stride`-th row
    height : rows of pixels
    """

    solid_angle: NDArray[np.float64]
    flux: NDArray[np.float64]
    moment: NDArray[np.float64]
    owner: NDArray[np.int32]
    stride: int
    height: int

    def extent(
        self, direction: NDArray[np.float64], which: LightExtent = LIGHT_EXTENT
    ) -> NDArray[np.float64]:
        """The extents of `angle`, and those of discs of the cells' size where it has none."""
        size, angle = np.sqrt(self.solid_angle), self.angle(direction, which)
        disc = extent_of(which, lambda: DISC_MEAN * size, lambda: DISC_RIM * size)
        return np.where(np.isnan(angle), disc, angle)

    def angle(
        self, direction: NDArray[np.float64], which: LightExtent = LIGHT_EXTENT
    ) -> NDArray[np.float64]:
        """Extents (n,) of lights in the directions (n, 3) over the pixels of their cells.

        These are the pixels in `owner`; NaN where a cell has none of them.
        """
        height, out = self.height, np.zeros((len(direction), 3))
        row, column = _angles_of(height)
        solid_angle = row_solid_angle(height, 2 * height)
        _add_angles(row, column, solid_angle, self.stride, self.owner, direction, out)
        weight = np.where(out[:, 1] > 0.0, out[:, 1], np.nan)
        return extent_of(
            which, lambda: out[:, 0] / weight, lambda: np.where(weight > 0.0, out[:, 2], np.nan)
        )


def _angles_of(height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sine and cosine (n, 2) of the polar angles of rows and of the azimuths of columns."""
    theta = (np.arange(height) + 0.5) * (math.pi / height)
    phi = (np.arange(2 * height) + 0.5) * (0.5 * TWO_PI / height)
    row, column = (np.stack([np.sin(a), np.cos(a)], axis=1) for a in (theta, phi))
    return row, column


@kernel
def _chord2(ax, ay, az, bx, by, bz):
    dx, dy, dz = ax - bx, ay - by, az - bz
    return dx * dx + dy * dy + dz * dz


@kernel
def _pixel(row, column, r, c):
    """Direction of a pixel's centre from sine and cosine of its row's and its column's angle."""
    return column[c, 0] * row[r, 0], row[r, 1], -column[c, 1] * row[r, 0]


@kernel
def _candidates(row, column, direction, pool, pooled, box, chord, out):
    """Which of the `pooled` lights in `pool` may be nearest to a pixel of a box; their number."""
    top, left, bottom, right = box
    mx, my, mz = _pixel(row, column, (top + bottom) // 2, (left + right) // 2)
    radius = 0.0
    for r in range(top, bottom):  # along a row the distance grows with |φ − φ of the middle|
        for c in (left, right - 1):
            x, y, z = _pixel(row, column, r, c)
            radius = max(radius, _chord2(x, y, z, mx, my, mz))
    first = 0
    for k in range(pooled):
        x, y, z = direction[pool[k]]
        chord[k] = _chord2(x, y, z, mx, my, mz)
        if chord[k] < chord[first]:
            first = k
    radius = math.sqrt(radius) * (1.0 + 1e-9)
    fx, fy, fz = direction[pool[first]]
    count = 0
    for k in range(pooled):
        x, y, z = direction[pool[k]]
        # p · (f − i) at the middle, and the most that it changes within the box.
        ahead = 0.5 * (chord[k] - chord[first])
        if ahead <= radius * math.sqrt(_chord2(x, y, z, fx, fy, fz)) + ROUNDING:
            out[count] = pool[k]
            count += 1
    return count


@kernel
def _owner(x, y, z, direction, candidate, count):
    """The nearest of the candidates, the first of equals, and its squared chord."""
    nearest, owner = 8.0, candidate[0]
    for k in range(count):
        lx, ly, lz = direction[candidate[k]]
        distance = _chord2(x, y, z, lx, ly, lz)
        if distance < nearest - ROUNDING:
            nearest, owner = distance, candidate[k]
    return owner, nearest


@kernel
def _add_whole(row, column, solid_angle, radiance, repeat, box, out):
    """Add a block that one light owns."""
    top, left, bottom, right = box
    for r in range(top, bottom):
        red = green = blue = along = across = 0.0
        line = radiance[r // repeat]
        for c in range(left, right):
            texel = line[c if repeat == 1 else c // repeat]
            tr, tg, tb = np.float64(texel[0]), np.float64(texel[1]), np.float64(texel[2])
            y = 0.2126 * tr + 0.7152 * tg + 0.0722 * tb
            red += tr
            green += tg
            blue += tb
            along += y * column[c, 0]
            across += y * column[c, 1]
        horizontal = solid_angle[r] * row[r, 0]
        luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
        out[0] += solid_angle[r] * (right - left)
        out[1] += solid_angle[r] * red
        out[2] += solid_angle[r] * green
        out[3] += solid_angle[r] * blue
        out[4] += horizontal * along
        out[5] += solid_angle[r] * row[r, 1] * luminance
        out[6] -= horizontal * across


@kernel
def _add_shared(row, column, solid_angle, radiance, repeat, direction, candidate, count, box, out):
    """Add a block pixel by pixel to the nearest of its candidates."""
    top, left, bottom, right = box
    for r in range(top, bottom):
        line = radiance[r // repeat]
        for c in range(left, right):
            x, y, z = _pixel(row, column, r, c)
            owner, _ = _owner(x, y, z, direction, candidate, count)
            texel = line[c if repeat == 1 else c // repeat]
            out[owner, 0] += solid_angle[r]
            for channel in range(3):
                out[owner, 1 + channel] += solid_angle[r] * np.float64(texel[channel])
            luminance = (
                0.2126 * np.float64(texel[0])
                + 0.7152 * np.float64(texel[1])
                + 0.0722 * np.float64(texel[2])
            )
            out[owner, 4] += solid_angle[r] * luminance * x
            out[owner, 5] += solid_angle[r] * luminance * y
            out[owner, 6] += solid_angle[r] * luminance * z


@kernel
def _sample_owners(row, column, stride, direction, candidate, count, box, owner):
    """Set the owners of the sampled pixels of a block."""
    top, left, bottom, right = box
    for r in range(-(-top // stride) * stride, bottom, stride):
        for c in range(-(-left // stride) * stride, right, stride):
            x, y, z = _pixel(row, column, r, c)
            found, _ = _owner(x, y, z, direction, candidate, count)
            owner[r // stride, c // stride] = found


@kernel
def _add_angles(row, column, solid_angle, stride, owner, direction, out):
    """Add the sampled pixels: solid angle × angle, solid angle, and the largest angle."""
    for r in range(owner.shape[0]):
        for c in range(owner.shape[1]):
            x, y, z = _pixel(row, column, r * stride, c * stride)
            light, weight = owner[r, c], solid_angle[r * stride]
            lx, ly, lz = direction[light]
            chord = math.sqrt(_chord2(x, y, z, lx, ly, lz))
            angle = 2.0 * math.asin(min(1.0, 0.5 * chord))
            out[light, 0] += weight * angle
            out[light, 1] += weight
            out[light, 2] = max(out[light, 2], angle)


@kernel
def _sum_cells(
    row, column, solid_angle, radiance, repeat, stride, direction, start, stop, out, owner
):
    """Add solid angle, flux and moment of the pixels of rows start..stop to `out`."""
    width, lights = len(column), len(direction)
    everyone, chord = np.arange(lights), np.empty(lights)
    pool, candidate = np.empty(lights, np.int64), np.empty(lights, np.int64)
    for west in range(0, width, REGION):
        east = min(west + REGION, width)
        region = (start, west, stop, east)
        pooled = _candidates(row, column, direction, everyone, lights, region, chord, pool)
        for top in range(start, stop, BLOCK):
            for left in range(west, east, BLOCK):
                box = (top, left, min(top + BLOCK, stop), min(left + BLOCK, east))
                count = _candidates(row, column, direction, pool, pooled, box, chord, candidate)
                if count == 1:
                    _add_whole(row, column, solid_angle, radiance, repeat, box, out[candidate[0]])
                else:
                    _add_shared(
                        row, column, solid_angle, radiance, repeat, direction, candidate, count,
                        box, out,
                    )  # fmt: skip
                _sample_owners(row, column, stride, direction, candidate, count, box, owner)


def nearest_light_cells(
    direction: NDArray[np.float64], radiance: NDArray[np.float32], repeat: int = 1
) -> LightCells:
    """The cells of n lights.

    direction : (n, 3) unit, at least one; of lights at equal distance the first owns the pixel
    radiance : (H, 2H, 3); each of its pixels is cut into `repeat` × `repeat` before the assignment
    """
    height = len(radiance) * repeat
    solid_angle = row_solid_angle(height, 2 * height)
    row, column = _angles_of(height)
    parts = np.zeros((-(-height // REGION), len(direction), SUMS))
    stride = -(-height // ANGLE_ROWS)
    owner = np.empty((-(-height // stride), -(-2 * height // stride)), np.int32)
    direction = np.ascontiguousarray(direction)

    def work(start: int, stop: int) -> None:
        _sum_cells(
            row, column, solid_angle, radiance, repeat, stride, direction, start, stop,
            parts[start // REGION], owner,
        )  # fmt: skip

    for_blocks(work, height, REGION)
    total = parts.sum(axis=0)
    return LightCells(total[:, 0], total[:, 1:4], total[:, 4:], owner, stride, height)


def shining_radius(
    environment: EnvironmentMap, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Angular radius (n,), in radians, of what shines nearest to each of the lights (n, 3).

    Size is what `lighting.size_of` says it is, of the pixels nearest to each light. Costs an
    assignment of all pixels, so it is for those who ask.
    """
    if not len(direction) or environment.is_black:
        return np.zeros(len(direction))
    powers = np.zeros(environment.radiance.shape, np.float32)  # Y and Y², as two of three channels
    np.divide(environment.luminance, environment.luminance.max(), out=powers[..., 0])
    np.square(powers[..., 0], out=powers[..., 1])
    flux, square, _ = nearest_light_cells(direction, powers).flux.T
    return size_of(flux, square)
