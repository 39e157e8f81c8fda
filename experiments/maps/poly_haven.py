"""Suites of maps from Poly Haven (polyhaven.com, CC0): their names, and where their files lie.

`poly-haven-32` spans suns, overcast skies, nights, interiors, workshops, studios and a forest.
`paper-named-12` holds the maps that the text of Wu, "Efficient environment map rendering based on
decomposition", 2025, names. Nothing here downloads anything: `envlight fetch` does.

A map's file is called ID_RESOLUTION.exr or .hdr, as Poly Haven calls it, or ID.exr or .hdr.
"""

import os
import re
from pathlib import Path

from samplers import EnvlightError

NAMED = "named by Wu 2025"
PHOTOGRAPHED = {
    NAMED: (
        "drachenfels_cellar", "fireplace", "industrial_pipe_and_valve_02", "kiara_1_dawn",
        "neuer_zollhof", "red_wall",
    ),
    "sun": (
        "chinese_garden", "crystal_falls", "pedestrian_overpass", "noon_grass", "snowy_field",
        "spruit_sunrise", "venice_sunset",
    ),
    "overcast": ("aristea_wreck_puresky", "kloppenheim_05", "spree_bank", "potsdamer_platz"),
    "night": ("dikhololo_night", "moonless_golf", "vignaioli_night"),
    "interior": (
        "comfy_cafe", "circus_arena", "dancing_hall", "royal_esplanade", "st_fagans_interior",
        "entrance_hall",
    ),
    "industrial": ("aircraft_workshop_01", "autoshop_01"),
    "studio": ("brown_photostudio_01", "christmas_photo_studio_04", "studio_small_03"),
    "forest": ("phalzer_forest_01",),
}  # fmt: skip
"""The maps of poly-haven-32 by what they show; those that Wu 2025 names are a class."""
SUITES: dict[str, tuple[str, ...]] = {
    "poly-haven-32": tuple(sorted(name for names in PHOTOGRAPHED.values() for name in names)),
    "paper-named-12": (
        "basement_boxing_ring", "blue_photo_studio", "drachenfels_cellar", "factory_yard",
        "fireplace", "industrial_pipe_and_valve_02", "kiara_1_dawn", "lapa",
        "lythwood_lounge", "neuer_zollhof", "pine_attic", "red_wall",
    ),
}  # fmt: skip
FOLDER_VARIABLE = "ENVLIGHT_MAPS"
RESOLUTIONS = ("1k", "2k", "4k", "8k", "16k")
SUFFIXES = (".exr", ".hdr")
"""The better one first: where both are there, it is taken."""
MOST_NAMED = 4
_FILE = re.compile(r"(?P<id>.+?)(?:_(?P<resolution>\d+k))?\.(?:exr|hdr)", re.IGNORECASE)


def maps_folder() -> Path:
    """Where downloaded maps lie: the folder that ENVLIGHT_MAPS names, else the user's own."""
    import platformdirs

    chosen = os.environ.get(FOLDER_VARIABLE)
    return Path(chosen) if chosen else Path(platformdirs.user_data_dir("envlight")) / "maps"


def is_suite(text: str) -> bool:
    """Whether this names a suite: "poly-haven-32", or "poly-haven-32@2k" with the resolution."""
    return text.partition("@")[0] in SUITES


def suite_files(text: str, folder: Path | None = None) -> dict[str, Path]:
    """The files of a suite's maps by id, all of one resolution, in alphabetical order.

    Raises EnvlightError with the command that downloads them where some are missing, and where
    several resolutions are there and none is named.
    """
    suite, at, resolution = text.partition("@")
    if at and resolution not in RESOLUTIONS:
        raise EnvlightError(f"environments '{text}': write {suite}@1k, @2k or @4k")
    folder = folder or maps_folder()
    ids = SUITES[suite]
    files = _files_by_resolution(folder, ids)
    complete = [key for key in sorted(files) if len(files[key]) == len(ids)]
    if resolution:
        complete = [key for key in complete if key == resolution]
    if len(complete) > 1:
        choices = " or ".join(f"{suite}@{key}" for key in complete if key)
        raise EnvlightError(
            f"environments '{suite}': {folder} holds it at several resolutions; write {choices}"
        )
    if not complete:
        most = files.get(resolution, {}) if resolution else max(files.values(), key=len, default={})
        raise EnvlightError(_missing_sentence(suite, resolution, folder, most))
    return {name: files[complete[0]][name] for name in ids}


def _files_by_resolution(folder: Path, ids: tuple[str, ...]) -> dict[str, dict[str, Path]]:
    """Files of the wanted maps by resolution ("" where the name has none) and id."""
    found: dict[str, dict[str, Path]] = {}
    try:
        files = sorted(folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise EnvlightError(
            f"{folder}: cannot be read ({error.strerror}); check the folder, or name another by "
            f"{FOLDER_VARIABLE}"
        ) from error
    for suffix in reversed(SUFFIXES):
        for file in files:
            match = _FILE.fullmatch(file.name)
            if match and match["id"] in ids and file.suffix.lower() == suffix and file.is_file():
                found.setdefault((match["resolution"] or "").lower(), {})[match["id"]] = file
    return found


def _missing_sentence(suite: str, resolution: str, folder: Path, there: dict[str, Path]) -> str:
    missing = [name for name in SUITES[suite] if name not in there]
    more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
    which = "none" if not there else f"{', '.join(missing[:MOST_NAMED])}{more} not"
    command = f"envlight fetch {suite}{f' --resolution {resolution}' if resolution else ''}"
    return (
        f"environments '{suite}': of its {len(SUITES[suite])} maps {which} in {folder}; download "
        f"them by '{command}', or name a folder that holds them by {FOLDER_VARIABLE}"
    )
