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

from samplers.compiled import OPTIONS, kernel
from samplers.threads import for_blocks

ROWS = 8
"""Rows of the grid per block."""
SLOTS = 1 << 16
"""Steps that a thread keeps in mind at most: 4 MiB."""
LANES = 16
"""Groups are looked at so many at a time."""
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
    per_radian : (h,) groups per radian of a row
    feature : (h, 4, 2h + LANES) x, y, z and value of the groups in units of their bandwidths; NaN
        where there is none
    reach : rows above and below that a ball can touch
    half_width : (h, 2 reach + 1) groups to either side in those rows, −1 for none
    """

    size: NDArray[np.int64]
    weight: NDArray[np.float64]
    per_radian: NDArray[np.float64]
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
    feature = np.full((height, 4, 2 * height + LANES), np.nan)
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
    per_radian = height / math.pi / size.astype(np.float64)
    return Groups(size, solid_angle, per_radian, feature, reach, _half_widths(size, angle, reach))


@kernel
def _distance2(a, b):
    dx, dy, dz, dv = b[0] - a[0], b[1] - a[1], b[2] - a[2], b[3] - a[3]
    return dx * dx + dy * dy + dz * dz + dv * dv


@kernel
def _runs(point, size, per_radian, half_width, reach, run):
    """Which groups of the rows nearby a unit ball around `point` can hold: first row, end, seam.

    run : (2 reach + 1, 4) first group and number, and the same of those beyond an end of the row,
        which are at its other end; seam : whether any row has the latter
    """
    height = len(size)
    x, y, z = point[:3]
    row = min(int(math.atan2(math.sqrt(x * x + z * z), y) / (math.pi / height)), height - 1)
    phi = math.atan2(x, -z)
    if phi < 0.0:
        phi += 2.0 * math.pi
    start, stop, seam = max(0, row - reach), min(height, row + reach + 1), False
    for r in range(start, stop):
        half, width = half_width[row, r - row + reach], 2 * height // size[r]
        first, length = int(phi * per_radian[r]) - half, 2 * half + 1
        over = over_length = 0
        if half < 0:
            first = length = 0
        elif length + LANES > width:  # lengthened, it could meet its own other end
            first, length = 0, width
        elif first < 0:
            over, over_length = first + width, -first
            first, length = 0, length + first
        elif first + length > width:
            over_length = first + length - width
            length -= over_length
        seam |= over_length > 0
        run[r - start, 0], run[r - start, 1] = first, length
        run[r - start, 2], run[r - start, 3] = over, over_length
    return start, stop, seam


@njit(**OPTIONS, fastmath={"reassoc", "nsz"})
def _add_runs(point, feature, start, stop, run, k, total):
    """Add to `total` (rows, 4), of each row, the number and sums of x, z and value in the ball.

    The sums are exact, so that their order, which is left to the compiler, changes no bit. A run
    is lengthened to whole LANES: the groups that this adds are out of reach, or are no numbers.
    """
    for i in range(np.uint64(stop - start)):
        row = feature[np.uint64(start) + i]
        y = row[1, 0]
        count = sx = sz = sv = 0.0
        first, length = np.uint64(run[i, k]), np.uint64(run[i, k + 1])
        for c in range((length + np.uint64(LANES - 1)) & ~np.uint64(LANES - 1)):
            x, z, v = row[0, first + c], row[2, first + c], row[3, first + c]
            inside = _distance2(point, (x, y, z, v)) <= 1.0
            count += 1.0 if inside else 0.0
            sx += x if inside else 0.0
            sz += z if inside else 0.0
            sv += v if inside else 0.0
        total[i, 0] += count
        total[i, 1] += sx
        total[i, 2] += sz
        total[i, 3] += sv


@kernel
def _mean(point, feature, size, weight, per_radian, reach, half_width, run, total):
    """The mean of the groups in a unit ball around `point`, a tuple as `point` is."""
    start, stop, seam = _runs(point, size, per_radian, half_width, reach, run)
    total[: stop - start] = 0.0
    _add_runs(point, feature, start, stop, run, 0, total)
    if seam:
        _add_runs(point, feature, start, stop, run, 2, total)
    mass = sx = sy = sz = sv = 0.0
    for i in range(stop - start):
        w, count = weight[start + i], total[i, 0]
        mass += w * count
        sx += w * total[i, 1]
        sy += w * (count * feature[start + i, 1, 0])
        sz += w * total[i, 2]
        sv += w * total[i, 3]
    if mass > 0.0:
        return sx / mass, sy / mass, sz / mass, sv / mass
    return point


@kernel
def _slot(point):
    """One of SLOTS places for the step from a point."""
    mixed = point[0] * 7.1e6 + point[1] * 8.3e6 + point[2] * 9.7e6 + point[3] * 1.1e7
    # What is below 1 may be rounded to it; and a bandwidth of next to nothing leaves no number.
    return np.uint64((mixed - math.floor(mixed)) * SLOTS) & np.uint64(SLOTS - 1)


@kernel
def _climb(
    feature, size, weight, per_radian, reach, half_width, steps, tolerance, start, stop, known, mode
):
    """The modes of rows start … stop; a step that is `known` is not computed again.

    known : (SLOTS, 8) where a step begins and where it ends; not a number where there is none
    """
    run, total = np.empty((2 * reach + 1, 4), np.int64), np.empty((2 * reach + 1, 4))
    for r in range(start, stop):
        for c in range(2 * len(size) // size[r]):
            point = (feature[r, 0, c], feature[r, 1, c], feature[r, 2, c], feature[r, 3, c])
            for _ in range(steps):
                k = _slot(point)
                if (known[k, 0], known[k, 1], known[k, 2], known[k, 3]) != point:
                    known[k, 0], known[k, 1], known[k, 2], known[k, 3] = point
                    mean = _mean(
                        point, feature, size, weight, per_radian, reach, half_width, run, total
                    )
                    known[k, 4], known[k, 5], known[k, 6], known[k, 7] = mean
                start_point = point
                point = (known[k, 4], known[k, 5], known[k, 6], known[k, 7])
                if _distance2(start_point, point) <= tolerance * tolerance:
                    break
            for k in range(c * size[r], (c + 1) * size[r]):
                mode[r, k, 0], mode[r, k, 1], mode[r, k, 2], mode[r, k, 3] = point


def modes(groups: Groups, steps: int = 100, tolerance: float = 1e-3) -> NDArray[np.float64]:
    """Where each cell's climb ends: (h, 2h, 4), direction and value in units of their bandwidths.

    steps, tolerance : a climb ends after so many steps, or with one shorter than this
    """
    height = len(groups.size)
    mode = np.empty((height, 2 * height, 4))
    g = groups
    memories: list[NDArray[np.float64]] = []

    def climb(start: int, stop: int) -> None:
        # A step is the same whoever computed it, so blocks may go on with another's memory.
        try:
            known = memories.pop()
        except IndexError:
            known = np.full((SLOTS, 8), np.nan)
        _climb(
            g.feature, g.size, g.weight, g.per_radian, g.reach, g.half_width,
            steps, tolerance, start, stop, known, mode,
        )  # fmt: skip
        memories.append(known)

    for_blocks(climb, height, ROWS)
    return mode
