"""Who won, by how much, how surely, and where not: what tables and plots are made from, and the one
line about a ranking, which a test holds to the rows.

A block of the statistics is a map, its error the mean over scenes, as in Table 1 of Wu 2025: scenes
under one map are not independent. Ranks shown in tables share the better rank of a tie; Friedman's
and Nemenyi's tests, which the critical-difference diagram shows, use mean ranks of ties. Ratios are
geometric means over maps of a sampler's error to that of a fixed baseline, with the 95 % interval
of a bootstrap over the maps. Whether one sampler is better than another is asked of these two
alone (see `metrics.ranking`).

Near the floor. What the reference's own noise leaves open is not ranked: an error of less than
`NEAR` times its floor, both as means over the scenes of a map, counts as `NEAR` times the floor
(`summary.resolved`), for pairs, ranks, firsts and ratios alike. Mean errors are as measured.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.parts import counted, listed
from experiments.report.style import label_of
from experiments.report.summary import (
    ALIKE,
    OVER,
    both_errors,
    compared,
    errors_in,
    interval,
    overspent,
    rank_column,
    summary,
)
from experiments.run.loaded_run import Run
from metrics.ranking import (
    FriedmanTest,
    GeometricRatio,
    Pairs,
    block_ranks,
    compare_pairs,
    critical_difference,
    friedman_test,
    indistinct_groups,
    mean_ranks,
    ratio_to_baseline,
)
from metrics.registry import NEAR, Metric, find_metric, leading_metric

BASELINE = "median-cut"
"""Ratios are to its error; to the best-ranked sampler's where it was not run."""
LEVEL = 0.05
"""p-values of significant differences are not above this."""


@dataclass(frozen=True, eq=False)
class Ranking:
    """One metric at one budget. Samplers stand best mean rank first; who is over it, nowhere.

    per_map : errors as they were measured, maps × samplers; may have no map yet
    resolved : the same as they are ranked, none below `NEAR` times the floor
    ranks : of each sampler on each map, ties sharing the better rank
    test_ranks : mean ranks, ties sharing their mean
    difference : Nemenyi's critical difference; NaN without two samplers and a map
    groups : of samplers that Nemenyi's test does not tell apart
    ratio : to the baseline's error; None where no map has errors that are all positive
    ratio_maps : number of maps behind it
    cases : number of scene × map cases compared
    """

    metric: Metric
    samplers: tuple[str, ...]
    per_map: pd.DataFrame
    resolved: pd.DataFrame
    ranks: NDArray[np.float64]
    test_ranks: NDArray[np.float64]
    difference: float
    friedman: FriedmanTest | None
    groups: tuple[tuple[int, ...], ...]
    ratio: GeometricRatio | None
    ratio_maps: int
    cases: int

    @property
    def maps(self) -> int:
        return len(self.per_map)

    @property
    def winner(self) -> str:
        return self.samplers[0]

    @property
    def leaders(self) -> tuple[str, ...]:
        """Those with the best mean rank: the winner, and whoever shares it."""
        means = self.ranks.mean(axis=0)
        return tuple(s for s, mean in zip(self.samplers, means, strict=True) if mean == means[0])

    @property
    def baseline(self) -> str:
        """The sampler to whose error `ratio` is."""
        return BASELINE if BASELINE in self.samplers else self.winner

    @cached_property
    def pairs(self) -> Pairs:
        """Every sampler against every other, in their order; there has to be a map."""
        return compare_pairs(self.resolved.to_numpy(np.float64))

    @property
    def like_first(self) -> tuple[bool, ...]:
        """Whether a sampler is not significantly different from the winner."""
        if not self.maps:
            return tuple(True for _ in self.samplers)
        return tuple(bool(p > LEVEL) for p in self.pairs.p_value[0])

    @property
    def tied(self) -> tuple[str, ...]:
        """Who is first: the winner, and whoever shares its mean rank or does not differ from it."""
        together = zip(self.samplers, self.like_first, strict=True)
        return tuple(name for name, same in together if same or name in self.leaders)

    @property
    def firsts(self) -> NDArray[np.int64]:
        """On how many maps each sampler is first, alone or shared."""
        return (self.ranks == 1.0).sum(axis=0)

    @property
    def near(self) -> NDArray[np.bool_]:
        """Maps × samplers: whether the error is too near the floor to be ranked among its like."""
        return (self.per_map < self.resolved).to_numpy()


def ranking(rows: pd.DataFrame, metric: Metric, table: pd.DataFrame) -> Ranking:
    """The ranking by one metric of the rows of one budget.

    table : `summary` of the same rows
    """
    others = [rank_column(name) for name in errors_in(rows) if name != metric.name]
    order = table.sort_values([rank_column(metric.name), *others, "sampler"], kind="stable")[
        "sampler"
    ]
    fair = compared(rows)
    over = overspent(fair)
    samplers = tuple(name for name in order if name not in over)
    per_map, ranked = both_errors(fair, metric, samplers)
    errors = ranked.to_numpy(np.float64)
    if not len(errors):
        none = np.empty((0, len(samplers)))
        return Ranking(
            metric, samplers, per_map, ranked, none, np.full(len(samplers), math.nan), math.nan,
            None, (), None, 0, 0,
        )  # fmt: skip
    tests = mean_ranks(errors, "average")
    difference = critical_difference(len(samplers), len(errors)) if len(samplers) > 1 else math.nan
    positive = errors[((errors > 0.0) & np.isfinite(errors)).all(axis=1)]
    base = samplers.index(BASELINE) if BASELINE in samplers else 0
    return Ranking(
        metric, samplers, per_map, ranked, block_ranks(errors), tests, difference,
        friedman_test(errors) if len(samplers) > 2 else None,
        () if math.isnan(difference) else tuple(indistinct_groups(tests, difference)),
        _ratio(positive, base), len(positive),
        len(fair[["scene", "environment"]].drop_duplicates()),
    )  # fmt: skip


def _ratio(errors: NDArray[np.float64], baseline: int) -> GeometricRatio | None:
    return ratio_to_baseline(errors, baseline) if len(errors) else None


@dataclass(frozen=True, eq=False)
class BudgetResult:
    """All that is said about one budget.

    table : the summary with ratios and their intervals
    rankings : one by each ranked metric, the leading one first
    """

    budget: str
    table: pd.DataFrame
    rankings: tuple[Ranking, ...]

    def by(self, metric: str) -> Ranking:
        """The ranking by the metric of this name."""
        return next(one for one in self.rankings if one.metric.name == metric)


@lru_cache(maxsize=2)
def results_of(run: Run) -> list[BudgetResult]:
    """`results` of a run's rows, found once for all sections of its report."""
    return results(run.rows)


def results(rows: pd.DataFrame) -> list[BudgetResult]:
    """One result per budget, smallest budget first."""
    found = []
    for budget, table in summary(rows).groupby("budget", sort=False):
        part = rows[rows["budget"] == budget]
        names = sorted(errors_in(part), key=lambda name: name != leading_metric().name)
        rankings = tuple(ranking(part, find_metric(name), table) for name in names)
        found.append(BudgetResult(str(budget), _extended(table, *rankings), rankings))
    return found


def _extended(table: pd.DataFrame, *rankings: Ranking) -> pd.DataFrame:
    """The summary with the ratio by each metric, its interval, and who is like the first."""
    table = table.set_index("sampler", drop=False)
    for found in rankings:
        names = list(found.samplers)
        nothing = np.full(len(names), math.nan)
        ratio = found.ratio or GeometricRatio(nothing, nothing, nothing)
        for column, values in (("ratio", ratio.ratio), ("low", ratio.low), ("high", ratio.high)):
            table[f"{found.metric.name}_{column}"] = pd.Series(values, index=names)
        intervals = [interval(*one) for one in zip(ratio.ratio, ratio.low, ratio.high, strict=True)]
        table[f"{found.metric.name}_interval"] = pd.Series(intervals, index=names)
        alike = [ALIKE if same else "" for same in (False, *found.like_first[1:])]
        marks = pd.Series(alike, index=names).reindex(table.index, fill_value=OVER)
        table[f"{found.metric.name}_alike"] = marks
        table[f"{found.metric.name}_interval"] = table[f"{found.metric.name}_interval"].fillna("–")
    return table.reset_index(drop=True)


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
