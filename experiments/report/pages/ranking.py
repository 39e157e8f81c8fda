"""The rows behind the ranking of the first page, as its scripts read them.

Per budget and metric a table cases × samplers of means over seeds, and what the references' own
noise gives by case; with them the number of seeds, and what an image took. Tables are packed as
base64 of little-endian numbers, errors with all their bits, so that mean errors, ranks and ties
over what a reader chooses come out as they do here. Intervals and tests are not made anew there:
those over everything come along, in the order of the ranking that they are of.
"""

import base64
import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from experiments.report.pages.markdown import slug
from experiments.report.pages.reported import Reported
from experiments.report.rankings import BASELINE, LEVEL, BudgetResult, verdict
from experiments.report.style import Looks, label_of
from experiments.report.summary import (
    COSTS,
    compared,
    errors_in,
    floors_per_case,
    overspent,
    rank_column,
    timed_alike,
)
from experiments.run.budget import Budget, sorted_budgets
from experiments.run.sampler_spec import family_of
from metrics.registry import NEAR, find_metric, leading_metric, ranked_metrics

CASE = ["scene", "environment"]


def constants() -> dict[str, Any]:
    """What the page's ranking shares with those of the reports."""
    return {
        "near": NEAR,
        "level": LEVEL,
        "baseline": BASELINE,
        "leading": leading_metric().name,
        "metrics": {one.name: [one.label, one.digits] for one in ranked_metrics()},
        "costs": [
            {"name": one.name, "heading": one.heading, "digits": int(one.format[1])}
            for one in COSTS
        ],
    }


def entry(one: Reported) -> dict[str, Any]:
    """What the page knows of a run before its rows are read."""
    rows = one.run.rows
    width, height = one.run.size
    budgets = sorted_budgets([str(budget) for budget in rows["budget"].unique()])
    return {
        "name": one.name,
        "file": f"data/{slug(one.name)}.js",
        "title": one.title,
        "size": f"{width}×{height}",
        "pixels": width * height,
        "budgets": budgets,
        "words": {budget: Budget.parse(budget).in_words for budget in budgets},
        "maps": int(rows["environment"].nunique()),
        "samplers": int(rows["sampler"].nunique()),
        "scenes": int(rows["scene"].nunique()),
    }


def script(one: Reported, looks: Looks, leagues: dict[str, str]) -> str:
    """The rows of a run as a script that hands them to the page."""
    text = json.dumps(dataset(one, looks, leagues), ensure_ascii=False, separators=(",", ":"))
    return f"envlight.add({text});\n"


def dataset(one: Reported, looks: Looks, leagues: dict[str, str]) -> dict[str, Any]:
    """The rows of a run; samplers, maps and scenes by name, so that pages order as tables do."""
    rows = one.run.rows
    samplers = sorted(map(str, rows["sampler"].unique()))
    maps = sorted(map(str, rows["environment"].unique()))
    scenes = sorted(map(str, rows["scene"].unique()))
    cases = sorted(set(rows[CASE].itertuples(index=False, name=None)))
    index = pd.MultiIndex.from_tuples(cases, names=CASE)
    published = {result.budget: result for result in one.results}
    return {
        "name": one.name,
        "samplers": samplers,
        "labels": list(map(label_of, samplers)),
        "pages": [slug(family_of(name)) for name in samplers],
        "colors": [looks[name].color for name in samplers],
        "marks": [[looks[name].marker, looks[name].dash] for name in samplers],
        "leagues": [leagues.get(name, "") for name in samplers],
        "maps": maps,
        "classes": [one.classes[name] for name in maps],
        "scenes": scenes,
        "cases": [[scenes.index(scene), maps.index(name)] for scene, name in cases],
        "budgets": [
            _budget(budget, rows[rows["budget"] == budget], index, samplers)
            | {"published": _published(published[budget])}
            for budget in map(str, sorted_budgets(list(rows["budget"].unique())))
        ],
    }


def _published(result: BudgetResult) -> dict[str, Any]:
    """By metric, intervals and tests of a ranking over everything, (samplers × samplers) in its
    order; those of mean ranks (samplers,).
    """
    found = {}
    for ranking in result.rankings:
        told: dict[str, Any] = {"samplers": list(ranking.samplers), "verdict": verdict(ranking)}
        if ranking.maps:
            pairs, rank = ranking.pairs, rank_column(ranking.metric.name)
            table = result.table.set_index("sampler").loc[list(ranking.samplers)]
            tables = {"low": pairs.low, "high": pairs.high, "p": pairs.p_value}
            tables |= {
                "rankLow": table[f"{rank}_low"].to_numpy(),
                "rankHigh": table[f"{rank}_high"].to_numpy(),
            }
            told |= {name: _packed(values, "<f8") for name, values in tables.items()}
        found[ranking.metric.name] = told
    return found


def _budget(
    name: str, rows: pd.DataFrame, cases: pd.MultiIndex, samplers: Iterable[str]
) -> dict[str, Any]:
    def wide(values: pd.Series, table: pd.DataFrame = rows) -> NDArray[np.float64]:
        """Means over seeds, cases × samplers; NaN where there is no row."""
        means = values.groupby([table[column] for column in (*CASE, "sampler")]).mean()
        return means.unstack("sampler").reindex(index=cases, columns=list(samplers)).to_numpy()

    counts = rows.groupby([*CASE, "sampler"]).size().unstack("sampler")
    counts = counts.reindex(index=cases, columns=list(samplers)).fillna(0)
    timed = timed_alike(compared(rows))
    costs = {}
    for cost in COSTS:
        used = timed if cost.timed else rows
        assert cost.of is not None
        costs[cost.name] = _packed(cost.times * wide(cost.of(used), used), "<f4")
    over = overspent(compared(rows))
    return {
        "name": name,
        "counts": _packed(counts.to_numpy(), "u1"),
        "over": [name in over for name in samplers],
        "metrics": {
            metric: {
                "errors": _packed(wide(rows[metric]), "<f8"),
                "floors": _packed(
                    floors_per_case(rows, find_metric(metric)).reindex(cases).to_numpy(), "<f8"
                ),
            }
            for metric in errors_in(rows)
        },
        "costs": costs,
    }


def _packed(values: ArrayLike, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode("ascii")
