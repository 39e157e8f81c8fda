"""Small pictures of the maps that are at hand: given files, maps made from code, Poly Haven's."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from experiments.maps import places
from experiments.maps.classes import without_resolution
from experiments.maps.poly_haven import suite_files
from experiments.maps.sources import EnvironmentSource, find_environments
from experiments.report.preview import automatic_exposure, encoded
from experiments.report.previews import reduced
from experiments.report.run_data import slug
from renderer.image import write_jpeg
from samplers import EnvlightError

SUITE = "poly-haven-32"
HEIGHT = 128
"""Rows of a picture; maps made from code are made at this size."""


def write_thumbnails(names: Iterable[str], site: Path, folders: Sequence[Path]) -> dict[str, str]:
    """Write what can be shown; returns files, relative to the site's folder, by map.

    folders : in which map files are looked for before all else
    """
    files = _files(folders)
    made: dict[str, str] = {}
    for name in names:
        source = files.get(name) or _known(name)
        if source is not None:
            made[name] = f"maps/pictures/{slug(name)}.jpg"
            (site / made[name]).parent.mkdir(parents=True, exist_ok=True)
            image = reduced(source.load().radiance, 2 * HEIGHT)
            write_jpeg(site / made[name], encoded(image, automatic_exposure(image)))
    return made


def _files(folders: Sequence[Path]) -> dict[str, EnvironmentSource]:
    """The maps in the folders by their names; EnvlightError for a folder without any."""
    return {one.name: one for folder in folders for one in find_environments(str(folder), [], 0)}


def _known(name: str) -> EnvironmentSource | None:
    """A map that needs no folder; None for others."""
    if name in places.names():
        return EnvironmentSource(name, height=HEIGHT)
    try:
        file = suite_files(SUITE).get(without_resolution(name))
    except EnvlightError:  # the suite has not been downloaded
        return None
    return EnvironmentSource(name, str(file)) if file else None
