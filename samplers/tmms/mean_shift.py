"""Mean shift on a latitude-longitude grid, in the joint domain of direction and one value.

Every cell climbs to a mode of the density of cells: it moves to the mean of all cells within a
ball around it, again and again. Distances are chords between directions, so seam and poles need no
care; the grid serves only to find the cells that can lie in a ball. Towards the poles cells are
taken together in groups about as wide as they are high, or else the poles would cost as much as
all the rest.

With a flat kernel a step depends on which cells are in the ball and on nothing else, so climbs meet
exactly, long before their mode: two steps of three are known from a climb before.

Source: Comaniciu and Meer, "Mean shift: a robust approach toward feature space analysis", IEEE
PAMI 24(5), 2002, with the flat kernel on a joint ball, and solid angle as the weight of a cell.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.threads import for_blocks

ROWS = 8
"""Rows of the grid per block."""
SLOTS = 1 << 14
"""Steps that a block keeps in mind at most."""
MARGIN = 1e-9
"""Relative widening of a search window, for rounding."""


def group_sizes(height: int) -> NDArray[np.int64]:
    """Cells per group (h,) in each row: the largest power of two not above 1 / sin θ that fits."""
    sine = np.sin((np.arange(height) + 0.5) * (math.pi / height))
    largest = 2 * height & -(2 * height)
    size = 2 ** np.floor(np.log2(1.0 / sine)).astype(np.int64)
    return np.minimum(size, largest)


def mean_of_groups(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """The map (h, 2h) with each cell's value replaced by the mean of its group."""
    result = value.copy()
    for row, size in enumerate(group_sizes(len(value)).tolist()):
        if size > 1:
            result[row] = np.repeat(value[row].reshape(-1, size).mean(axis=1), size)
    return result


@dataclass(frozen=True, eq=False)
class Groups:
    """What the cells of a grid climb among; only the first 2h / size entries of a row are in use.

    size : (h,) cells per group of a row; weight : (h,) solid angle of a group
    feature : (h, 4, 2h) x, y, z and value of the groups in units of their bandwidths
    reach : rows above and below that a ball can touch
    half_width : (h, 2 reach + 1) groups to either side in those rows, −1 for none
    """

    size: NDArray[np.int64]
    weight: NDArray[np.float64]
    feature: NDArray[np.float64]
    reach: int
    half_width: NDArray[np.int64]


@kernel
def _half_widths(size, angle, reach):
    """Groups to either side that a cap around any point of a row can reach in the rows nearby."""
    height = len(size)
    step = math.pi / height
    angle = (angle + 0.5 * step) * (1.0 + MARGIN)  # a point is half a row from the row's middle
    table = np.full((height, 2 * reach + 1), -1, np.int64)
    for r in range(height):
        a = (r + 0.5) * step
        for k in range(2 * reach + 1):
            other = r + k - reach
            b = (other + 0.5) * step
            if other < 0 or other >= height or abs(a - b) > angle:
                continue
            table[r, k] = height  # the whole row
            if angle < min(a + b, 2.0 * math.pi - a - b):
                cosine = (math.cos(angle) - math.cos(a) * math.cos(b)) / (math.sin(a) * math.sin(b))
                half = math.acos(min(max(cosine, -1.0), 1.0)) * (1.0 + MARGIN)
                table[r, k] = math.ceil(half / (step * size[other]))
    return table


def groups_of(value: NDArray[np.float64], bandwidth: float, value_bandwidth: float) -> Groups:
    """The groups of a grid (h, 2h) of values that are constant in each group.

    bandwidth : chord; a ball is |Δω|² / b_ω² + Δv² / b_v² ≤ 1
    """
    height = len(value)
    step = math.pi / height
    size = group_sizes(height)
    theta = (np.arange(height) + 0.5) * step
    solid_angle = 2.0 * np.sin(theta) * math.sin(0.5 * step) * (step * size)
    feature = np.full((height, 4, 2 * height), np.nan)
    for row, width in enumerate((2 * height // size).tolist()):
        phi = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
        sine, cosine = math.sin(theta[row]), math.cos(theta[row])
        feature[row, 0, :width] = np.sin(phi) * sine / bandwidth
        feature[row, 1, :width] = cosine / bandwidth
        feature[row, 2, :width] = -np.cos(phi) * sine / bandwidth
        feature[row, 3, :width] = value[row, :: size[row]] / value_bandwidth
    # Sums along a row stay below 2^exponent: multiples of 2^(exponent − 53) add up exactly.
    exponent = math.frexp(2 * height * np.nanmax(np.abs(feature)))[1]
    feature = np.ldexp(np.rint(np.ldexp(feature, 53 - exponent)), exponent - 53)
    # From a mean inside the sphere, a chord can span a little more than its angle at the surface.
    angle = math.asin(bandwidth) if bandwidth < 1.0 else math.pi
    reach = min(height, math.ceil(angle / step) + 1)
    return Groups(size, solid_angle, feature, reach, _half_widths(size, angle, reach))


@kernel
def _distance2(point, x, y, z, v):
    dx, dy, dz, dv = x - point[0], y - point[1], z - point[2], v - point[3]
    return dx * dx + dy * dy + dz * dz + dv * dv


@njit(nogil=True, cache=True, fastmath={"reassoc", "nsz"})
def _add_run(point, feature, r, first, stop):
    """Number and sums of x, z and value of those groups first … stop of row r that are in the ball.

    The sums are exact, so that their order, which is left to the compiler, changes no bit.
    """
    count = sx = sz = sv = 0.0
    y = feature[r, 1, 0]
    for c in range(np.uint64(first), np.uint64(stop)):
        x, z, v = feature[r, 0, c], feature[r, 2, c], feature[r, 3, c]
        inside = 1.0 if _distance2(point, x, y, z, v) <= 1.0 else 0.0
        count += inside
        sx += inside * x
        sz += inside * z
        sv += inside * v
    return count, sx, sz, sv


@kernel
def _mean(point, feature, size, weight, reach, half_width):
    """The mean of the groups in a unit ball around `point`, a tuple as `point` is."""
    height, full = len(feature), feature.shape[2]
    x, y, z = point[:3]
    step = math.pi / height
    row = min(int(math.atan2(math.sqrt(x * x + z * z), y) / step), height - 1)
    phi = math.atan2(x, -z)
    if phi < 0.0:
        phi += 2.0 * math.pi
    total = sx = sy = sz = sv = 0.0
    for r in range(max(0, row - reach), min(height, row + reach + 1)):
        half, width = half_width[row, r - row + reach], full // size[r]
        if half < 0:
            continue
        first = int(phi / (step * size[r])) - half
        stop = first + 2 * half + 1
        if stop - first >= width:
            first, stop = 0, width
        # What lies beyond an end of the row is at its other end.
        part, px, pz, pv = _add_run(point, feature, np.uint64(r), max(first, 0), min(stop, width))
        if first < 0 or stop > width:
            low, high = (first + width, width) if first < 0 else (0, stop - width)
            more, qx, qz, qv = _add_run(point, feature, np.uint64(r), low, high)
            part, px, pz, pv = part + more, px + qx, pz + qz, pv + qv
        total += weight[r] * part
        sx += weight[r] * px
        sy += weight[r] * (part * feature[r, 1, 0])
        sz += weight[r] * pz
        sv += weight[r] * pv
    if total > 0.0:
        return sx / total, sy / total, sz / total, sv / total
    return point


@kernel
def _slot(point):
    """One of SLOTS places for the step from a point."""
    mixed = point[0] * 7.1e6 + point[1] * 8.3e6 + point[2] * 9.7e6 + point[3] * 1.1e7
    # What is below 1 may be rounded to it; and a bandwidth of next to nothing leaves no number.
    return np.uint64((mixed - math.floor(mixed)) * SLOTS) & np.uint64(SLOTS - 1)


@kernel
def _climb(feature, size, weight, reach, half_width, steps, tolerance, start, stop, mode):
    """The modes of rows start … stop; a step that was taken before is not computed again."""
    known = np.full((SLOTS, 8), np.nan)  # where a step begins and where it ends
    for r in range(start, stop):
        for c in range(feature.shape[2] // size[r]):
            point = (feature[r, 0, c], feature[r, 1, c], feature[r, 2, c], feature[r, 3, c])
            for _ in range(steps):
                k = _slot(point)
                if (known[k, 0], known[k, 1], known[k, 2], known[k, 3]) != point:
                    known[k, 0], known[k, 1], known[k, 2], known[k, 3] = point
                    mean = _mean(point, feature, size, weight, reach, half_width)
                    known[k, 4], known[k, 5], known[k, 6], known[k, 7] = mean
                start_point = point
                point = (known[k, 4], known[k, 5], known[k, 6], known[k, 7])
                if _distance2(start_point, *point) <= tolerance * tolerance:
                    break
            for k in range(c * size[r], (c + 1) * size[r]):
                mode[r, k, 0], mode[r, k, 1], mode[r, k, 2], mode[r, k, 3] = point


def modes(groups: Groups, steps: int = 100, tolerance: float = 1e-3) -> NDArray[np.float64]:
    """Where each cell's climb ends: (h, 2h, 4), direction and value in units of their bandwidths.

    steps, tolerance : a climb ends after so many steps, or with one shorter than this
    """
    height = len(groups.size)
    mode = np.empty((height, 2 * height, 4))
    for_blocks(
        lambda a, b: _climb(groups.feature, groups.size, groups.weight, groups.reach,
                            groups.half_width, steps, tolerance, a, b, mode),
        height,
        ROWS,
    )  # fmt: skip
    return mode
