"""Two samplers over maps, such as a reading and the default: ratios of error, wins, words on them.

A case is a map, its error the mean over seeds, then scenes. A ratio is the geometric mean over maps
of a reading's error to the default's, with the 95 % interval of a bootstrap over maps. Over several
budgets of one kind, logarithms are averaged on each map first: budgets on one map are not
independent. An error near what its references' own noise gives counts as 3× that, as in ranks:
where both are, the map is a tie.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
import pandas as pd

from experiments.report.style import label_of
from experiments.report.summary import both_errors, compared, over_budget
from experiments.run.budget import Budget, sorted_budgets
from experiments.run.sampler_spec import family_of
from metrics.ranking import mean_ratio
from metrics.registry import Metric

LEAST_MAPS = 6
"""With fewer, even a win on every map is chance in more than 5 of 100 cases: 2 · 2⁻⁵ > 0.05."""
KINDS = ("lights", "rays", "time")
MARGIN = 0.03
"""A default whose error is larger by more than this share of its own is listed as beaten."""


def geometric(values: pd.Series) -> float:
    """The geometric mean of what is known; NaN where nothing is."""
    return float(np.exp(np.log(values.dropna()).mean()))


@dataclass(frozen=True)
class Ratio:
    """A reading's error over the default's, and on how many of the maps it is smaller, or larger.

    ratio, low, high : NaN without a map
    """

    ratio: float
    low: float
    high: float
    wins: int
    losses: int
    maps: int

    @classmethod
    def of(cls, logs: pd.Series) -> "Ratio":
        """From the logarithm of the ratio on each map."""
        wins, losses = int((logs < 0.0).sum()), int((logs > 0.0).sum())
        return cls(*mean_ratio(logs), wins, losses, len(logs))

    @property
    def text(self) -> str:
        """1.02 [0.98, 1.05]"""
        if math.isnan(self.ratio):
            return "–"
        return f"{self.ratio:.3f} [{self.low:.3f}, {self.high:.3f}]"


@dataclass(frozen=True, eq=False)
class Comparison:
    """A reading beside the default of its sampler, by one metric.

    sampler, reading : labels of what is compared with, and of what is compared
    equal : kind of the budgets, "lights", "rays" or "time"
    error, default_error : means over the compared maps, by budget
    logs : of the ratio, (maps, budgets)
    errors, near : how many are compared, and how many of them count as 3× the noise floor
    size : columns and rows of the images, where runs of several sizes are compared
    """

    sampler: str
    reading: str
    metric: Metric
    equal: str
    error: dict[str, float]
    default_error: dict[str, float]
    logs: pd.DataFrame
    errors: int
    near: int
    size: tuple[int, int] = (0, 0)

    @cached_property
    def ratios(self) -> dict[str, Ratio]:
        """By budget."""
        return {str(budget): Ratio.of(logs.dropna()) for budget, logs in self.logs.items()}

    @cached_property
    def overall(self) -> Ratio:
        """Over all budgets together."""
        return Ratio.of(self.logs.mean(axis=1))

    @property
    def beaten(self) -> bool:
        """Whether the default's error is larger by more than the margin."""
        return self.overall.ratio < 1.0 - MARGIN


def comparisons(
    rows: pd.DataFrame, metric: Metric, baselines: Mapping[str, str] = MappingProxyType({})
) -> Iterator[Comparison]:
    """Every reading for which there is a default, in the order of the rows' samplers, at budgets of
    each kind that both have.

    baselines : of samplers that are a reading of another one, by label
    """
    kinds = rows["budget"].map(lambda text: Budget.parse(text).equal)
    for kind in sorted(set(kinds), key=KINDS.index):
        alike = rows[kinds == kind]
        labels = list(dict.fromkeys(alike["sampler"]))
        for label in labels:
            default = baselines.get(label, family_of(label))
            if label != default and default in labels:
                one = compare(alike, default, label, metric)
                if one.error:
                    yield one


def compare(rows: pd.DataFrame, baseline: str, label: str, metric: Metric) -> Comparison:
    """One sampler beside another, by their labels, at budgets of one kind that neither exceeds."""
    rows = rows[rows["sampler"].isin([baseline, label])]
    error: dict[str, float] = {}
    default: dict[str, float] = {}
    logs: dict[str, pd.Series] = {}
    errors = near = 0
    for budget in sorted_budgets(list(rows["budget"].unique())):
        fair = compared(rows[rows["budget"] == budget])
        if fair["sampler"].nunique() < 2 or over_budget(fair):
            continue
        per_map, told = both_errors(fair, metric, (label, baseline))
        error[budget], default[budget] = (float(per_map[k].mean()) for k in (label, baseline))
        errors += told.size
        near += int((told > per_map).to_numpy().sum())
        told = told[(told > 0.0).all(axis=1)]
        logs[budget] = (told[label] / told[baseline]).map(math.log)
    of = baseline, label, metric, Budget.parse(str(rows["budget"].iloc[0])).equal
    return Comparison(*of, error, default, pd.DataFrame(logs), errors, near)


def deciding(found: list[Comparison], costly: Callable[[str], bool]) -> list[Comparison]:
    """The comparisons that decide: of choices that change what an image costs those at equal time,
    or at equal rays where there are none; of others those at equal lights. Of these the ones in the
    largest images, as the papers' are.

    costly : whether a reading is such a choice, by its label
    """

    def weight(one: Comparison) -> tuple[int, tuple[int, int]]:
        kind = KINDS.index(one.equal)
        return kind if costly(one.reading) else -kind, one.size

    most = {one.reading: weight(one) for one in sorted(found, key=weight)}
    return [one for one in found if weight(one) == most[one.reading]]


def beaten_defaults(
    found: list[Comparison],
    choices: Mapping[str, str],
    ruled_out: Mapping[str, str] = MappingProxyType({}),
) -> list[str]:
    """The defaults that are beaten by more than the margin, or that there is none: the worst first,
    behind them those that stay for a reason.

    choices : in words; ruled_out : why a reading cannot be the default; both by label
    """
    told = [one for one in found if one.overall.maps >= LEAST_MAPS]
    if not told:
        return ["No comparison has enough maps to say anything."]
    budgets = sorted_budgets(list({budget for one in told for budget in one.ratios}))
    settled = {label: f" It stays: {why}." for label, why in ruled_out.items()}
    beaten = (one for one in told if one.beaten)
    worst = sorted(beaten, key=lambda one: (one.reading in settled, one.overall.ratio))
    said = [_beaten(one, choices) + settled.get(one.reading, "") for one in worst]
    if all(one.reading in settled for one in worst):
        said.append(
            f"No {'other ' if said else ''}default of {len(told)} comparisons is beaten by more "
            f"than {100 * MARGIN:.0f} % in the geometric mean over maps and {', '.join(budgets)}."
        )
    return said


def _beaten(one: Comparison, choices: Mapping[str, str]) -> str:
    tie = "; the interval includes a tie" if one.overall.high >= 1.0 else ""
    choice = choices.get(one.reading, label_of(one.reading))
    size = "{}×{}, ".format(*one.size) if any(one.size) else ""
    near = f"; {one.near} of {one.errors} errors lie near the noise floor" if one.near else ""
    cost = next(iter(one.ratios)) if len(one.ratios) == 1 else f"equal {one.equal}"
    how = f"{size}{one.metric.label} × {one.overall.text} at {cost}{tie}{near}"
    return f"{label_of(one.sampler)} is beaten by {choice} ({how})."
