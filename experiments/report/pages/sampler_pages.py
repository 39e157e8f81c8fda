"""What the page of a sampler says: its module's docstring, its parameters, its results."""

import inspect
import sys
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from experiments.report.pages.markdown import docstring_html, slug, text_table
from experiments.report.pages.reported import Reported
from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.style import Looks, family_returned, label_of
from experiments.report.summary import ALIKE, COSTS, rank_column
from experiments.run.sampler_spec import family_of
from samplers import EnvlightError, sampler_class

EXTREMES = 3
"""How many of its best and worst maps a page names."""


def contexts(
    found: Sequence[Reported], looks: Looks, leagues: dict[str, str], cases: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """What the templates read, sampler by sampler; configurations stand with their sampler.

    found : the main run first
    cases : the pages that compare images
    """
    families: dict[str, set[str]] = {}
    for label in looks:
        families.setdefault(family_of(label), set()).add(label)
    made = []
    for name, labels in families.items():
        headline, docstring = documentation(name)
        own = [one for one in found if one.is_grid and labels & set(one.run.rows["sampler"])]
        made.append({
            "label": name,
            "title": label_of(name),
            "file": f"{slug(name)}.html",
            "color": looks[min(labels)].color,
            "league": family_returned(name) or leagues.get(name, ""),
            "headline": headline,
            "docstring": docstring_html(docstring),
            "results": [(one.name, _in_run(one, name, labels)) for one in own if one.ranks],
            "cases": [case for case in cases if labels & case["samplers"]],
        })  # fmt: skip
    return made


def _in_run(one: Reported, name: str, labels: set[str]) -> Markup:
    """What a run says of the sampler in its configurations, budget by budget."""
    lines = [
        _line(result, ranking, label, name)
        for result in one.results
        for ranking in result.rankings
        for label in sorted(labels)
        if label in ranking.samplers and ranking.maps
    ]
    return text_table(lines, f"in-{slug(one.name)}-table")


def documentation(name: str) -> tuple[str, str]:
    """First line of the class's docstring, and the docstring of its module."""
    try:
        found = sampler_class(name)
    except EnvlightError:
        return "", (
            f"No sampler called `{name}` is installed, so nothing is known about it but its rows."
        )
    own = inspect.cleandoc(found.__doc__ or "")
    docstring = inspect.cleandoc(sys.modules[found.__module__].__doc__ or own)
    return own.partition("\n")[0], docstring


def _line(result: BudgetResult, ranking: Ranking, label: str, name: str) -> dict[str, str]:
    """Place, error, ratio, and best and worst maps of a sampler in a ranking, as texts."""
    place = ranking.samplers.index(label)
    row = result.table[result.table["sampler"] == label].iloc[0]
    ranks = ranking.ranks[:, place]
    order = sorted(zip(ranks, map(str, ranking.per_map.index), strict=True))
    named = [f"{each} ({rank:.0f})" for rank, each in order]
    metric, alike = ranking.metric, place > 0 and ranking.like_first[place]
    return {
        "budget": result.budget,
        "metric": metric.label,
        "configuration": "as it is" if label == name else label,
        "place": f"{place + 1}{f' {ALIKE}' if alike else ''} of {len(ranking.samplers)}",
        "mean error": f"{row[metric.name]:.{metric.digits}f}",
        "mean rank": f"{row[rank_column(metric.name)]:.2f}",
        **{cost.heading: cost.text(cost.times * row[cost.place]) for cost in COSTS},
        f"× {label_of(ranking.baseline)}": row[f"{metric.name}_interval"],
        "best maps (rank)": ", ".join(named[:EXTREMES]),
        "worst maps (rank)": ", ".join(named[: -EXTREMES - 1 : -1]),
    }
