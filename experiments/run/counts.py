"""How many lights a budget of rays or of seconds allows.

Costs grow with the number of lights, nearly in proportion, but not quite, and in steps. Rays are
counted, not timed: what was found to be too few and too many closes in on the target like a
secant, on a view of a few per cent of the sub-pixels, and is corrected once on the whole view; the
result is the same on any machine. Seconds are fixed + per_light · count, a line through what a few
counts were seen to cost: part of the work is the same at any count (background, upsampling), the
rest goes with the lights, but lights that face nothing trace no rays. So the line goes through the
costs that lie nearest to what is asked for, and counts are tried in large steps until they are near
enough.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

PROBES = 16
LARGEST_STEP = 8.0
"""Factor by which a count grows at most while nothing was found to be too much."""
TOLERANCE = 0.02
"""The count is corrected where the whole view's rays lie farther off, as a share of the budget."""
MOST_PER_RAY = 64
"""A sampler that traces less than a ray for so many lights asked for has no more to give."""
FEW = 4
"""The first count of lights that is timed. A single one's cost depends too much on where it is."""
STEP = 8
"""A count that is asked for is at most so many times as large as the largest that was tried."""
REACH = 6.0
"""The line is trusted to so many times the difference of the costs that it goes through."""


@dataclass(frozen=True)
class CountRange:
    """Which counts may be asked for: from `least` to `most`."""

    least: int
    most: int

    def clip(self, count: float) -> int:
        return round(min(max(count, self.least), self.most))


def nearest_count(
    cost: Callable[[int], float], target: float, allowed: CountRange, start: float
) -> int:
    """The count whose cost is nearest to the target, the smaller of two equally near."""
    found: dict[int, float] = {}
    low, high = allowed.least - 1, allowed.most + 1  # too little; too much, or not allowed
    count = allowed.clip(start)
    while low < count < high and len(found) < PROBES:
        found[count] = cost(count)
        if found[count] == target:
            break
        if found[count] < target:
            low = count
        else:
            high = count
        count = _between(found, target, low, high)
    return min(found, key=lambda tried: (abs(found[tried] - target), tried))


def _between(found: dict[int, float], target: float, low: int, high: int) -> int:
    """The next count: on the line between both ends, or in proportion where one is known."""
    if low in found and high in found:
        guess = low + (target - found[low]) / (found[high] - found[low]) * (high - low)
    elif low in found:
        growth = target / found[low] if found[low] > 0.0 else LARGEST_STEP
        guess = low * min(growth, LARGEST_STEP)
    else:
        guess = high * target / found[high]
    # Rounded, a guess may fall on an end that was tried; the next one inside is then as good.
    return min(max(round(guess), low + 1), high - 1)


def range_for_rays(budget: float, minimum_count: int) -> CountRange:
    """From the sampler's minimum to what surely is enough."""
    return CountRange(minimum_count, max(minimum_count, round(MOST_PER_RAY * max(budget, 1.0))))


def count_for_rays(
    budget: float, allowed: CountRange, probe: Callable[[int], float], whole: Callable[[int], float]
) -> int:
    """The count whose mean number of rays per sub-pixel is nearest to the budget.

    probe, whole : rays per sub-pixel at a count, on a small view and on the whole one. Both should
        remember what they found: they are asked again.
    """
    count = nearest_count(probe, budget, allowed, budget)
    rays = whole(count)
    if abs(rays - budget) <= TOLERANCE * budget or rays <= 0.0:
        return count
    other = nearest_count(probe, budget * probe(count) / rays, allowed, count)
    if other == count:  # too small a difference for the small view to show
        other = allowed.clip(count + (1 if rays < budget else -1))
    return min((count, other), key=lambda tried: (abs(whole(tried) - budget), tried))


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


def probe(
    cost: Callable[[int], float], seconds: float, allowed: CountRange, first: int = FEW
) -> dict[int, float]:
    """Costs of as few counts as tell at which an image takes `seconds`, from `first` on."""
    costs: dict[int, float] = {}
    count = allowed.clip(first)
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
