"""Where each sampler puts its lights, drawn over each map; made again from the present code.

The lights of every sampler are found anew, at the run's smallest budget and seed 0. What is found
is kept beside the report, named after the sampler's source, its parameters and the map.
"""

import ast
import json
from collections.abc import Callable, Iterable
from dataclasses import astuple, dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from experiments.maps import places as embedded
from experiments.maps.sources import SUFFIXES, EnvironmentSource
from experiments.report.map_picture import Circle, circles, draw_map, statistics
from experiments.report.run_data import RunData
from experiments.run.budget import Budget
from experiments.run.case import environment_identity
from experiments.run.identity import digest, file_digest
from experiments.run.sampler_spec import SamplerSpec
from renderer.image import write_whole
from samplers import DirectionalLights, EnvironmentMap, EnvlightError

WIDTH = 640
QUALITY = 75
VERSION = 2


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
class MapPage:
    """picture : relative to the report's folder; newer : by other code than was measured"""

    name: str
    picture: str
    newer: bool
    facts: dict[str, str]
    plots: tuple[LightPlot, ...]


def write_map_pages(
    data: RunData, folder: Path, places: Iterable[Path], samplers: dict[str, str] | None = None
) -> list[MapPage]:
    """One page's contents per map that can be found.

    places : folders or files to look for maps in, for runs on map files
    samplers : FILE:CLASS of samplers that are not installed, by name
    """
    identities = {}
    for key in data.rows["key"]:
        found = data.identities[key]["case"]["environment"]
        identities[found["name"]] = found
    keys = _one_key_per_sampler(data)
    files = _map_files(places) if any("file" in found for found in identities.values()) else {}
    kept, samplers = _Kept(folder), samplers or {}
    pages = []
    for name in sorted(identities):
        source = _source(identities[name], files)
        if source is not None:
            newer = environment_identity(source) != identities[name]
            pages.append(_page(data, source, newer, keys, kept, samplers))
    kept.remove_others()
    return pages


def recorded_places(data: RunData) -> list[Path]:
    """Where the run's commands say that their maps lie, as far as that is still there."""
    words = [session["command"].split(" ") for session in data.sessions]
    named = [
        Path(following)
        for line in words
        for word, following in pairwise(line)
        if word == "--environments"
    ]
    return [path for path in dict.fromkeys(named) if path.exists()]


def _one_key_per_sampler(data: RunData) -> dict[str, str]:
    rows = data.rows[data.rows["budget"] == data.budgets[0]]
    return dict(rows.groupby("sampler", sort=True)["key"].first())


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


class _Kept:
    """Files in the report's maps/, named after what determines them; made where they are missing.

    What nobody asked for is removed at the end.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "maps"
        self._asked: set[Path] = set()

    def file(self, identity: list[Any], suffix: str, make: Callable[[Path], object]) -> Path:
        path = self._folder / f"{digest([*identity, VERSION])[:16]}{suffix}"
        self._asked.add(path)
        if not path.is_file():
            write_whole(path, make)
        return path

    def values(self, identity: list[Any], make: Callable[[], Any]) -> Any:
        """JSON values, from their file where it is there."""

        def write(path: Path) -> None:
            text = json.dumps(make(), ensure_ascii=False, separators=(",", ":"))
            path.write_text(text, encoding="utf-8")

        return json.loads(self.file(identity, ".json", write).read_text(encoding="utf-8"))

    def remove_others(self) -> None:
        for path in (*self._folder.glob("*.json"), *self._folder.glob("*.webp")):
            if path not in self._asked:
                path.unlink()


def _page(
    data: RunData,
    source: EnvironmentSource,
    newer: bool,
    keys: dict[str, str],
    kept: _Kept,
    samplers: dict[str, str],
) -> MapPage:
    environment = cache(source.load)
    picture = kept.file(
        [environment_identity(source), WIDTH], ".webp", lambda path: _draw(path, environment())
    )
    facts = kept.values([environment_identity(source), "facts"], lambda: statistics(environment()))
    plots = tuple(
        _plot(label, data.identities[key], source, environment, kept, samplers)
        for label, key in keys.items()
    )
    return MapPage(source.name, f"maps/{picture.name}", newer, facts, plots)


def _draw(path: Path, environment: EnvironmentMap) -> None:
    from PIL import Image

    drawn = Image.fromarray(draw_map(environment, DirectionalLights.none()))
    small = drawn.resize((WIDTH, WIDTH // 2), Image.Resampling.BOX)
    small.save(path, "WEBP", quality=QUALITY, method=6)


def stored_spec(identity: dict[str, Any], samplers: dict[str, str]) -> SamplerSpec:
    """The sampler that an identity was written for, with all its parameters."""
    name = identity["name"]
    parameters = {name: ast.literal_eval(text) for name, text in identity["parameters"].items()}
    return SamplerSpec(samplers.get(name, name), tuple(parameters.items()))


def _plot(
    label: str,
    stored: dict[str, Any],
    source: EnvironmentSource,
    environment: Callable[[], EnvironmentMap],
    kept: _Kept,
    samplers: dict[str, str],
) -> LightPlot:
    try:
        spec = stored_spec(stored["sampler"], samplers)
        same = spec.identity == stored["sampler"]
    except (EnvlightError, ValueError, SyntaxError) as error:
        return LightPlot(label, (), f"cannot be drawn by the present code: {error}", True)
    lights = Budget.parse(stored["budget"]).lights

    def find() -> list[tuple[Any, ...]]:
        rng = np.random.default_rng(0)
        return [astuple(c) for c in circles(spec.sampler.prepare(environment(), lights, rng))]

    found = kept.values([spec.identity, environment_identity(source), lights], find)
    return LightPlot(label, tuple(Circle(*values) for values in found), "", not same)
