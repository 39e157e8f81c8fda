"""Lloyd's relaxation on the sphere, with bounds that leave most points alone in most steps.

Each point keeps an upper bound of the distance to its own centre and a lower bound of that to any
other. While the first is below the second, or below half of the distance between its centre and
the next one, no other centre can be nearer; after a step of the centres the bounds are widened by
the steps. So a step looks at few points again, those near borders, and the result is that of the
plain method. A new centre needs one look at each point.

Source: Lloyd, "Least squares quantization in PCM", IEEE Transactions on Information Theory 28(2),
1982; bounds from Hamerly, "Making k-means even faster", SIAM Data Mining 2010. Distances are
chords.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

SLACK = 1e-12
"""What rounding can add to a distance, more or less; bounds are widened by it."""


@njit(nogil=True, cache=True)
def _distance(a, b):
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(x * x + y * y + z * z)


@njit(nogil=True, cache=True)
def _two_nearest(point, centre, count):
    """The nearest centre, the first of equals, its distance, and that of the second nearest."""
    best, least, second = 0, math.inf, math.inf
    for k in range(count):
        d = _distance(point, centre[k])
        if d < least:
            best, least, second = k, d, least
        elif d < second:
            second = d
    return best, least, second


@njit(nogil=True, cache=True)
def _add(direction, centre, count, label, upper, lower):
    """Let centre number `count`, which has just been written, take the points nearest to it."""
    for p in range(len(direction)):
        d = _distance(direction[p], centre[count])
        if d < upper[p]:
            upper[p] = _distance(direction[p], centre[label[p]]) if count > 0 else math.inf
            if d < upper[p]:
                label[p], upper[p], d = count, d, upper[p]
        lower[p] = min(lower[p], d)


@njit(nogil=True, cache=True)
def _assign(direction, centre, count, apart, label, upper, lower):
    """Give each point the label of its nearest centre; whether any label changed."""
    changed = False
    for p in range(len(direction)):
        safe = max(lower[p], 0.5 * apart[label[p]])
        if upper[p] + SLACK < safe:
            continue
        upper[p] = _distance(direction[p], centre[label[p]])
        if upper[p] + SLACK < safe:
            continue
        best, upper[p], lower[p] = _two_nearest(direction[p], centre, count)
        changed |= best != label[p]
        label[p] = best
    return changed


@njit(nogil=True, cache=True)
def _gaps(centre, count, apart):
    """The distance from each centre to the nearest other one."""
    apart[:count] = math.inf
    for k in range(count):
        for other in range(k):
            d = _distance(centre[k], centre[other])
            apart[k], apart[other] = min(apart[k], d), min(apart[other], d)


@njit(nogil=True, cache=True)
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
            new = moment[k] / length
            step[k] = _distance(new, centre[k])
            centre[k] = new


@njit(nogil=True, cache=True)
def _relax(direction, weight, centre, count, label, upper, lower, tolerance, steps):
    apart, step = np.empty(count), np.empty(count)
    moment = np.empty((count, 3))
    for _ in range(steps):
        _move(direction, weight, centre, count, label, moment, step)
        _gaps(centre, count, apart)
        farthest, settled = step.max(), True
        for k in range(count):
            settled &= step[k] <= tolerance * apart[k]
        for p in range(len(direction)):
            upper[p] += step[label[p]] + SLACK
            lower[p] -= farthest + SLACK
        if not _assign(direction, centre, count, apart, label, upper, lower) or settled:
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
