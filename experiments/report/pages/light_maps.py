"""Where each sampler puts its lights, drawn over each map; made again from the present code.

The lights of every sampler are found anew, at the run's smallest budget and seed 0. What is found
is kept among the pages, named after the sampler's source, its parameters and the map.
"""

import ast
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import astuple, dataclass
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from experiments.maps import places as embedded
from experiments.maps.sources import SUFFIXES, EnvironmentSource
from experiments.report.map_picture import Circle, circles, draw_map, statistics
from experiments.report.pages.pictures import Shelf
from experiments.report.pages.reported import Reported
from experiments.run.budget import Budget, sorted_budgets
from experiments.run.case import environment_identity
from experiments.run.identity import digest, file_digest
from experiments.run.sampler_spec import SamplerSpec
from samplers import DirectionalLights, EnvironmentMap, EnvlightError

WIDTH = 640
QUALITY = 75
VERSION = 2
PLACE = "maps/pictures"


@dataclass(frozen=True)
class LightPlot:
    """problem : why there are no circles, or empty; newer : by other code than was measured"""

    sampler: str
    circles: tuple[Circle, ...]
    problem: str
    newer: bool

    @property
    def lights(self) -> list[Circle]:
        return [circle for circle in self.circles if circle.kind != "sample"]

    @property
    def draws(self) -> str:
        """The draws of a distribution as dots of one SVG path."""
        return "".join(f"M{c.x:.0f} {c.y:.0f}h0" for c in self.circles if c.kind == "sample")


@dataclass(frozen=True)
class MapLights:
    """picture : relative to the pages' folder; newer : by other code than was measured"""

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


def asked_of(one: Reported, places: Iterable[Path], files: dict[str, str]) -> Iterator[MapAsked]:
    """The maps of a run at hand that can be found.

    places : folders or files to look for maps in; where there is none, those of the run's commands
    """
    rows = one.run.rows
    found = {one.identities[key]["case"]["environment"]["name"]: key for key in rows["key"]}
    identities = {name: one.identities[key]["case"]["environment"] for name, key in found.items()}
    smallest = sorted_budgets(list(rows["budget"].unique()))[0]
    keys = rows[rows["budget"] == smallest].groupby("sampler", sort=True)["key"].first()
    measured = {str(label): one.identities[key] for label, key in keys.items()}
    of_files = any("file" in identity for identity in identities.values())
    at_hand = _map_files(places or _recorded_places(one.commands)) if of_files else {}
    for name in sorted(identities):
        source = _source(identities[name], at_hand)
        if source is not None:
            newer = environment_identity(source) != identities[name]
            yield MapAsked(source, newer, measured, files)


def _recorded_places(commands: Iterable[str]) -> list[Path]:
    """Where commands say that their maps lie, as far as that is still there."""
    named = [
        Path(following)
        for line in commands
        for word, following in pairwise(line.split(" "))
        if word == "--environments"
    ]
    return [path for path in dict.fromkeys(named) if path.exists()]


def _map_files(places: Iterable[Path]) -> dict[str, Path]:
    """Map files by digest."""
    found = {}
    for place in places:
        files = sorted(place.iterdir()) if place.is_dir() else [place]
        for file in files:
            if file.suffix.lower() in SUFFIXES and file.is_file():
                found[file_digest(file)] = file
    return found


def _source(identity: dict[str, Any], files: dict[str, Path]) -> EnvironmentSource | None:
    if "file" in identity:
        path = files.get(identity["file"])
        if path is None:
            return None
        return EnvironmentSource(identity["name"], str(path), repair=identity["repair"])
    source = EnvironmentSource(identity["name"], height=identity["height"])
    return source if identity["name"] in embedded.names() else None


def find_lights(asked: MapAsked, folder: Path, old: Path) -> MapLights:
    """The map's picture, its facts and the lights of every sampler on it.

    old : the pages' folder before, of which files are taken
    """
    shelf, source = Shelf(folder, old), asked.source
    environment, identity = cache(source.load), environment_identity(source)

    def values(of: list[Any], make: Callable[[], Any]) -> Any:
        """JSON values, from their file where it is there."""

        def write(path: Path) -> None:
            text = json.dumps(make(), ensure_ascii=False, separators=(",", ":"))
            path.write_text(text, encoding="utf-8")

        name = shelf.put(_named(of, ".json"), write)
        return json.loads(shelf.path(name).read_text(encoding="utf-8"))

    picture = shelf.put(_named([identity, WIDTH], ".webp"), lambda path: _draw(path, environment()))
    facts = values([identity, "facts"], lambda: statistics(environment()))
    plots = []
    for label, stored in asked.measured.items():
        try:
            spec = stored_spec(stored["sampler"], asked.files)
            same = spec.identity == stored["sampler"]
        except (EnvlightError, ValueError, SyntaxError) as error:
            problem = f"cannot be drawn by the present code: {error}"
            plots.append(LightPlot(label, (), problem, True))
            continue
        lights = Budget.parse(stored["budget"]).lights
        found = values([spec.identity, identity, lights], partial(_find, spec, lights, environment))
        plots.append(LightPlot(label, tuple(Circle(*one) for one in found), "", not same))
    return MapLights(source.name, picture, asked.newer, facts, tuple(plots))


def _named(of: list[Any], suffix: str) -> str:
    return f"{PLACE}/{digest([*of, VERSION])[:16]}{suffix}"


def _find(
    spec: SamplerSpec, lights: int, environment: Callable[[], EnvironmentMap]
) -> list[tuple[Any, ...]]:
    rng = np.random.default_rng(0)
    return [astuple(one) for one in circles(spec.sampler.prepare(environment(), lights, rng))]


def _draw(path: Path, environment: EnvironmentMap) -> None:
    from PIL import Image

    drawn = Image.fromarray(draw_map(environment, DirectionalLights.none()))
    small = drawn.resize((WIDTH, WIDTH // 2), Image.Resampling.BOX)
    small.save(path, "WEBP", quality=QUALITY, method=4)


def stored_spec(identity: dict[str, Any], samplers: dict[str, str]) -> SamplerSpec:
    """The sampler that an identity was written for, with all its parameters."""
    name = identity["name"]
    parameters = {name: ast.literal_eval(text) for name, text in identity["parameters"].items()}
    return SamplerSpec(samplers.get(name, name), tuple(parameters.items()))
