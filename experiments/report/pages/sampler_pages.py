"""What the page of a sampler says: its module's docstring, its parameters, its results.

A docstring becomes paragraphs, and lists of "name : text" under a heading.
"""

import inspect
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

from markupsafe import Markup, escape

from experiments.report.pages.blocks import inline, slug
from experiments.report.pages.reported import Reported
from experiments.report.publish import PICTURE
from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.style import Looks, family_returned, label_of
from experiments.report.summary import ALIKE, COSTS, rank_column
from experiments.run.sampler_spec import family_of
from samplers import EnvlightError, sampler_class

ENTRY = re.compile(r"^(?P<name>\S[^:]*?) : (?P<text>.*)$")
EXTREMES = 3
"""How many of its best and worst maps a page names."""


def contexts(
    found: Sequence[Reported],
    looks: Looks,
    leagues: dict[str, str],
    cases: list[dict[str, Any]],
    montages: set[str],
    files: dict[str, str],
) -> list[dict[str, Any]]:
    """What the templates read, sampler by sampler; configurations stand with their sampler.

    found : the main run first
    cases : the pages that compare images
    montages : names of the runs of which one is shown
    files : FILE:CLASS of samplers that are not installed, by name
    """
    families: dict[str, set[str]] = {}
    for label in looks:
        families.setdefault(family_of(label), set()).add(label)
    made = []
    for name, labels in families.items():
        headline, docstring = documentation(files.get(name, name))
        own = [one for one in found if one.is_grid and labels & set(one.run.rows["sampler"])]
        made.append({
            "label": name,
            "title": label_of(name),
            "file": f"{slug(name)}.html",
            "color": looks[min(labels)].color,
            "league": family_returned(name) or leagues.get(name, ""),
            "headline": headline,
            "parts": parts_of(docstring),
            "measured": {
                label: identity
                for one in own
                for label, identity in _identities(one).items()
                if label in labels
            },
            "results": [_in_run(one, labels) for one in own if one.ranks],
            "cases": [case for case in cases if labels & case["samplers"]],
            "pictures": [{"run": one.name, "file": PICTURE} for one in own if one.name in montages],
        })  # fmt: skip
    return made


def _identities(one: Reported) -> dict[str, dict[str, Any]]:
    """What determined the samplers of a run at hand, by label."""
    if not one.identities:
        return {}
    keys = one.run.rows.groupby("sampler", sort=True)["key"].first()
    return {str(label): one.identities[key]["sampler"] for label, key in keys.items()}


def _in_run(one: Reported, labels: set[str]) -> dict[str, Any]:
    """A run and what it says of the sampler in its configurations, budget by budget."""
    return {
        "run": one.name,
        "lines": [
            {"label": label, **result_of(result, ranking, label)}
            for result in one.results
            for ranking in result.rankings
            for label in sorted(labels)
            if label in ranking.samplers and ranking.maps
        ],
    }


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


def result_of(result: BudgetResult, ranking: Ranking, label: str) -> dict[str, Any]:
    """Place, error, ratio, and best and worst maps of a sampler in a ranking, as texts."""
    place = ranking.samplers.index(label)
    row = result.table[result.table["sampler"] == label].iloc[0]
    names = [str(name) for name in ranking.per_map.index]
    ranks = ranking.ranks[:, place]
    order = sorted(range(len(names)), key=lambda k: (ranks[k], names[k]))
    named = [(names[k], f"{ranks[k]:.0f}") for k in order]
    metric, alike = ranking.metric, place > 0 and ranking.like_first[place]
    return {
        "budget": result.budget,
        "metric": metric.label,
        "error": f"{row[metric.name]:.{metric.digits}f}",
        "rank": f"{row[rank_column(metric.name)]:.2f}",
        "place": f"{place + 1}{f' {ALIKE}' if alike else ''} of {len(ranking.samplers)}",
        "ratio": row[f"{metric.name}_interval"],
        "costs": [cost.text(cost.times * row[cost.place]) for cost in COSTS],
        "baseline": ranking.baseline,
        "best": named[:EXTREMES],
        "worst": named[: -EXTREMES - 1 : -1],
    }


@dataclass(frozen=True)
class DocPart:
    """kind : "text" (text), "list" (heading text, items) or "code" (text as it stands)"""

    kind: Literal["text", "list", "code"]
    text: Markup
    items: tuple[tuple[Markup, Markup], ...] = ()


def parts_of(docstring: str) -> list[DocPart]:
    """The parts of a docstring in their order."""
    lines = inspect.cleandoc(docstring).splitlines()
    groups = [
        list(group) for filled, group in groupby(lines, lambda line: bool(line.strip())) if filled
    ]
    return [part for group in groups for part in _doc_parts(group)]


def _doc_parts(lines: list[str]) -> list[DocPart]:
    """Unindented lines are a paragraph; what is indented below one is its list, or code."""
    head = [line for line in lines if not line.startswith(" ")]
    body = lines[len(head) :]
    if not body or body != [line for line in lines if line.startswith(" ")]:
        return [DocPart("text", inline(" ".join(line.strip() for line in lines)))]
    title = inline(" ".join(head))
    items = _items(body)
    if items:
        return [DocPart("list", title, items)]
    code = DocPart("code", escape(inspect.cleandoc("\n" + "\n".join(body))))
    return [DocPart("text", title), code] if head else [code]


def _items(lines: list[str]) -> tuple[tuple[Markup, Markup], ...]:
    """Entries "name : text", whose further lines are indented; empty where the first is none."""
    margin = min(len(line) - len(line.lstrip()) for line in lines)
    found: list[tuple[str, list[str]]] = []
    for line in (line[margin:] for line in lines):
        entry = None if line.startswith(" ") else ENTRY.match(line)
        if entry:
            found.append((entry["name"], [entry["text"]]))
        elif found:
            found[-1][1].append(line.strip())
        else:
            return ()
    return tuple((inline(name), inline(" ".join(text))) for name, text in found)
