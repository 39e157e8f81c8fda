"""Words made from rows: sentences about a ranking, each held to the rows by a test.

Every ratio is said with its denominator. Nothing here ranks what lies near the floor that the
references' noise sets, because the ranking itself does not: see `experiments.report.rankings`.
"""

import math
from collections import Counter
from collections.abc import Sequence

from experiments.report.rankings import LEVEL, Loss, Ranking
from metrics.registry import NEAR

MOST_NAMED = 4
TEST = "Wilcoxon's signed-rank test of each pair, Holm's correction"


def verdict(ranking: Ranking) -> str:
    """Who is first, on how many maps, and how the next one compares."""
    name, maps = ranking.metric.label, ranking.maps
    if not maps:
        return f"No map is finished by all samplers yet, so nobody has won by {name}."
    if len(ranking.samplers) == 1:
        return f"{ranking.winner} is the only sampler."
    ranks = ranking.ranks.mean(axis=0)
    leaders = ranking.leaders
    if len(leaders) == len(ranking.samplers):
        return f"By {name} all {len(leaders)} samplers share the mean rank {ranks[0]:.2f}."
    if len(leaders) > 1:
        return (
            f"{listed(leaders)} share the best mean rank by {name}, {ranks[0]:.2f}. "
            f"{_next(ranking, len(leaders))}"
        )
    shared = int(ranking.shared_firsts[0])
    return (
        f"{leaders[0]} has the best mean rank by {name}, {ranks[0]:.2f}, and is first on "
        f"{ranking.firsts[0]} of {counted(maps, 'map')}"
        f"{f', sharing the place on {shared}' if shared else ''}. {_next(ranking, 1)}"
    )


def _next(ranking: Ranking, place: int) -> str:
    rank = ranking.ranks[:, place].mean()
    return f"The next, {ranking.samplers[place]} ({rank:.2f}), {against(ranking, place, 0)}"


def against(ranking: Ranking, one: int, other: int) -> str:
    """How a sampler compares with another, without its name: both by their places."""
    pairs, name = ranking.pairs, ranking.metric.label
    wins, ties, losses = (
        int(counts[one, other]) for counts in (pairs.wins, pairs.ties, pairs.losses)
    )
    counts = (
        f"a smaller {name} on {wins}, an equal one on {ties} and a larger one on {losses} of "
        f"{counted(ranking.maps, 'map')}"
    )
    test = f"p = {pairs.p_value[one, other]:.2g}"
    if ranking.ratio is None:
        return f"has {counts} ({test})."
    ratio, low, high = (
        float(values[one, other]) for values in (pairs.ratio, pairs.low, pairs.high)
    )
    if ranking.maps == 1:
        return f"has {ratio:.2f} times the {name} of {ranking.samplers[other]}."
    return (
        f"has {ratio:.2f} times the {name} of {ranking.samplers[other]} (geometric mean over maps, "
        f"95 % interval {low:.2f} to {high:.2f}): {counts} ({test})."
    )


def doubt(ranking: Ranking) -> str:
    """Who is not told apart from the first; empty where everybody is."""
    if not ranking.maps or len(ranking.samplers) < 2:
        return ""
    names = zip(ranking.samplers[1:], ranking.like_first[1:], strict=True)
    alike = [name for name, same in names if same]
    if not alike:
        return ""
    maps, count = counted(ranking.maps, "map"), len(ranking.samplers)
    # The exact test of n differences has no p below 2 / 2^n; Holm multiplies the least by all.
    surest = min(1.0, math.comb(count, 2) * 2.0 ** (1 - ranking.maps))
    if surest > LEVEL and len(alike) == count - 1:
        return (
            f"{maps} {'is' if ranking.maps == 1 else 'are'} too few to tell any two of {count} "
            f"samplers apart: p is at least {surest:.2g} ({TEST})."
        )
    return (
        f"Over {maps}, {ranking.winner} is not told apart from {listed(alike)} ({TEST}, {LEVEL:g})."
    )


def remarks(ranking: Ranking) -> list[str]:
    """What lies too near the floor to be ranked, and what the ratios leave out."""
    found = []
    near = ranking.near.sum(axis=1)
    several = int((near > 1).sum())
    if near.any():
        found.append(
            f"By {ranking.metric.label}, {int(near.sum())} of {ranking.near.size} mean errors of a "
            f"sampler on a map lie within {NEAR:g}× of what the references' own noise gives; they "
            f"are ranked as {NEAR:g}× that, so that samplers share the place on {several} of "
            f"{counted(ranking.maps, 'map')}."
        )
    left_out = ranking.maps - ranking.ratio_maps
    if left_out:
        found.append(
            f"Ratios leave out {counted(left_out, 'map')} on which a sampler has no error at all."
        )
    return found


def loss_sentence(ranking: Ranking, loss: Loss) -> str:
    """Who is better than the winner on a case, and by how much."""
    name, whose = ranking.metric.label, "its" if len(loss.best) == 1 else "their"
    return (
        f"{listed(loss.best)} {'is' if len(loss.best) == 1 else 'are'} better; {ranking.winner} "
        f"has {'at least ' if loss.bounded else ''}{loss.ratio:.2f} times {whose} {name} "
        f"({loss.error:.{ranking.metric.digits}f} against "
        f"{loss.best_error:.{ranking.metric.digits}f}"
        f"{' on average' if len(loss.best) > 1 else ''})"
    )


def rivals(ranking: Ranking) -> str:
    """Who is first, alone or shared, on how many of the cases that the winner loses."""
    counts = Counter(name for loss in ranking.losses for name in loss.best)
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{name} on {count}" for name, count in ordered)


def listed(names: Sequence[str], most: int = MOST_NAMED) -> str:
    """Names in words, the first `most` of more."""
    more = len(names) - most
    if more > 0:
        return f"{', '.join(names[:most])} and {more} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def counted(count: int, noun: str) -> str:
    """How many, with the noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
