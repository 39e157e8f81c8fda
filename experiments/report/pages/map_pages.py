"""A page per map: a picture of it, who is first under it, its class and features."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps import places
from experiments.maps.classes import without_resolution
from experiments.maps.features import FEATURES, PREFIX
from experiments.maps.poly_haven import SUITES, suite_files
from experiments.maps.sources import EnvironmentSource, find_environments
from experiments.report.pages.markdown import slug, text_table
from experiments.report.pages.pictures import save
from experiments.report.pages.reported import Reported
from experiments.report.sentences import counted, listed
from experiments.report.style import label_of
from samplers import EnvlightError
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


def contexts(
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
    image = reduced(source.load().radiance, 2 * HEIGHT)
    (folder / file).parent.mkdir(parents=True, exist_ok=True)
    save(encoded(image, automatic_exposure(image)), LOSSY, folder / file)
    return file
