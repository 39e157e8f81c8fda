"""Lloyd's relaxation on the sphere, with bounds that leave most points alone in most steps.

Each point keeps an upper bound of the distance to its own centre and a lower bound of that to any
other. While the first is below the second, or below half of the distance between its centre and
the next one, no other centre can be nearer; after a step of the centres the bounds are widened by
the steps, of which those of centres far from a cell do not matter. So a step looks at few points
again, those near borders, and compares them with few centres; the result is that of the plain
method. A new centre needs one look at each point.

Source: Lloyd, "Least squares quantization in PCM", IEEE Transactions on Information Theory 28(2),
1982; bounds from Hamerly, "Making k-means even faster", SIAM Data Mining 2010. Distances are
chords.
"""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel

SLACK = 1e-12
"""What rounding can add to a distance, more or less; bounds are widened by it."""


@kernel
def _square(a, i, b, k):
    """The squared distance between row i of a and row k of b."""
    x, y, z = a[i, 0] - b[k, 0], a[i, 1] - b[k, 1], a[i, 2] - b[k, 2]
    return x * x + y * y + z * z


@kernel
def _distance(a, i, b, k):
    return math.sqrt(_square(a, i, b, k))


@kernel
def _two_nearest(direction, p, centre, own, near, nears):
    """Of a centre's neighbours the one nearest to a point, its distance, and the second one's."""
    best, least, second = own, math.inf, math.inf
    for i in range(nears[own]):
        k = near[own, np.uint64(i)]
        square = _square(direction, p, centre, k)
        best = k if square < least else best
        second = min(second, max(least, square))
        least = min(least, square)
    return best, math.sqrt(least), math.sqrt(second)


@kernel
def _add(direction, centre, count, label, upper, lower):
    """Let centre number `count`, which has just been written, take the points nearest to it."""
    for p in range(len(direction)):
        d = _distance(direction, p, centre, count)
        if d < upper[p]:
            upper[p] = _distance(direction, p, centre, label[p]) if count > 0 else math.inf
            if d < upper[p]:
                label[p], upper[p], d = count, d, upper[p]
        lower[p] = min(lower[p], d)


@kernel
def _gaps(centre, count, gap, apart):
    """The distances between centres (count, count), and from each to the nearest other one."""
    apart[:count] = math.inf
    for k in range(count):
        gap[k, k] = 0.0
        for other in range(k):
            d = _distance(centre, k, centre, other)
            gap[k, other] = gap[other, k] = d
            apart[k], apart[other] = min(apart[k], d), min(apart[other], d)


@kernel
def _neighbours(gap, apart, radius, step, near, nears, drift):
    """The centres, in order, that can be nearest or next to a point of each cell, and its own.

    radius : (count,) no point of the cell is farther from its centre
    near, nears : (count, count) and (count,), their lists; drift : (count,) their longest step

    A point at u ≤ radius from its centre has another centre at u + apart or nearer; one beyond
    2 radius + apart of its centre is farther from it than that.
    """
    for k in range(len(apart)):
        nears[k], drift[k] = 0, 0.0
        reach = 2.0 * radius[k] + apart[k] + SLACK
        for other in range(len(apart)):
            if gap[k, other] <= reach:
                near[k, nears[k]] = other
                nears[k] += 1
                if other != k:
                    drift[k] = max(drift[k], step[other])


@kernel
def _assign(direction, centre, apart, near, nears, drift, label, upper, lower):
    """Give each point the label of its nearest centre; whether any label changed."""
    changed = False
    for p in range(np.uint64(len(direction))):
        own = np.uint64(label[p])
        lower[p] -= drift[own] + SLACK
        safe = max(lower[p], 0.5 * apart[own])
        if upper[p] + SLACK < safe:
            continue
        upper[p] = _distance(direction, p, centre, own)
        if upper[p] + SLACK < safe:
            continue
        best, upper[p], lower[p] = _two_nearest(direction, p, centre, own, near, nears)
        changed |= best != own
        label[p] = np.int64(best)
    return changed


@kernel
def _move(direction, weight, centre, count, label, moment, step):
    """Set the centres to the centroids of their points; `step` is how far each went."""
    moment[:count] = 0.0
    for p in range(len(direction)):
        k = label[p]
        moment[k, 0] += weight[p] * direction[p, 0]
        moment[k, 1] += weight[p] * direction[p, 1]
        moment[k, 2] += weight[p] * direction[p, 2]
    for k in range(count):
        length = math.sqrt(moment[k, 0] ** 2 + moment[k, 1] ** 2 + moment[k, 2] ** 2)
        step[k] = 0.0
        if length > 0.0:
            for i in range(3):
                moment[k, i] /= length
            step[k] = _distance(moment, k, centre, k)
            for i in range(3):
                centre[k, i] = moment[k, i]


@kernel
def _relax(direction, weight, centre, count, label, upper, lower, tolerance, steps):
    apart, step, radius, drift = (
        np.empty(count), np.empty(count), np.empty(count), np.empty(count),
    )  # fmt: skip
    near, nears = np.empty((count, count), np.uint64), np.empty(count, np.uint64)
    gap, moment = np.empty((count, count)), np.empty((count, 3))
    for _ in range(steps):
        _move(direction, weight, centre, count, label, moment, step)
        _gaps(centre, count, gap, apart)
        settled = True
        for k in range(count):
            settled &= step[k] <= tolerance * apart[k]
        radius[:] = 0.0
        for p in range(len(direction)):
            upper[p] += step[label[p]] + SLACK
            if upper[p] > radius[label[p]]:
                radius[label[p]] = upper[p]
        _neighbours(gap, apart, radius, step, near, nears, drift)
        changed = _assign(direction, centre, apart, near, nears, drift, label, upper, lower)
        if not changed or settled:
            break


class Relaxation:
    """Centres on the sphere, added one by one, and the weighted points that are nearest to each.

    direction : (n, 3) unit; weight : (n,) positive, of the size of 1
    label : (n,) the nearest of the `count` centres, once there are any
    """

    def __init__(
        self, direction: NDArray[np.float64], weight: NDArray[np.float64], most: int
    ) -> None:
        """most : the number of centres that can be added"""
        self.direction, self.weight, self.count = direction, weight, 0
        self._centre = np.empty((most, 3))
        self.label = np.zeros(len(direction), np.int64)
        self._upper = np.full(len(direction), math.inf)
        self._lower = np.full(len(direction), math.inf)

    @property
    def centre(self) -> NDArray[np.float64]:
        """The centres (count, 3)."""
        return self._centre[: self.count]

    def add(self, direction: NDArray[np.float64]) -> None:
        """Add a centre (3,)."""
        self._centre[self.count] = direction
        _add(self.direction, self._centre, self.count, self.label, self._upper, self._lower)
        self.count += 1

    def relax(self, tolerance: float, steps: int) -> None:
        """Move centres to the centroids of their points and points to the nearest centres.

        tolerance : ends with a step in which no centre went farther than this share of the distance
            to its nearest neighbour, if not because no label changed, or after so many steps
        """
        _relax(self.direction, self.weight, self._centre, self.count, self.label, self._upper,
               self._lower, tolerance, steps)  # fmt: skip
