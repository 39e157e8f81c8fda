"""A forest of HEALPix quads while it grows: split where light is, merged where it has gone.

The map is read for leaves. A split quad is the sum of its quarters, up to rounding, and that is
all it takes to order split quads that are far from being merged; where rounding could matter, the
quad itself is read. So the order is that of the map alone, whatever way the forest came about.

Source: Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic environment sequences", EGSR
2005, sections 4 and 5.
"""

import heapq
import math

import numpy as np
from numpy.typing import NDArray

from samplers.environment import LUMINANCE_WEIGHTS
from samplers.grids.quad_map import QuadMap

EPSILON = float(np.finfo(np.float64).eps)

Quad = tuple[int, int, int, int]

BASE: list[Quad] = [(0, face, 0, 0) for face in range(12)]


def children(quad: Quad) -> list[Quad]:
    """The four quarters of a quad (level, face, i, j)."""
    level, face, i, j = quad
    return [(level + 1, face, 2 * i + a, 2 * j + b) for a in (0, 1) for b in (0, 1)]


class QuadForest:
    """Leaves and split quads while they change, each in a heap by importance.

    The order is total: by importance, then by level and place, so that a quad always precedes its
    quarters and the split quads of a finished forest are simply the first in that order.
    """

    def __init__(self, source: QuadMap, power: float, split: list[Quad], leaves: list[Quad]):
        self.source, self.power = source, power
        self.flux: dict[Quad, NDArray[np.float64]] = {}
        self.importance: dict[Quad, float] = {}
        self.split: set[Quad] = set()
        self.leaves: set[Quad] = set()
        self._leaf_heap: list[tuple[float, Quad]] = []
        self._split_heap: list[tuple[float, Quad]] = []
        self._measure(leaves)
        self._add_sums(split, leaves)
        for quad in leaves:
            self._add_leaf(quad)

    def _measure(self, quads: list[Quad]) -> None:
        new = [quad for quad in quads if quad not in self.flux]
        if not new:
            return
        flux = self.source.sums(np.array(new, np.int64))
        for quad, own, luminance in zip(new, flux, flux @ LUMINANCE_WEIGHTS, strict=True):
            self.flux[quad] = own
            self.importance[quad] = self._importance(float(luminance), quad[0])

    def _importance(self, luminance: float, level: int) -> float:
        return luminance * (math.pi / 3.0 / 4.0**level) ** self.power

    def _add_sums(self, split: list[Quad], leaves: list[Quad]) -> None:
        """Add split quads by a lower bound of their importance, the sum of their leaves.

        A quad's integral is a difference of running sums in each row, so it is off by a few
        roundings of what the row holds; over all rows, of the map's flux F: 16 ε F, and rows · ε F
        for adding them up. The sum of m leaves is off by m times as much at most, and the quad's
        own integral by once as much.
        """
        luminance = {quad: float(self.flux[quad] @ LUMINANCE_WEIGHTS) for quad in leaves}
        number = dict.fromkeys(leaves, 1)
        error = (len(self.source.sigma) + 16) * EPSILON * sum(luminance.values())
        for quad in sorted(split, reverse=True):  # quarters before the quads that they make up
            parts = children(quad)
            luminance[quad] = sum(luminance[part] for part in parts)
            number[quad] = sum(number[part] for part in parts)
            least = max(0.0, luminance[quad] - 2.0 * number[quad] * error)
            self.split.add(quad)
            self._push_split(quad, self._importance(least, quad[0]))

    def _add_leaf(self, quad: Quad) -> None:
        self.leaves.add(quad)
        if quad[0] < self.source.deepest_level and self.importance[quad] > 0.0:
            heapq.heappush(self._leaf_heap, (-self.importance[quad], quad))

    def _push_split(self, quad: Quad, importance: float) -> None:
        mirrored = (-quad[0], -quad[1], -quad[2], -quad[3])
        heapq.heappush(self._split_heap, (importance, mirrored))

    def first_leaf(self) -> Quad | None:
        """The most important leaf that can be split and holds light."""
        while self._leaf_heap and self._leaf_heap[0][1] not in self.leaves:
            heapq.heappop(self._leaf_heap)
        return self._leaf_heap[0][1] if self._leaf_heap else None

    def last_split(self) -> Quad | None:
        """The least important split quad; its quarters are leaves."""
        while self._split_heap:
            level, face, i, j = self._split_heap[0][1]
            quad = (-level, -face, -i, -j)
            if quad in self.importance and quad in self.split:
                return quad
            heapq.heappop(self._split_heap)
            if quad in self.split:  # known by a bound only, so far
                self._measure([quad])
                self._push_split(quad, self.importance[quad])
        return None

    def divide(self, quad: Quad) -> None:
        self.leaves.remove(quad)
        parts = children(quad)
        self._measure(parts)
        self.split.add(quad)
        self._push_split(quad, self.importance[quad])
        for part in parts:
            self._add_leaf(part)

    def merge(self, quad: Quad) -> None:
        self.split.remove(quad)
        self.leaves.difference_update(children(quad))
        self._add_leaf(quad)

    def settle(self, splits: int, tolerance: float) -> None:
        """Merge and split until `splits` quads are split, none less important than a leaf."""
        while (last := self.last_split()) is not None and not self.importance[last] > 0.0:
            self.merge(last)
        while (first := self.first_leaf()) is not None:
            last = self.last_split()
            if len(self.split) >= splits:
                if last is None or not self._precedes(first, last, tolerance):
                    return
                self.merge(last)
            self.divide(first)

    def _precedes(self, leaf: Quad, split: Quad, tolerance: float) -> bool:
        gamma, low = self.importance[leaf], self.importance[split]
        if tolerance > 0.0 and gamma - low <= tolerance * gamma:
            return False
        return (-gamma, leaf) < (-low, split)
