"""Assign every pixel of a latitude-longitude grid to the nearest light, and sum up the cells.

These are spherical Voronoi cells up to the size of a pixel. Pixels come in blocks: a light that the
plane between it and the light nearest to the block's middle parts from the whole block owns none of
its pixels, which leaves few candidates per block, also far from a crowd of lights. Distances are
chords, which keep their digits for lights that nearly coincide, unlike an arc cosine.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from samplers.sphere import TWO_PI, row_solid_angle
from samplers.threads import for_blocks

ROUNDING = 1e-14
"""More than float64 can be off in half a squared chord, so that no tie is left out."""
BLOCK = 16
"""Pixels per side of a block."""
REGION = 64
"""Pixels per side of a region, whose candidates are all that its blocks look at."""
ANGLE_ROWS = 256
"""Rows of pixels over which mean angles are taken, at most."""


@njit(cache=True)
def _chord2(ax, ay, az, bx, by, bz):
    dx, dy, dz = ax - bx, ay - by, az - bz
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def _pixel(row, column, r, c):
    """Direction of a pixel's centre from sine and cosine of its row's and its column's angle."""
    return column[c, 0] * row[r, 0], row[r, 1], -column[c, 1] * row[r, 0]


@njit(cache=True)
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


@njit(nogil=True, cache=True)
def _owner(x, y, z, direction, candidate, count):
    """The nearest of the candidates, the first of equals, and its squared chord."""
    nearest, owner = 8.0, candidate[0]
    for k in range(count):
        lx, ly, lz = direction[candidate[k]]
        distance = _chord2(x, y, z, lx, ly, lz)
        if distance < nearest:
            nearest, owner = distance, candidate[k]
    return owner, nearest


@njit(nogil=True, cache=True)
def _add_whole(solid_angle, radiance, repeat, box, out):
    """Add a block that one light owns."""
    top, left, bottom, right = box
    for r in range(top, bottom):
        red = green = blue = 0.0
        line = radiance[r // repeat]
        for c in range(left, right):
            texel = line[c if repeat == 1 else c // repeat]
            red += texel[0]
            green += texel[1]
            blue += texel[2]
        out[0] += solid_angle[r] * (right - left)
        out[1] += solid_angle[r] * red
        out[2] += solid_angle[r] * green
        out[3] += solid_angle[r] * blue


@njit(nogil=True, cache=True)
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


@njit(nogil=True, cache=True)
def _add_angles(row, column, solid_angle, stride, direction, candidate, count, box, out):
    """Add the sampled pixels of a block: solid angle × angle, and solid angle."""
    top, left, bottom, right = box
    for r in range(-(-top // stride) * stride, bottom, stride):
        for c in range(-(-left // stride) * stride, right, stride):
            x, y, z = _pixel(row, column, r, c)
            owner, nearest = _owner(x, y, z, direction, candidate, count)
            angle = 2.0 * math.asin(min(1.0, 0.5 * math.sqrt(nearest)))
            out[owner, 4] += solid_angle[r] * angle
            out[owner, 5] += solid_angle[r]


@njit(nogil=True, cache=True)
def _sum_cells(row, column, solid_angle, radiance, repeat, stride, direction, start, stop, out):
    """Add solid angle, flux and sampled angles of the pixels of rows start..stop to `out`."""
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
                    _add_whole(solid_angle, radiance, repeat, box, out[candidate[0]])
                else:
                    _add_shared(
                        row, column, solid_angle, radiance, repeat, direction, candidate, count,
                        box, out,
                    )  # fmt: skip
                _add_angles(row, column, solid_angle, stride, direction, candidate, count, box, out)


def nearest_light_cells(
    direction: NDArray[np.float64], radiance: NDArray[np.float32], repeat: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Solid angle (n,), mean angle to the light (n,) and flux (n, 3) of the lights' cells.

    direction : (n, 3) unit, at least one; of lights at equal distance the first owns the pixel
    radiance : (H, 2H, 3); each of its pixels is cut into `repeat` × `repeat` before the assignment
    The mean angle is taken over at most 512 × 256 of the pixels; it is NaN where a light has none
    of them.
    """
    height = len(radiance) * repeat
    solid_angle = row_solid_angle(height, 2 * height)
    theta = (np.arange(height) + 0.5) * (math.pi / height)
    phi = (np.arange(2 * height) + 0.5) * (0.5 * TWO_PI / height)
    row, column = (np.stack([np.sin(a), np.cos(a)], axis=1) for a in (theta, phi))
    parts = np.zeros((-(-height // REGION), len(direction), 6))
    stride = -(-height // ANGLE_ROWS)
    direction = np.ascontiguousarray(direction)

    def work(start: int, stop: int) -> None:
        _sum_cells(
            row, column, solid_angle, radiance, repeat, stride, direction, start, stop,
            parts[start // REGION],
        )  # fmt: skip

    for_blocks(work, height, REGION)
    total = parts.sum(axis=0)
    with np.errstate(invalid="ignore"):
        return total[:, 0], total[:, 4] / total[:, 5], total[:, 1:4]
