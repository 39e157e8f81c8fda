"""A page per map: who is first under it, where lights lie, its pictures, class and features.

The lights of every sampler are found anew by the present code, at the run's smallest budget and
seed 0. What is found is kept among the pages, named after the sampler's source, its parameters and
the map.
"""

import ast
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps import places
from experiments.maps.classes import without_resolution
from experiments.maps.features import FEATURES, PREFIX
from experiments.maps.poly_haven import SUITES, suite_files
from experiments.maps.sources import EnvironmentSource, find_environments
from experiments.report.map_picture import Circle, circles, draw_map, halved, statistics
from experiments.report.pages.markdown import slug, text_table
from experiments.report.pages.pictures import Shelf, save
from experiments.report.pages.reported import Reported
from experiments.report.sentences import counted, listed
from experiments.report.style import label_of
from experiments.run.budget import Budget, sorted_budgets
from experiments.run.case import environment_identity
from experiments.run.identity import digest
from experiments.run.sampler_spec import SamplerSpec
from samplers import DirectionalLights, EnvironmentMap, EnvlightError
from samplers.preview import automatic_exposure, encoded, reduced

SUITE = "poly-haven-32"
POLY_HAVEN = "https://polyhaven.com/a/"
UNITS = {"count": "", "degrees": "°", "ratio": "×", "power of the degree": ""}
"""How units are written, where not by their name."""
HEIGHT = 256
"""Rows of a map's picture; maps made from code are made at this size."""


def map_classes(found: Sequence[Reported]) -> dict[str, str]:
    """The class of every map of the grids' rows."""
    return {name: group for one in found if one.is_grid for name, group in one.classes.items()}


def contexts(
    found: Sequence[Reported],
    cases: list[dict[str, Any]],
    thumbnails: dict[str, str],
    lights: "dict[str, MapLights]",
) -> list[dict[str, Any]]:
    """What the templates read, map by map, class by class.

    cases : the pages that compare images
    thumbnails : pictures of maps, by name, those that there are
    lights : where they lie, by the map's name
    """
    grids, classes = [one for one in found if one.is_grid], map_classes(found)
    made, features = [], _features(grids)
    for name in sorted(classes, key=lambda name: (classes[name], name)):
        own = [case for case in cases if case["environment"] == name]
        there = lights.get(name)
        facts = {key: text for key, text in there.facts.items() if key != "name"} if there else {}
        made.append({
            "name": name,
            "file": f"{slug(name)}.html",
            "class": classes[name],
            "facts": facts,
            "measured": text_table(_measured(features, name), "measured-table"),
            "source": _source(name),
            "firsts": text_table(_firsts(grids, name), "firsts-table"),
            "cases": own,
            "count": counted(len(own), "picture"),
            "lights": there,
            "thumbnail": there.picture if there else thumbnails.get(name, ""),
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


def recorded_places(commands: Iterable[str]) -> list[Path]:
    """Where commands say that their maps lie, as far as that is still there."""
    named = [
        Path(following)
        for line in commands
        for word, following in pairwise(line.split(" "))
        if word == "--environments"
    ]
    return [path for path in dict.fromkeys(named) if path.exists()]


def write_thumbnail(name: str, source: EnvironmentSource, folder: Path) -> str:
    """A small picture of a map; returns its file, relative to the folder."""
    file = f"{PLACE}/{slug(name)}.webp"
    image = reduced(source.load().radiance, 2 * HEIGHT)
    (folder / file).parent.mkdir(parents=True, exist_ok=True)
    save(encoded(image, automatic_exposure(image)), LOSSY, folder / file)
    return file


LOSSY: dict[str, Any] = {"format": "WEBP", "quality": 75, "method": 4}
VERSION = 3
PLACE = "maps/pictures"


@dataclass(frozen=True)
class LightPlot:
    """problem : why there are no circles, or empty"""

    sampler: str
    circles: tuple[Circle, ...]
    problem: str = ""

    @property
    def lights(self) -> list[Circle]:
        return [circle for circle in self.circles if circle.kind != "sample"]

    @property
    def draws(self) -> str:
        """The draws of a distribution as dots of one SVG path."""
        return "".join(f"M{c.x:.0f} {c.y:.0f}h0" for c in self.circles if c.kind == "sample")


@dataclass(frozen=True)
class MapLights:
    """Where lights lie on a map, and its picture, relative to the pages' folder.

    newer : whether the map or a sampler is not what was measured
    """

    name: str
    picture: str
    newer: bool
    facts: dict[str, str]
    plots: tuple[LightPlot, ...]


@dataclass(frozen=True)
class MapAsked:
    """A map on which lights are to be found.

    newer : whether it is not what was measured
    measured : the identity of a measurement of every sampler, by label
    files : FILE:CLASS of samplers that are not installed, by name
    """

    source: EnvironmentSource
    newer: bool
    measured: dict[str, dict[str, Any]]
    files: dict[str, str]


def asked_of(
    one: Reported, sources: Mapping[str, EnvironmentSource], files: dict[str, str]
) -> Iterator[MapAsked]:
    """The maps of a run at hand of which there are sources."""
    rows = one.run.rows
    smallest = sorted_budgets(list(rows["budget"].unique()))[0]
    keys = rows[rows["budget"] == smallest].groupby("sampler", sort=True)["key"].first()
    measured = {str(label): one.identities[key] for label, key in keys.items()}
    for name, key in rows.groupby("environment", sort=True)["key"].first().items():
        identity = one.identities[key]["case"]["environment"]
        if source := sources.get(str(name)):
            source = replace(
                source, height=identity.get("height", 0), repair=identity.get("repair", False)
            )
            yield MapAsked(source, environment_identity(source) != identity, measured, files)


def find_lights(asked: MapAsked, folder: Path, old: Path) -> MapLights:
    """The map's picture, its facts and the lights of every sampler on it.

    old : the pages' folder before, of which files are taken
    """
    shelf, source, newer = Shelf(folder, old), asked.source, asked.newer
    environment, identity = cache(source.load), environment_identity(source)

    def values(of: list[Any], make: Callable[[], Any]) -> Any:
        """JSON values, from their file where it is there."""
        name = shelf.put(_named(of, ".json"), lambda path: path.write_text(json.dumps(make())))
        return json.loads(shelf.path(name).read_text(encoding="utf-8"))

    picture = shelf.put(_named([identity], ".webp"), lambda path: _draw(path, environment()))
    facts = values([identity, "facts"], lambda: statistics(environment()))
    plots = []
    for label, stored in asked.measured.items():
        try:
            spec = stored_spec(stored["sampler"], asked.files)
        except (EnvlightError, ValueError, SyntaxError) as error:
            plots.append(LightPlot(label, (), f"cannot be drawn by the present code: {error}"))
            continue
        newer = newer or spec.identity != stored["sampler"]
        lights = Budget.parse(stored["budget"]).lights
        found = values([spec.identity, identity, lights], partial(_find, spec, lights, environment))
        plots.append(LightPlot(label, tuple(Circle(*one) for one in found)))
    return MapLights(source.name, picture, newer, facts, tuple(plots))


def _named(of: list[Any], suffix: str) -> str:
    return f"{PLACE}/{digest([*of, VERSION])[:16]}{suffix}"


def _find(
    spec: SamplerSpec, lights: int, environment: Callable[[], EnvironmentMap]
) -> list[tuple[Any, ...]]:
    rng = np.random.default_rng(0)
    return [astuple(one) for one in circles(spec.sampler.prepare(environment(), lights, rng))]


def _draw(path: Path, environment: EnvironmentMap) -> None:
    save(halved(draw_map(environment, DirectionalLights.none())), LOSSY, path)


def stored_spec(identity: dict[str, Any], samplers: dict[str, str]) -> SamplerSpec:
    """The sampler that an identity was written for, with all its parameters."""
    name = identity["name"]
    parameters = {name: ast.literal_eval(text) for name, text in identity["parameters"].items()}
    return SamplerSpec(samplers.get(name, name), tuple(parameters.items()))
