"""What the page of a sampler says: its module's docstring, its parameters, its results.

A docstring becomes paragraphs, and lists of "name : text" under a heading.
"""

import inspect
import re
import sys
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

from markupsafe import Markup, escape

from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.run_data import RunData, slug
from experiments.report.style import Look
from experiments.report.summary import interval, rank_column
from samplers import EnvlightError, sampler_class

ENTRY = re.compile(r"^(?P<name>\S[^:]*?) : (?P<text>.*)$")
EXTREMES = 3
"""How many of its best and worst maps a page names."""


def contexts(
    data: RunData,
    found: list[BudgetResult],
    looks: dict[str, Look],
    files: dict[str, str] | None = None,
) -> list[dict[str, Any]]:
    """What the template of a page reads, per sampler of the run.

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
) -> dict[str, Any]:
    identity = data.identities[key]["sampler"]
    name = identity["name"]
    headline, docstring = documentation(files.get(name, name))
    return {
        "label": label,
        "file": f"{slug(label)}.html",
        "color": looks[label].color,
        "headline": headline,
        "parts": parts_of(docstring),
        "parameters": identity["parameters"],
        "source": identity["source"],
        "results": [
            result_of(result, ranking, label)
            for result in found
            for ranking in result.rankings
            if label in ranking.samplers
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
    metric = ranking.metric
    columns = (f"{metric.name}_{part}" for part in ("ratio", "low", "high"))
    return {
        "budget": result.budget,
        "metric": metric.label,
        "error": f"{row[metric.name]:.{metric.digits}f}",
        "rank": f"{row[rank_column(metric.name)]:.2f}",
        "place": f"{place + 1} of {len(ranking.samplers)}",
        "ratio": interval(*(row[column] for column in columns)),
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


def inline(text: str) -> Markup:
    """Text with `names` as code, and **names** in bold."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    return Markup(re.sub(r"(?<!\w)\*\*([\w-]+)\*\*(?!\w)", r"<strong>\1</strong>", marked))
