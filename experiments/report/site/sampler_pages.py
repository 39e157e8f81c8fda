"""A page per sampler: what it is by its docstring, where it wins, and the pictures that show it."""

from collections.abc import Sequence
from typing import Any

from experiments.report.publish import PICTURE
from experiments.report.run_data import slug
from experiments.report.sampler_pages import documentation, parts_of, result_of
from experiments.report.site.publications import Publication
from experiments.report.style import Look
from experiments.run.sampler_spec import family_of


def contexts(
    ranked: Sequence[Publication],
    looks: dict[str, Look],
    leagues: dict[str, str],
    cases: list[dict[str, Any]],
    montages: set[str],
) -> list[dict[str, Any]]:
    """What the templates read, sampler by sampler; configurations stand with their sampler.

    cases : the pages that compare images
    montages : names of the runs of which one was published
    """
    families: dict[str, list[str]] = {}
    for label in looks:
        families.setdefault(family_of(label), []).append(label)
    return [
        _page(name, labels, ranked, looks, leagues, cases)
        | {
            "pictures": [
                {"run": one.name, "file": PICTURE}
                for one in ranked
                if one.name in montages and set(labels) & set(one.run.rows["sampler"])
            ]
        }
        for name, labels in families.items()
    ]


def _page(
    name: str,
    labels: list[str],
    ranked: Sequence[Publication],
    looks: dict[str, Look],
    leagues: dict[str, str],
    cases: list[dict[str, Any]],
) -> dict[str, Any]:
    headline, docstring = documentation(name)
    results = [_in_run(one, labels) for one in ranked if set(labels) & set(one.run.rows["sampler"])]
    return {
        "label": name,
        "file": f"{slug(name)}.html",
        "color": looks[labels[0]].color,
        "league": leagues.get(name, ""),
        "headline": headline,
        "parts": parts_of(docstring),
        "results": results[:1],
        "others": results[1:],
        "cases": [case for case in cases if set(labels) & set(case["samplers"])],
    }


def _in_run(one: Publication, labels: list[str]) -> dict[str, Any]:
    """A run and what it says of the sampler in its configurations, budget by budget."""
    return {
        "run": one.name,
        "lines": [
            {"label": label, **result_of(result, ranking, label)}
            for result in one.results
            for ranking in result.rankings
            for label in labels
            if label in ranking.samplers and ranking.maps
        ],
    }
