"""The class of every map in a run's rows: by its name, or else by the contrast that a row tells."""

import pandas as pd

from experiments.maps.classes import contrast_class, named_class
from experiments.maps.features import PREFIX

CONTRAST = f"{PREFIX}contrast"
UNKNOWN = "other"


def classes_of(rows: pd.DataFrame) -> dict[str, str]:
    """Classes by the maps' names; "other" where neither name nor row tells."""
    return {
        str(name): named_class(str(name)) or _by_contrast(part)
        for name, part in rows.groupby("environment", sort=True)
    }


def _by_contrast(part: pd.DataFrame) -> str:
    told = part[CONTRAST].dropna().to_list() if CONTRAST in part else []
    return contrast_class(float(told[0])) if told else UNKNOWN
