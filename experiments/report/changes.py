"""Two runs side by side: on the cases that both measured, what became better, worse or slower.

A case is a scene under a map at a budget; a measurement's values are means over the seeds that both
runs have. Per sampler and measure (each ranked metric, and seconds to prepare and render) the
geometric mean of the ratio second / first says how much, with the 95 % interval of a bootstrap over
cases, the counts of cases say how often, and Wilcoxon's signed-rank test of the logarithms says
whether it can be chance. One test is made per sampler and measure, so p-values are corrected by
Holm's method within a measure.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.parts import Table
from metrics.ranking import holm, mean_ratio, signed_rank
from metrics.registry import ranked_metrics

CASE = ["scale", "scene", "environment", "budget", "sampler"]
SECONDS = "seconds"
LEVEL = 0.05
SEED = 20_250_102
SAME = 1e-9
"""Relative differences below this are rounding, and count as equal."""
FORMATS = {
    "sampler": "s", "measure": "s", "before": ".4f", "after": ".4f", "ratio": ".3f", "low": ".3f",
    "high": ".3f", "better": "d", "worse": "d", "equal": "d", "p_value": ".2g", "verdict": "s",
}  # fmt: skip
HEADINGS = {
    "before": "first", "after": "second", "ratio": "second / first", "better": "smaller",
    "worse": "larger", "p_value": "p",
}  # fmt: skip


@dataclass(frozen=True)
class Change:
    """One sampler by one measure, a metric's label or seconds.

    ratio, low, high : geometric mean of after / before and its 95 % interval; NaN where no case has
        positive values in both
    better, worse, equal : numbers of cases
    p_value : Wilcoxon's, corrected by Holm's method
    """

    sampler: str
    measure: str
    before: float
    after: float
    ratio: float
    low: float
    high: float
    better: int
    worse: int
    equal: int
    p_value: float

    @property
    def verdict(self) -> str:
        """One word: "better", "worse", "equal", or "unclear" where it may be chance."""
        if self.better == self.worse == 0:
            return "equal"
        if self.p_value > LEVEL or math.isnan(self.ratio) or self.ratio == 1.0:
            return "unclear"
        word = ("faster", "slower") if self.measure == SECONDS else ("better", "worse")
        return word[self.ratio > 1.0]


def changes(first: pd.DataFrame, second: pd.DataFrame) -> tuple[Change, ...]:
    """The changes from the rows of one run to those of another, which share some."""
    keys = [*CASE, "seed"]
    left, right = (_measures(rows).set_index(keys) for rows in (first, second))
    shared = left.index.intersection(right.index)
    names = [name for name in left.columns if name in right]
    left, right = (
        table.loc[shared, names].groupby(level=CASE).mean().sort_index() for table in (left, right)
    )
    made: list[Change] = []
    for name in names:
        found = [
            _change(sampler, name, part[name].to_numpy(), right.loc[part.index, name])
            for sampler, part in left.groupby(level="sampler")
        ]
        corrected = holm([change.p_value for change in found])
        made += [replace(one, p_value=float(p)) for one, p in zip(found, corrected, strict=True)]
    return tuple(made)


def _measures(rows: pd.DataFrame) -> pd.DataFrame:
    """Keys and what is compared, by the labels that are printed."""
    found = rows[[*CASE, "seed"]].copy()
    for metric in ranked_metrics():
        if metric.name in rows:
            found[metric.label] = rows[metric.name]
    found[SECONDS] = rows["seconds_lights"] + rows["seconds_render"]
    return found


def _change(sampler: object, measure: str, before: NDArray, after: pd.Series) -> Change:
    left, right = np.asarray(before, np.float64), after.to_numpy(np.float64)
    same = np.abs(right - left) <= SAME * np.maximum(np.abs(left), np.abs(right))
    positive = (left > 0.0) & (right > 0.0)
    logarithm = np.where(same[positive], 0.0, np.log(right[positive] / left[positive]))
    ratio, low, high = mean_ratio(logarithm, np.random.default_rng(SEED))
    return Change(
        str(sampler),
        measure,
        float(left.mean()),
        float(right.mean()),
        ratio,
        low,
        high,
        int((~same & (right < left)).sum()),
        int((~same & (right > left)).sum()),
        int(same.sum()),
        signed_rank(logarithm),
    )


def change_table(changes: Sequence[Change]) -> Table:
    """A line per sampler and measure."""
    rows = pd.DataFrame([{**vars(change), "verdict": change.verdict} for change in changes])
    return Table("changes", rows, FORMATS, HEADINGS)


def headlines(changes: Sequence[Change]) -> list[str]:
    """What got worse or slower, then what got better or faster; one sentence where nothing did."""
    sure = [c for c in changes if c.verdict not in ("equal", "unclear")]
    sure.sort(key=lambda change: -change.ratio)
    lines = [
        f"{change.sampler}: {change.measure} {change.verdict}, "
        f"{100.0 * (change.ratio - 1.0):+.1f} % (smaller on {change.better}, larger on "
        f"{change.worse} cases, p = {change.p_value:.2g})"
        for change in sure
    ]
    return lines or ["No change that is not likely to be chance."]
