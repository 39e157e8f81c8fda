"""The class of a map: what sort of place it shows, or how strong its contrast is.

Embedded maps know their kind; photographed maps of the suite poly-haven-32 are listed by it. Any
other map is classed by a feature, its contrast: the largest over the mean luminance.
"""

from typing import TYPE_CHECKING

from experiments.maps import places
from experiments.maps.features import PREFIX
from experiments.maps.poly_haven import PHOTOGRAPHED

if TYPE_CHECKING:
    import pandas as pd

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
