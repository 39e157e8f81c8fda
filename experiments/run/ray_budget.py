"""The number of lights at which a sampler traces so many rays per sub-pixel.

It is searched on a view of a few per cent of the sub-pixels, and corrected once on the whole view.
All is counted, nothing is timed: the result is the same on any machine.
"""

from collections.abc import Callable

from experiments.run.count_search import CountRange, nearest_count

TOLERANCE = 0.02
"""The count is corrected where the whole view's rays lie farther off, as a share of the budget."""
MOST_PER_RAY = 64
"""A sampler that traces less than a ray for so many lights asked for has no more to give."""


def range_for_rays(budget: float, minimum_count: int) -> CountRange:
    """From the sampler's minimum to what surely is enough."""
    return CountRange(minimum_count, max(minimum_count, round(MOST_PER_RAY * max(budget, 1.0))))


def count_for_rays(
    budget: float,
    allowed: CountRange,
    probe: Callable[[int], float],
    whole: Callable[[int], float],
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
