"""A page per map: its class and features, who is first under it, and the pictures that show it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps.classes import without_resolution
from experiments.maps.features import PREFIX
from experiments.report.parts import Table
from experiments.report.run_data import slug
from experiments.report.sentences import counted, listed
from experiments.report.site.publications import Publication
from experiments.report.site.report_blocks import table_block
from experiments.report.tables import text_of


def map_classes(found: Sequence[Publication]) -> dict[str, str]:
    """The class of every map on which samplers are ranked."""
    return {name: group for one in found if one.ranks for name, group in one.classes.items()}


def map_names(found: Sequence[Publication]) -> list[str]:
    """Maps on which samplers are ranked, class by class."""
    classes = map_classes(found)
    return sorted(classes, key=lambda name: (classes[name], name))


def contexts(
    found: Sequence[Publication],
    pictures: dict[str, list[str]],
    cases: list[dict[str, Any]],
    thumbnails: dict[str, str],
) -> list[dict[str, Any]]:
    """What the templates read, map by map.

    pictures : published pictures, by the run's name, relative to its folder
    cases : the pages that compare images
    thumbnails : pictures of maps, by name, those that there are
    """
    ranked, classes = [one for one in found if one.ranks], map_classes(found)
    return [
        _context(name, classes[name], ranked, pictures, cases)
        | {"thumbnail": thumbnails.get(name, "")}
        for name in map_names(found)
    ]


def _context(
    name: str,
    group: str,
    ranked: Sequence[Publication],
    pictures: dict[str, list[str]],
    cases: list[dict[str, Any]],
) -> dict[str, Any]:
    own = [case for case in cases if case["environment"] == name]
    published = [
        {"run": run, "file": file, "words": _words(file, name)}
        for run, files in pictures.items()
        for file in files
        if shows(file, name)
    ]
    return {
        "name": name,
        "file": f"{slug(name)}.html",
        "class": group,
        "features": _features(ranked, name),
        "firsts": table_block(text_of(_firsts(ranked, name)), "firsts-table"),
        "pictures": published,
        "cases": own,
        "shown": counted(len(own) + len(published), "picture"),
    }


def shows(file: str, name: str) -> bool:
    """Whether a picture's file is named after a map: between underscores, or its folder's end."""
    stem = Path(file).stem
    return any(f"_{part}_" in f"_{stem}_" for part in {name, without_resolution(name)})


def _words(file: str, name: str) -> str:
    """What else a picture's name says."""
    return " ".join(Path(file).stem.replace(name, " ").replace("_", " ").split())


def _features(ranked: Sequence[Publication], name: str) -> dict[str, str]:
    """What was measured on the map, from the first run whose rows tell."""
    for one in ranked:
        columns = [column for column in map(str, one.run.rows) if column.startswith(PREFIX)]
        rows = one.run.rows.loc[one.run.rows["environment"] == name, columns]
        if columns and len(rows):
            values = rows.iloc[0].dropna()
            return {
                str(column).removeprefix(PREFIX).replace("_", " "): f"{value:.4g}"
                for column, value in values.items()
            }
    return {}


def _firsts(ranked: Sequence[Publication], name: str) -> Table:
    """Who is first on the map, by run, budget and metric."""
    lines = []
    for one in (one for one in ranked if one.compares):
        for result in one.results:
            line: dict[str, Any] = {"run": one.name, "budget": result.budget}
            for ranking in result.rankings:
                if name not in ranking.per_map.index:
                    continue
                place = ranking.per_map.index.get_loc(name)
                first = np.flatnonzero(ranking.ranks[place] == 1.0)
                errors = ranking.resolved.loc[name].to_numpy()
                label, digits = ranking.metric.label, ranking.metric.digits
                line[f"first by {label}"] = listed([ranking.samplers[k] for k in first])
                line[label] = f"{errors[first[0]]:.{digits}f}"
            if len(line) > 2:
                lines.append(line)
    rows = pd.DataFrame(lines)
    return Table("firsts", rows, dict.fromkeys(map(str, rows), "s"))
