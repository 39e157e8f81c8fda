"""Mean shift on a latitude-longitude grid, in the joint domain of direction and one value.

Every cell climbs to a mode of the density of cells: it moves to the mean of all cells within a
ball around it, again and again. Distances are chords between directions, so seam and poles need no
care; the grid serves only to find the cells that can lie in a ball. Towards the poles cells are
taken together in groups about as wide as they are high, or else the poles would cost as much as
all the rest.

Source: Comaniciu and Meer, "Mean shift: a robust approach toward feature space analysis", IEEE
PAMI 24(5), 2002, with the flat kernel on a joint ball, and solid angle as the weight of a cell.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from samplers.threads import for_blocks

ROWS = 4
"""Rows of the grid per block."""
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
    feature : (h, 2h, 4) direction and value of the groups in units of their bandwidths
    reach : rows above and below that a ball can touch
    half_width : (h, 2 reach + 1) groups to either side in those rows, −1 for none
    """

    size: NDArray[np.int64]
    weight: NDArray[np.float64]
    feature: NDArray[np.float64]
    reach: int
    half_width: NDArray[np.int64]


@njit(nogil=True, cache=True)
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
    feature = np.full((height, 2 * height, 4), np.nan)
    for row, width in enumerate((2 * height // size).tolist()):
        phi = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
        sine, cosine = math.sin(theta[row]), math.cos(theta[row])
        feature[row, :width, 0] = np.sin(phi) * sine / bandwidth
        feature[row, :width, 1] = cosine / bandwidth
        feature[row, :width, 2] = -np.cos(phi) * sine / bandwidth
        feature[row, :width, 3] = value[row, :: size[row]] / value_bandwidth
    # From a mean inside the sphere, a chord can span a little more than its angle at the surface.
    angle = math.asin(bandwidth) if bandwidth < 1.0 else math.pi
    reach = min(height, math.ceil(angle / step) + 1)
    return Groups(size, solid_angle, feature, reach, _half_widths(size, angle, reach))


@njit(nogil=True, cache=True)
def _step(point, feature, size, weight, reach, half_width, mean):
    """Set `mean` to that of the groups in a unit ball around `point`; the squared step to it."""
    height, full = feature.shape[:2]
    x, y, z, v = point
    step = math.pi / height
    row = min(int(math.atan2(math.sqrt(x * x + z * z), y) / step), height - 1)
    phi = math.atan2(x, -z)
    if phi < 0.0:
        phi += 2.0 * math.pi
    total = sx = sy = sz = sv = 0.0
    for r in range(max(0, row - reach), min(height, row + reach + 1)):
        half, width = half_width[row, r - row + reach], full // size[r]
        first, count = int(phi / (step * size[r])) - half, 2 * half + 1
        if half < 0:
            continue
        if count >= width:
            first, count = 0, width
        c = first % width
        part = px = py = pz = pv = 0.0
        for _ in range(count):
            fx, fy, fz, fv = feature[r, c, 0], feature[r, c, 1], feature[r, c, 2], feature[r, c, 3]
            dx, dy, dz, dv = fx - x, fy - y, fz - z, fv - v
            if dx * dx + dy * dy + dz * dz + dv * dv <= 1.0:
                part += 1.0
                px += fx
                py += fy
                pz += fz
                pv += fv
            c += 1
            if c == width:
                c = 0
        total += weight[r] * part
        sx += weight[r] * px
        sy += weight[r] * py
        sz += weight[r] * pz
        sv += weight[r] * pv
    mean[:] = point
    if total > 0.0:
        mean[0], mean[1], mean[2], mean[3] = sx / total, sy / total, sz / total, sv / total
    return (mean[0] - x) ** 2 + (mean[1] - y) ** 2 + (mean[2] - z) ** 2 + (mean[3] - v) ** 2


@njit(nogil=True, cache=True)
def _climb(feature, size, weight, reach, half_width, steps, tolerance, start, stop, mode):
    mean = np.empty(4)
    for r in range(start, stop):
        for c in range(0, feature.shape[1], size[r]):
            point = mode[r, c]
            point[:] = feature[r, c // size[r]]
            for _ in range(steps):
                moved = _step(point, feature, size, weight, reach, half_width, mean)
                point[:] = mean
                if moved <= tolerance * tolerance:
                    break
            for k in range(c + 1, c + size[r]):
                mode[r, k] = point


def modes(groups: Groups, steps: int = 100, tolerance: float = 1e-3) -> NDArray[np.float64]:
    """Where each cell's climb ends: (h, 2h, 4), direction and value in units of their bandwidths.

    steps, tolerance : a climb ends after so many steps, or with one shorter than this
    """
    mode = np.empty_like(groups.feature)
    for_blocks(
        lambda a, b: _climb(groups.feature, groups.size, groups.weight, groups.reach,
                            groups.half_width, steps, tolerance, a, b, mode),
        len(mode),
        ROWS,
    )  # fmt: skip
    return mode
