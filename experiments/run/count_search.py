"""The number of lights at which something costs so much, between too few and too many.

Costs grow with the number of lights, nearly in proportion, but not quite, and in steps. What was
found to be too little and too much closes in on the target like a secant, and never by less than
one light.
"""

from collections.abc import Callable
from dataclasses import dataclass

PROBES = 16
LARGEST_STEP = 8.0
"""Factor by which a count grows at most while nothing was found to be too much."""


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
