"""Who won, by how much, how surely, and where not: the statistics behind a report's first page.

A case of the rank statistics is a map, its error the mean over scenes, as in Table 1 of the
paper: scenes under one map are not independent. Ranks shown in tables share the better rank of a
tie; the tests use mean ranks of ties. Ratios are geometric means over maps of a sampler's error to
that of a fixed baseline, with the 95 % interval of a bootstrap over the maps (see
`metrics.ranking`).
"""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.summary import compared, errors_in, rank_column, summary
from metrics.ranking import (
    FriedmanTest,
    GeometricRatio,
    block_ranks,
    critical_difference,
    friedman_test,
    indistinct_groups,
    mean_ranks,
    ratio_to_baseline,
)
from metrics.registry import Metric, find_metric, leading_metric

SEED = 20_250_101
BASELINE = "median-cut"
"""Ratios are to its error; to the best-ranked sampler's where it was not run."""


@dataclass(frozen=True)
class Loss:
    """A case on which the winner is not first: ratio = winner's error over that of the best."""

    scene: str
    environment: str
    best: str
    error: float
    best_error: float

    @property
    def ratio(self) -> float:
        return self.error / self.best_error if self.best_error > 0.0 else math.inf


@dataclass(frozen=True, eq=False)
class Ranking:
    """One metric at one budget. Samplers stand best mean rank first.

    per_map : errors, maps × samplers; may have no map yet
    ranks : of each sampler on each map, ties sharing the better rank
    test_ranks : mean ranks, ties sharing their mean
    difference : Nemenyi's critical difference; NaN without two samplers and a map
    ratio : to the baseline's error; None where no map has errors that are all positive
    margin : the same to the winner's error, for sentences about who is ahead of whom
    ratio_maps : number of maps behind both
    losses : worst first; cases : number of scene × map cases compared
    """

    metric: Metric
    samplers: tuple[str, ...]
    per_map: pd.DataFrame
    ranks: NDArray[np.float64]
    test_ranks: NDArray[np.float64]
    difference: float
    friedman: FriedmanTest | None
    groups: tuple[tuple[int, ...], ...]
    ratio: GeometricRatio | None
    margin: GeometricRatio | None
    ratio_maps: int
    losses: tuple[Loss, ...]
    cases: int

    @property
    def winner(self) -> str:
        return self.samplers[0]

    @property
    def baseline(self) -> str:
        """The sampler to whose error `ratio` is."""
        return BASELINE if BASELINE in self.samplers else self.winner

    @property
    def letters(self) -> tuple[str, ...]:
        """Samplers that share a letter are not told apart by their mean ranks."""
        alone = {k for k in range(len(self.samplers)) if not any(k in g for g in self.groups)}
        sets = sorted([*self.groups, *((k,) for k in alone)], key=min)
        marks = ["" for _ in self.samplers]
        for index, members in enumerate(sets):
            for k in members:
                marks[k] += chr(ord("a") + index)
        return tuple(marks)

    @property
    def tied(self) -> tuple[bool, ...]:
        """Whether the mean rank is not told apart from the winner's."""
        if not len(self.test_ranks) or math.isnan(self.difference):
            return tuple(True for _ in self.samplers)
        return tuple(bool(r - self.test_ranks[0] <= self.difference) for r in self.test_ranks)

    @property
    def firsts(self) -> NDArray[np.int64]:
        """On how many maps each sampler is first, alone or shared."""
        return (self.ranks == 1.0).sum(axis=0)


def ranking(rows: pd.DataFrame, metric: Metric, table: pd.DataFrame) -> Ranking:
    """The ranking by one metric of the rows of one budget.

    table : `summary` of the same rows
    """
    others = [rank_column(name) for name in errors_in(rows) if name != metric.name]
    order = table.sort_values([rank_column(metric.name), *others, "sampler"], kind="stable")[
        "sampler"
    ]
    samplers = tuple(order)
    fair = compared(rows)
    cases = fair.groupby(["scene", "environment", "sampler"])[metric.name].mean().unstack("sampler")
    cases = cases.reindex(columns=list(samplers))
    per_map = cases.groupby(level="environment").mean()
    errors = per_map.to_numpy(np.float64)
    if not len(errors):
        none = np.empty((0, len(samplers)))
        return Ranking(
            metric, samplers, per_map, none, np.full(len(samplers), math.nan), math.nan, None,
            (), None, None, 0, (), 0,
        )  # fmt: skip
    tests = mean_ranks(errors, "average")
    difference = critical_difference(len(samplers), len(errors)) if len(samplers) > 1 else math.nan
    positive = errors[((errors > 0.0) & np.isfinite(errors)).all(axis=1)]
    base = samplers.index(BASELINE) if BASELINE in samplers else 0
    return Ranking(
        metric, samplers, per_map, block_ranks(errors), tests, difference,
        friedman_test(errors) if len(samplers) > 2 else None,
        () if math.isnan(difference) else tuple(indistinct_groups(tests, difference)),
        _ratio(positive, base), _ratio(positive, 0), len(positive),
        _losses(cases, samplers[0]), len(cases),
    )  # fmt: skip


def _ratio(errors: NDArray[np.float64], baseline: int) -> GeometricRatio | None:
    return ratio_to_baseline(errors, baseline, np.random.default_rng(SEED)) if len(errors) else None


def _losses(cases: pd.DataFrame, winner: str) -> tuple[Loss, ...]:
    best, least = cases.idxmin(axis=1), cases.min(axis=1)
    lost = []
    for case in cases.index[cases[winner] > least]:
        scene, environment = case
        error = float(cases.loc[case, winner])
        lost.append(Loss(scene, environment, str(best[case]), error, float(least[case])))
    return tuple(sorted(lost, key=lambda loss: (-loss.ratio, loss.scene, loss.environment)))


@dataclass(frozen=True, eq=False)
class BudgetResult:
    """All that is said about one budget.

    table : the summary with ratios, intervals, groups and ties
    rankings : one by each ranked metric, the leading one first
    """

    budget: str
    table: pd.DataFrame
    rankings: tuple[Ranking, ...]

    def by(self, metric: str) -> Ranking:
        """The ranking by the metric of this name."""
        return next(one for one in self.rankings if one.metric.name == metric)


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
    """The summary with ratio, interval, group letters and ties of each measure."""
    table = table.set_index("sampler", drop=False)
    for found in rankings:
        names = list(found.samplers)
        nothing = np.full(len(names), math.nan)
        ratio = found.ratio or GeometricRatio(nothing, nothing, nothing)
        for column, values in (
            ("ratio", ratio.ratio),
            ("low", ratio.low),
            ("high", ratio.high),
            ("group", found.letters),
            ("tied", found.tied),
        ):
            table[f"{found.metric.name}_{column}"] = pd.Series(values, index=names)
    return table.reset_index(drop=True)
