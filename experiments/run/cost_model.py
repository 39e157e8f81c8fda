"""What an image costs at so many lights: a line, through what a few counts were seen to cost.

Seconds are fixed + per_light · count. Part of the work is the same at any count (background,
upsampling), the rest goes with the lights, but not quite in proportion: lights that face nothing
trace no rays. So the line goes through the costs that lie nearest to what is asked for, and counts
are tried in large steps until they are near enough.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from experiments.run.count_search import CountRange

FEW = 4
"""The first count that is tried. Of a single light it depends too much where it stands."""
STEP = 8
"""A count that is asked for is at most so many times as large as the largest that was tried."""
REACH = 6.0
"""The line is trusted to so many times the difference of the costs that it goes through."""


@dataclass(frozen=True)
class CostLine:
    """Seconds at a count: fixed + per_light · count."""

    fixed: float
    per_light: float

    @classmethod
    def near(cls, seconds: float, costs: Mapping[int, float]) -> "CostLine":
        """Through the cost that is nearest to `seconds`, and that of the count farthest from it.

        costs : seconds by count. A single one is taken to be in proportion to its count.
        """
        near = min(costs, key=lambda count: (abs(costs[count] - seconds), count))
        far = max(costs, key=lambda count: (abs(count - near), count))
        if far == near:
            return cls(0.0, costs[near] / near)
        # Where noise hides what a light costs, a count more costs nothing.
        slope = max((costs[far] - costs[near]) / (far - near), 0.0)
        return cls(costs[near] - slope * near, slope)

    def seconds(self, count: float) -> float:
        return self.fixed + self.per_light * count

    def count(self, seconds: float) -> float:
        """The count at which an image takes so long; infinite where none does."""
        over = seconds - self.fixed
        return over / self.per_light if self.per_light > 0.0 else math.copysign(math.inf, over)


def count_for(seconds: float, costs: Mapping[int, float], allowed: CountRange) -> int:
    """The allowed count whose cost should be nearest to `seconds`."""
    goal = CostLine.near(seconds, costs).count(seconds)
    return allowed.clip(min(goal, STEP * max(costs)))


def probe(cost: Callable[[int], float], seconds: float, allowed: CountRange) -> dict[int, float]:
    """Costs of as few counts as tell at which an image takes `seconds`."""
    costs: dict[int, float] = {}
    count = allowed.clip(FEW)
    while count not in costs:
        costs[count] = cost(count)
        low, high = min(costs.values()), max(costs.values())
        if len(costs) > 1 and seconds - high <= REACH * (high - low):
            break
        if high > seconds:
            count = allowed.least
        else:
            half = 0.5 * CostLine.near(seconds, costs).count(seconds)
            count = allowed.clip(max(costs) * min(max(half / max(costs), 2.0), STEP))
    return costs
