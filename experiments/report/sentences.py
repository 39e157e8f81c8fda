"""Words made from rows: the one line about a ranking, held to the rows by a test.

Nothing here ranks what lies near the noise floor of the references, because the ranking itself does
not: see `experiments.report.rankings`. What a table says is not said again.
"""

import math
from collections.abc import Sequence

from experiments.report.rankings import LEVEL, Ranking
from experiments.report.style import label_of
from experiments.report.summary import interval
from metrics.registry import NEAR

MOST_NAMED = 4


def verdict(ranking: Ranking) -> str:
    """Who is first or ties for it, and how the next one compares with the least mean rank."""
    name, maps, samplers = ranking.metric.label, ranking.maps, ranking.samplers
    if not maps:
        return f"No map is finished by all samplers yet: there is no ranking by {name}."
    if len(samplers) == 1:
        return f"{label_of(ranking.winner)} is the only sampler."
    ranks, leaders = ranking.ranks.mean(axis=0), list(map(label_of, ranking.leaders))
    if len(leaders) == len(samplers):
        tie = f"By {name}, all {len(leaders)} samplers tie at the mean rank {ranks[0]:.2f}."
        return " ".join([tie, *_limits(ranking)])
    following = len(leaders)
    first = (
        f"{listed(leaders)} {'has' if following == 1 else 'share'} the least mean rank, "
        f"{ranks[0]:.2f}; against the next, {label_of(samplers[following])} "
        f"({ranks[following]:.2f}): {against(ranking, 0, following)}."
    )
    return " ".join([_significance(ranking), first, *_limits(ranking)])


def against(ranking: Ranking, one: int, other: int) -> str:
    """How a sampler compares with another, both by their places: maps, ratio and test."""
    pairs = ranking.pairs
    wins, ties, losses = (
        int(counts[one, other]) for counts in (pairs.wins, pairs.ties, pairs.losses)
    )
    said = [f"wins {wins}, ties {ties}, loses {losses}"]
    values = [float(table[one, other]) for table in (pairs.ratio, pairs.low, pairs.high)]
    if ranking.ratio is not None:
        lone = ranking.maps == 1
        said.append(f"ratio {f'{values[0]:.2f}' if lone else interval(*values)}")
    return ", ".join([*said, f"p = {pairs.p_value[one, other]:.2g}"])


def _significance(ranking: Ranking) -> str:
    """Who is first, or who ties for it."""
    tied, by = list(map(label_of, ranking.tied)), ranking.metric.label
    count = len(ranking.samplers)
    maps = counted(ranking.maps, "map")
    if len(tied) == 1:
        return f"{tied[0]} is first by {by} over {maps}, significantly different from all others."
    # The exact test of n differences has no p below 2 / 2^n; Holm multiplies the least by all.
    surest = min(1.0, math.comb(count, 2) * 2.0 ** (1 - ranking.maps))
    if surest > LEVEL and len(tied) == count:
        return (
            f"{maps} {'is' if ranking.maps == 1 else 'are'} too few for a significant difference "
            f"by {by} among {count} samplers (p is at least {surest:.2g})."
        )
    return f"{listed(tied)} tie for first by {by} over {maps}: no significant difference."


def _limits(ranking: Ranking) -> list[str]:
    """What ties at the noise floor, and what the ratios leave out."""
    found = []
    if ranking.near.any():
        found.append(
            f"{int(ranking.near.sum())} of {ranking.near.size} errors lie within {NEAR:g}× of the "
            "noise floor and tie there."
        )
    left_out = ranking.maps - ranking.ratio_maps
    if left_out:
        found.append(f"Ratios leave out {counted(left_out, 'map')} on which an error is 0.")
    return found


def listed(names: Sequence[str], most: int = MOST_NAMED) -> str:
    """Names in words, the first `most` of more."""
    more = len(names) - most
    if more > 0:
        return f"{', '.join(names[:most])} and {more} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def counted(count: int, noun: str) -> str:
    """How many, with the noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
