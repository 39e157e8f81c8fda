"""The class of a map: what sort of place it shows, or how strong its contrast is.

Embedded maps know their kind. For photographed maps of the suite poly-haven-32 the list below says
it, made from what they show; the six that Wu 2025 names are a class of their own there. Any other
map is classed by a feature, its contrast: the largest over the mean luminance.
"""

from typing import TYPE_CHECKING

from experiments.maps import places
from experiments.maps.features import PREFIX, contrast
from experiments.maps.sources import EnvironmentSource
from experiments.maps.survey import Survey

if TYPE_CHECKING:
    import pandas as pd

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
CONTRASTS = ((1e2, "contrast below 10²"), (1e4, "contrast 10² to 10⁴"))
STRONGEST = "contrast above 10⁴"
CONTRAST = f"{PREFIX}contrast"
UNKNOWN = "other"


def named_class(name: str) -> str | None:
    """The class of an embedded map or one of the suite, by its name; None for others."""
    if name in places.names():
        return places.kind(name)
    plain = without_resolution(name)
    return next((found for found, maps in PHOTOGRAPHED.items() if plain in maps), None)


def map_class(source: EnvironmentSource) -> str:
    """The class of a map; loads it only where its name says nothing."""
    found = named_class(source.name)
    if found:
        return found
    return contrast_class(contrast(Survey(source.load())))


def contrast_class(contrast: float) -> str:
    """The class of a map whose largest luminance is `contrast` times the mean."""
    return next((name for limit, name in CONTRASTS if contrast < limit), STRONGEST)


def classes_of(rows: "pd.DataFrame") -> dict[str, str]:
    """Classes of the maps in a run's rows, by name; "other" where neither name nor row tells."""
    found = {}
    for name, part in rows.groupby("environment", sort=True):
        told = part[CONTRAST].dropna().to_list() if CONTRAST in part else []
        by_contrast = contrast_class(float(told[0])) if told else UNKNOWN
        found[str(name)] = named_class(str(name)) or by_contrast
    return found


def without_resolution(name: str) -> str:
    """Poly Haven's files end in their resolution, as in red_wall_1k."""
    stem, _, last = name.rpartition("_")
    return stem if last.endswith("k") and last[:-1].isdecimal() else name


def representatives(per_class: int) -> list[str]:
    """Names of the first few embedded maps of every kind, in the catalogue's order."""
    taken: dict[str, list[str]] = {}
    for name in places.names():
        taken.setdefault(places.kind(name), []).append(name)
    return [name for names in taken.values() for name in names[:per_class]]
