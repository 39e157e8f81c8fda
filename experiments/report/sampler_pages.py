"""What the page of a sampler says: its module's docstring, its parameters, its results."""

import inspect
import sys
from dataclasses import dataclass

from experiments.report.docstring_page import Part, parts_of
from experiments.report.links import slug
from experiments.report.palette import Look
from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.run_data import RunData
from experiments.report.sections.ranks import interval
from experiments.report.summary import rank_column
from samplers import EnvlightError, sampler_class


@dataclass(frozen=True)
class Result:
    """One metric at one budget, as text; best and worst are maps with ranks.

    ratio : of the error to that of `baseline`
    """

    budget: str
    metric: str
    error: str
    rank: str
    place: str
    ratio: str
    baseline: str
    best: list[tuple[str, str]]
    worst: list[tuple[str, str]]


@dataclass(frozen=True)
class SamplerPage:
    """parts : of the docstring; parameters : as measured, values as Python writes them"""

    label: str
    file: str
    color: str
    headline: str
    parts: list[Part]
    parameters: dict[str, str]
    source: str
    results: list[Result]


EXTREMES = 3
"""How many of its best and worst maps a page names."""


def contexts(
    data: RunData,
    found: list[BudgetResult],
    looks: dict[str, Look],
    files: dict[str, str] | None = None,
) -> list[SamplerPage]:
    """One page per sampler of the run.

    files : FILE:CLASS of samplers that are not installed, by name
    """
    keys = data.rows.groupby("sampler", sort=True)["key"].first()
    return [_page(data, found, looks, str(label), key, files or {}) for label, key in keys.items()]


def _page(
    data: RunData,
    found: list[BudgetResult],
    looks: dict[str, Look],
    label: str,
    key: str,
    files: dict[str, str],
) -> SamplerPage:
    identity = data.identities[key]["sampler"]
    name = identity["name"]
    headline, docstring = documentation(files.get(name, name))
    return SamplerPage(
        label,
        f"{slug(label)}.html",
        looks[label].color,
        headline,
        parts_of(docstring),
        identity["parameters"],
        identity["source"],
        [
            _result(result, ranking, label)
            for result in found
            for ranking in result.rankings
            if label in ranking.samplers
        ],
    )


def documentation(name: str) -> tuple[str, str]:
    """First line of the class's docstring, and the docstring of its module."""
    try:
        found = sampler_class(name)
    except EnvlightError:
        return "", (
            f"No sampler called `{name}` is installed, so nothing is known about it. If it stands "
            "in a file, name that by `--samplers FILE:CLASS` when making this report."
        )
    module = sys.modules[found.__module__]
    own = inspect.cleandoc(found.__doc__ or "")
    return own.partition("\n")[0], module.__doc__ or own


def _result(result: BudgetResult, ranking: Ranking, label: str) -> Result:
    place = ranking.samplers.index(label)
    row = result.table[result.table["sampler"] == label].iloc[0]
    names = [str(name) for name in ranking.per_map.index]
    ranks = ranking.ranks[:, place]
    order = sorted(range(len(names)), key=lambda k: (ranks[k], names[k]))
    named = [(names[k], f"{ranks[k]:.0f}") for k in order]
    metric = ranking.metric
    columns = (f"{metric.name}_{part}" for part in ("ratio", "low", "high"))
    return Result(
        result.budget,
        metric.label,
        f"{row[metric.name]:.{metric.digits}f}",
        f"{row[rank_column(metric.name)]:.2f}",
        f"{place + 1} of {len(ranking.samplers)}",
        interval(*(row[column] for column in columns)),
        ranking.baseline,
        named[:EXTREMES],
        named[: -EXTREMES - 1 : -1],
    )
