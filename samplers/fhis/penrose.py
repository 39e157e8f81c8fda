"""A hierarchical Penrose tiling whose points are numbered in the Fibonacci system.

The plane is covered by one obtuse golden triangle. Triangles subdivide into smaller golden
triangles, and now and then a sampling tile, a point with a scale and a direction, is born among
them. Every subdivision prepends two bits to a tile's code; read as a sum of Fibonacci numbers
(Zeckendorf's representation: no two adjacent ones), the code of a sampling tile is unique and
spreads evenly: about half of the codes below any number occur, and the points that carry them cover
the root triangle with uniform density. So the points with a code below a local threshold have a
density proportional to that threshold.

THIN_C and THIN_D are acute golden triangles with the sides s, φs, φs; FAT_E and FAT_F are obtuse
ones with the sides φ²s, φs, φs. A tile is given by its first corner, a direction d in steps of 18°
and its side s. The second and third corners of a thin tile lie at s·u(d) and φs·u(d + 4), those of
a fat one at φ²s·u(d) and φs·u(d + 2).

Source: Ostromoukhov, Donohue, Jodoin, "Fast hierarchical importance sampling with blue noise
properties", ACM Transactions on Graphics 23(3), 2004.

A branch of the hierarchy is left out as soon as its smallest possible code exceeds the largest
importance within its bounding box, so the cost is about linear in the number of points.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.fhis.max_pyramid import MaxPyramid, largest_in

PHI = 0.5 * (1.0 + math.sqrt(5.0))
DIRECTIONS = 20

_ANGLE = np.arange(DIRECTIONS) * (math.pi / 10.0)
UNIT = np.stack([-np.sin(_ANGLE), np.cos(_ANGLE)], axis=1)
"""u(d), (20, 2): direction 0 is +y, counter-clockwise in steps of 18°."""

FIBONACCI = np.ones(93, np.int64)
"""F₁ = F₂ = 1; F₉₂ is the last that int64 holds. Entry 0 is F₀ = 0."""
FIBONACCI[0] = 0
for _j in range(3, len(FIBONACCI)):
    FIBONACCI[_j] = FIBONACCI[_j - 1] + FIBONACCI[_j - 2]

THIN_C, THIN_D, FAT_E, FAT_F = range(4)

POINTS_PER_INTEGRAL = 1.0 / (PHI**3 * math.sin(math.pi / 5.0))
"""Points per ∫ importance dA / s₀²: half of all codes over the root's area ½φ³ sin 36° s₀²."""


@dataclass(frozen=True, eq=False)
class Births:
    """Sampling tiles as they were born, n of them.

    position : (n, 2) float64, x to the right and y down, in pixels
    direction : (n,) int64, 0 to 19
    level : (n,) int64
    code : (n,) int64, the value of the F-code
    newest : (n,) int64, the six most significant bits of the code
    importance : (n,) float64, of the pixel that holds the position
    """

    position: NDArray[np.float64]
    direction: NDArray[np.int64]
    level: NDArray[np.int64]
    code: NDArray[np.int64]
    newest: NDArray[np.int64]
    importance: NDArray[np.float64]


@kernel
def _corners(kind, x, y, d, s):
    """The second and third corner of a triangle."""
    if kind in (THIN_C, THIN_D):
        length, turn = s, 4
    else:
        length, turn = PHI * PHI * s, 2
    e = (d + turn) % DIRECTIONS
    return (
        x + length * UNIT[d, 0],
        y + length * UNIT[d, 1],
        x + PHI * s * UNIT[e, 0],
        y + PHI * s * UNIT[e, 1],
    )


@kernel
def _subdivide(kind, x, y, d, s, tile, place):
    """The children of a triangle of side s, whose own side is s/φ; returns the number of triangles.

    tile : (4, 3) out, type, direction and the two new bits of each child
    place : (4, 2) out, first corner of each child
    The sampling tile, where one is born, is the last row; its type is otherwise -1.
    """
    x2, y2, x3, y3 = _corners(kind, x, y, d, s)
    t = s / PHI
    tile[3, 0] = -1
    if kind == THIN_C:
        _child(tile, place, 0, FAT_F, x3, y3, d + 14, 0b00)
        _child(tile, place, 1, THIN_C, x2, y2, d + 6, 0b10)
        _, _, px, py = _corners(FAT_F, x3, y3, tile[0, 1], t)
        _child(tile, place, 3, 0, px, py, d + 1, 0b10)
        return 2
    if kind == THIN_D:
        _child(tile, place, 0, FAT_E, x2, y2, d + 6, 0b00)
        _, _, px, py = _corners(FAT_E, x2, y2, tile[0, 1], t)
        _child(tile, place, 1, THIN_D, px, py, d + 14, 0b10)
        return 2
    if kind == FAT_E:
        _child(tile, place, 0, THIN_C, x3, y3, d + 12, 0b10)
        _child(tile, place, 1, FAT_E, x2, y2, d + 8, 0b01)
        _child(tile, place, 2, FAT_F, x, y, d, 0b00)
        px, py, _, _ = _corners(THIN_C, x3, y3, tile[0, 1], t)
        _child(tile, place, 3, 0, px, py, d + 7, 0b10)
        return 3
    _child(tile, place, 0, FAT_F, x3, y3, d + 12, 0b01)
    _, _, px, py = _corners(FAT_F, x3, y3, tile[0, 1], t)
    _child(tile, place, 1, FAT_E, px, py, d, 0b00)
    _child(tile, place, 3, 0, px, py, d + 15, 0b01)
    _, _, px, py = _corners(FAT_E, px, py, tile[1, 1], t)
    _child(tile, place, 2, THIN_D, px, py, d + 8, 0b10)
    return 3


@kernel
def _child(tile, place, i, kind, x, y, d, bits):
    tile[i, 0], tile[i, 1], tile[i, 2] = kind, d % DIRECTIONS, bits
    place[i, 0], place[i, 1] = x, y


@kernel
def _added(bits, level):
    """What two new bits at a level add to the value of a code."""
    if bits == 0b10:
        return FIBONACCI[2 * level + 1]
    return FIBONACCI[2 * level] if bits == 0b01 else np.int64(0)


@kernel
def _bound(luminance, row_weight, start, maximum, kind, x, y, d, s):
    """Upper bound of the importance in the bounding box of a triangle; 0 outside the map."""
    x2, y2, x3, y3 = _corners(kind, x, y, d, s)
    left, right = math.floor(min(x, x2, x3)), math.floor(max(x, x2, x3))
    top, bottom = math.floor(min(y, y2, y3)), math.floor(max(y, y2, y3))
    height, width = luminance.shape
    if right < 0 or bottom < 0 or left >= width or top >= height:
        return 0.0
    return largest_in(
        luminance, row_weight, start, maximum,
        max(top, 0), max(left, 0), min(bottom, height - 1), min(right, width - 1),
    )  # fmt: skip


@kernel
def _grown(array):
    larger = np.empty((2 * array.shape[0], array.shape[1]), array.dtype)
    # Element by element: compiling an assignment of slices takes seconds, for its error's words.
    for i in range(array.shape[0]):
        for k in range(array.shape[1]):
            larger[i, k] = array[i, k]
    return larger


@kernel
def _push(stack, spot, depth, kind, d, level, code, newest, x, y, side):
    stack[depth, 0], stack[depth, 1], stack[depth, 2] = kind, d, level
    stack[depth, 3], stack[depth, 4] = code, newest
    spot[depth, 0], spot[depth, 1], spot[depth, 2] = x, y, side


@kernel
def _walk(luminance, row_weight, start, maximum, scale, x, y, side, whole, real):
    """Depth-first through the hierarchy; returns the number of births and the (grown) outputs.

    whole : (n, 4) int64 out, direction, level, code and newest bits
    real : (n, 3) float64 out, x, y and importance
    """
    height, width = luminance.shape
    stack = np.empty((256, 5), np.int64)  # type, direction, level, code, newest bits
    spot = np.empty((256, 3))
    tile, place = np.empty((4, 3), np.int64), np.empty((4, 2))
    _push(stack, spot, 0, FAT_F, 15, 0, 0, 0, x, y, side)
    depth, count = 1, 0
    while depth > 0:
        depth -= 1
        kind, d, level, code, newest = stack[depth]
        px, py, s = spot[depth]
        # A later birth adds at least F(2·level + 2) to the code.
        reach = scale * _bound(luminance, row_weight, start, maximum, kind, px, py, d, s)
        if reach < code + FIBONACCI[2 * level + 2]:
            continue
        triangles = _subdivide(kind, px, py, d, s, tile, place)
        for i in range(4):
            if (i >= triangles and i < 3) or tile[i, 0] < 0:
                continue
            value = code + _added(tile[i, 2], level + 1)
            bits = tile[i, 2] << 4 | newest >> 2
            if i < 3:
                _push(stack, spot, depth, tile[i, 0], tile[i, 1], level + 1, value, bits,
                      place[i, 0], place[i, 1], s / PHI)  # fmt: skip
                depth += 1
                continue
            column, row = math.floor(place[3, 0]), math.floor(place[3, 1])
            if column < 0 or row < 0 or column >= width or row >= height:
                continue
            importance = np.float64(luminance[row, column]) * row_weight[row]
            if scale * importance < value:
                continue
            if count == len(whole):
                whole, real = _grown(whole), _grown(real)
            whole[count, 0], whole[count, 1] = tile[3, 1], level + 1
            whole[count, 2], whole[count, 3] = value, bits
            real[count, 0], real[count, 1] = place[3, 0], place[3, 1]
            real[count, 2] = importance
            count += 1
    return count, whole, real


def births(
    importance: MaxPyramid, scale: float, corner: tuple[float, float], side: float
) -> Births:
    """All sampling tiles whose code does not exceed `scale` × the importance where they stand.

    corner, side : first corner and side s₀ of the root, an obtuse triangle with its long edge φ²s₀
        along +x and its apex towards +y
    """
    whole, real = np.empty((1024, 4), np.int64), np.empty((1024, 3))
    count, whole, real = _walk(
        importance.luminance, importance.row_weight, importance.start, importance.maximum,
        scale, corner[0], corner[1], side, whole, real,
    )  # fmt: skip
    whole, real = whole[:count], real[:count]
    return Births(real[:, :2], whole[:, 0], whole[:, 1], whole[:, 2], whole[:, 3], real[:, 2])
