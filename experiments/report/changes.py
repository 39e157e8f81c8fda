"""Two runs side by side: on the cases that both measured, what became better, worse or slower.

A case is a scene under a map at a budget; a measurement's values are means over the seeds that both
runs have. Per sampler and measure (each ranked metric, and seconds to prepare and render) the
geometric mean of the ratio second / first says how much, with the 95 % interval of a bootstrap over
cases, the counts of cases say how often, and Wilcoxon's signed-rank test of the logarithms says
whether it can be chance. One test is made per sampler and measure, so p-values are corrected by
Holm's method within a measure.
"""

import math
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from metrics.ranking import holm, mean_ratio, signed_rank
from metrics.registry import ranked_metrics

CASE = ["scale", "scene", "environment", "budget", "sampler"]
SECONDS = "seconds"
LEVEL = 0.05
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


def changes(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """A line per sampler and measure: what became of the rows of one run in those of another.

    ratio, low, high : geometric mean of after / before and its 95 % interval; NaN where no case has
        positive values in both
    better, worse, equal : numbers of cases
    p_value : Wilcoxon's, corrected by Holm's method
    verdict : one word; "unclear" where it may be chance
    """
    keys = [*CASE, "seed"]
    left, right = (_measures(rows).set_index(keys) for rows in (first, second))
    shared = left.index.intersection(right.index)
    names = [name for name in left.columns if name in right]
    left, right = (
        table.loc[shared, names].groupby(level=CASE).mean().sort_index() for table in (left, right)
    )
    made = []
    for name in names:
        parts = left[name].groupby(level="sampler")
        lines = pd.DataFrame(
            [
                {"sampler": sampler, "measure": name, **_change(part, right.loc[part.index, name])}
                for sampler, part in parts
            ]
        )
        made.append(lines.assign(p_value=holm(lines["p_value"])))
    found = pd.concat(made, ignore_index=True)
    return found.assign(verdict=[_verdict(line) for line in found.to_dict("records")])


def _measures(rows: pd.DataFrame) -> pd.DataFrame:
    """Keys and what is compared, by the labels that are printed."""
    found = rows[[*CASE, "seed"]].copy()
    for metric in ranked_metrics():
        if metric.name in rows:
            found[metric.label] = rows[metric.name]
    found[SECONDS] = rows["seconds_lights"] + rows["seconds_render"]
    return found


def _change(before: pd.Series, after: pd.Series) -> dict[str, float]:
    left, right = before.to_numpy(np.float64), after.to_numpy(np.float64)
    same = np.abs(right - left) <= SAME * np.maximum(np.abs(left), np.abs(right))
    positive = (left > 0.0) & (right > 0.0)
    logarithm = np.where(same[positive], 0.0, np.log(right[positive] / left[positive]))
    ratio, low, high = mean_ratio(logarithm)
    return {
        "before": left.mean(),
        "after": right.mean(),
        "ratio": ratio,
        "low": low,
        "high": high,
        "better": int((~same & (right < left)).sum()),
        "worse": int((~same & (right > left)).sum()),
        "equal": int(same.sum()),
        "p_value": signed_rank(logarithm),
    }


def _verdict(line: Mapping[Hashable, Any]) -> str:
    if line["better"] == line["worse"] == 0:
        return "equal"
    if line["p_value"] > LEVEL or math.isnan(line["ratio"]) or line["ratio"] == 1.0:
        return "unclear"
    word = ("faster", "slower") if line["measure"] == SECONDS else ("better", "worse")
    return word[line["ratio"] > 1.0]


def headlines(found: pd.DataFrame) -> list[str]:
    """What got worse or slower, then what got better or faster; one sentence where nothing did."""
    sure = found[~found["verdict"].isin(["equal", "unclear"])]
    lines = [
        f"{one['sampler']}: {one['measure']} {one['verdict']}, "
        f"{100.0 * (one['ratio'] - 1.0):+.1f} % (smaller on {one['better']}, larger on "
        f"{one['worse']} cases, p = {one['p_value']:.2g})"
        for one in sure.sort_values("ratio", ascending=False, kind="stable").to_dict("records")
    ]
    return lines or ["No change that is not likely to be chance."]
