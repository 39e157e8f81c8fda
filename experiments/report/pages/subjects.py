"""A page per map: a picture of it, who is first under it, its class and features; and a page per
sampler: its module's docstring, its parameters, its results.
"""

import inspect
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from experiments.maps import places
from experiments.maps.classes import without_resolution
from experiments.maps.features import FEATURES, PREFIX
from experiments.maps.poly_haven import SUITES, suite_files
from experiments.maps.sources import EnvironmentSource, find_environments
from experiments.report.pages.markdown import docstring_html, slug, text_table
from experiments.report.pages.pictures import save
from experiments.report.pages.reported import Reported
from experiments.report.parts import counted, listed
from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.style import Looks, family_returned, label_of
from experiments.report.summary import ALIKE, COSTS, rank_column
from experiments.run.sampler_spec import family_of
from samplers import EnvlightError, sampler_class
from samplers.preview import automatic_exposure, encoded, reduced

SUITE = "poly-haven-32"
POLY_HAVEN = "https://polyhaven.com/a/"
UNITS = {"count": "", "degrees": "°", "ratio": "×", "power of the degree": ""}
"""How units are written, where not by their name."""
HEIGHT = 256
"""Rows of a map's picture; maps made from code are made at this size."""
LOSSY: dict[str, Any] = {"format": "WEBP", "quality": 75, "method": 4}
PLACE = "maps/pictures"


def map_classes(found: Sequence[Reported]) -> dict[str, str]:
    """The class of every map of the grids' rows."""
    return {name: group for one in found if one.is_grid for name, group in one.classes.items()}


def map_contexts(
    found: Sequence[Reported], cases: list[dict[str, Any]], thumbnails: dict[str, str]
) -> list[dict[str, Any]]:
    """What the templates read, map by map, class by class.

    cases : the pages that compare images
    thumbnails : pictures of maps, by name, those that there are
    """
    grids, classes = [one for one in found if one.is_grid], map_classes(found)
    made, features = [], _features(grids)
    for name in sorted(classes, key=lambda name: (classes[name], name)):
        own = [case for case in cases if case["environment"] == name]
        made.append({
            "name": name,
            "file": f"{slug(name)}.html",
            "class": classes[name],
            "measured": text_table(_measured(features, name), "measured-table"),
            "source": _source(name),
            "firsts": text_table(_firsts(grids, name), "firsts-table"),
            "cases": own,
            "count": counted(len(own), "picture"),
            "thumbnail": thumbnails.get(name, ""),
        })  # fmt: skip
    return made


def _features(grids: Sequence[Reported]) -> pd.DataFrame:
    """What was measured on each map, from the first run whose rows tell; maps × features."""
    told = [
        one.run.rows[["environment", *columns]].dropna()
        for one in grids
        if (columns := [PREFIX + name for name in FEATURES if PREFIX + name in one.run.rows])
    ]
    every = pd.concat([pd.DataFrame({"environment": []}), *told])
    return every.drop_duplicates("environment").set_index("environment")


def _measured(features: pd.DataFrame, name: str) -> list[dict[str, str]]:
    """The features of a map with their units, and where it stands among all maps."""
    column = f"percentile of {len(features)} maps"
    lines = []
    for feature, value in features.loc[name].items() if name in features.index else ():
        found, values = FEATURES[str(feature).removeprefix(PREFIX)], features[feature]
        below = ((values < value).sum() + 0.5 * (values == value).sum()) / len(values)
        share = found.unit == "share"
        text = (
            f"{100 * value:.3g} %" if share else f"{value:.4g} {UNITS.get(found.unit, found.unit)}"
        )
        lines.append({"what": found.meaning, "value": text.strip(), column: f"{100 * below:.0f}"})
    return lines


def _source(name: str) -> tuple[str, str]:
    """Where a map comes from, and its address where it has one."""
    plain = without_resolution(name)
    if name in places.names():
        return "Made from code by this project.", ""
    if any(plain in suite for suite in SUITES.values()):
        return f"{plain} at Poly Haven, CC0", f"{POLY_HAVEN}{plain}"
    return "", ""


def _firsts(grids: Sequence[Reported], name: str) -> list[dict[str, str]]:
    """Who is first on the map, by run, budget and metric."""
    lines = []
    for one in (one for one in grids if one.ranks and (one.compares or len(grids) == 1)):
        for result in one.results:
            line = {"run": one.name, "budget": result.budget}
            for ranking in result.rankings:
                if name not in ranking.per_map.index:
                    continue
                place = ranking.per_map.index.get_loc(name)
                first = np.flatnonzero(ranking.ranks[place] == 1.0)
                errors = ranking.resolved.loc[name].to_numpy()
                label, digits = ranking.metric.label, ranking.metric.digits
                line[f"first by {label}"] = listed([label_of(ranking.samplers[k]) for k in first])
                line[label] = f"{errors[first[0]]:.{digits}f}"
            if len(line) > 2:
                lines.append(line)
    return lines


def map_sources(names: Iterable[str], folders: Sequence[Path]) -> dict[str, EnvironmentSource]:
    """Where maps are: in folders or files of maps, made from code, or Poly Haven's.

    Raises EnvlightError for a folder without any map.
    """
    files = {one.name: one for place in folders for one in find_environments(str(place), [], 0)}
    found = {name: files.get(name) or _known(name) for name in names}
    return {name: source for name, source in found.items() if source is not None}


def _known(name: str) -> EnvironmentSource | None:
    """A map that needs no folder; None for others."""
    if name in places.names():
        return EnvironmentSource(name, height=HEIGHT)
    try:
        file = suite_files(SUITE).get(without_resolution(name))
    except EnvlightError:  # the suite has not been downloaded
        return None
    return EnvironmentSource(name, str(file)) if file else None


def write_thumbnail(name: str, source: EnvironmentSource, folder: Path) -> str:
    """A small picture of a map; returns its file, relative to the folder."""
    file = f"{PLACE}/{slug(name)}.webp"
    made = source.load() if source.path else places.make(name, HEIGHT, split=1)
    image = reduced(made.radiance, 2 * HEIGHT)
    (folder / file).parent.mkdir(parents=True, exist_ok=True)
    save(encoded(image, automatic_exposure(image)), LOSSY, folder / file)
    return file


EXTREMES = 3
"""How many of its best and worst maps a page names."""


def sampler_contexts(
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
