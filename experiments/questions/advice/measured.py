"""What was measured on many maps, as arrays and as a JSON file that a person can read.

It is all that `envlight advise` knows: `which_sampler.gathered` makes it from the rows of runs. An
error is that of a map, the mean over scenes after the mean over seeds. Numbers have four digits,
features six; what was not measured is null.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES, PREFIX
from samplers import EnvlightError

Array = NDArray[np.float64]
FORMAT = 2
DIGITS, FEATURE_DIGITS = 4, 6
LEAGUES: dict[str, tuple[str, ...] | None] = {
    "all": None,
    "fixed": ("fixed lights", "layers", "disc lights"),
    "distribution": ("distribution", "distribution that sees the surface"),
}
"""By what may be asked for, what the samplers in it return; None for all."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Means over the scenes and seeds of every map; NaN where nothing was measured.

    maps, samplers, counts : the names along the axes (m), (s), (c); counts rise
    leagues : of the samplers (s), as rows have them
    features : (m, f), in the units of `FEATURES` and their order
    labels : what tables call each metric, the leading one last
    errors : by metric, (m, s, c), positive
    rays : (m, s, c), shadow and BRDF rays per sub-pixel
    seconds_lights : (s, c), to make the lights; seconds_per_ray : (s,), to render; medians
    machine_seconds : for a ray of `which_sampler.REFERENCE`, which tells the machine's speed
    source : what it was gathered from, in words
    """

    maps: tuple[str, ...]
    samplers: tuple[str, ...]
    leagues: tuple[str, ...]
    counts: tuple[int, ...]
    features: Array
    labels: Mapping[str, str]
    errors: Mapping[str, Array]
    rays: Array
    seconds_lights: Array
    seconds_per_ray: Array
    machine_seconds: float
    source: Mapping[str, Any]

    def only(self, kept: NDArray[np.bool_]) -> "Measured":
        """The same with these maps alone; kept : (m,)"""
        return replace(
            self,
            maps=tuple(np.array(self.maps)[kept].tolist()),
            features=self.features[kept],
            errors={name: errors[kept] for name, errors in self.errors.items()},
            rays=self.rays[kept],
        )

    def members(self, league: str) -> list[int]:
        """The places of the samplers in a league of `LEAGUES`."""
        wanted = LEAGUES[league]
        return [k for k, own in enumerate(self.leagues) if wanted is None or own in wanted]

    def log_errors(self, metric: str) -> Array:
        """ln of errors, (m, s, c)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(self.errors[metric]))


def plain(columns: Mapping[str, float]) -> Array:
    """The features of a map (f,), in their order, from columns such as `map_contrast`."""
    return np.array([columns[PREFIX + name] for name in FEATURES])


def to_json(table: Measured) -> str:
    """The table as text, a line for each map and sampler."""
    cubes = {"rays": table.rays, **table.errors}
    content: dict[str, Any] = {
        "format": FORMAT,
        "source": table.source,
        "labels": table.labels,
        "features": list(FEATURES),
        "counts": table.counts,
        "machine_seconds": _rounded(table.machine_seconds),
        "samplers": [
            {
                "name": name,
                "league": table.leagues[k],
                "seconds_lights": _rounded(table.seconds_lights[k]),
                "seconds_per_ray": _rounded(table.seconds_per_ray[k]),
            }
            for k, name in enumerate(table.samplers)
        ],
        "maps": [
            {
                "name": name,
                "features": _rounded(table.features[k], FEATURE_DIGITS),
                **{what: _rounded(cube[k]) for what, cube in cubes.items()},
            }
            for k, name in enumerate(table.maps)
        ],
    }
    parts = []
    for key, value in content.items():
        lines = value if key in ("maps", "samplers") else None
        text = ",\n".join(f"  {_text(one)}" for one in lines) if lines else _text(value)
        parts.append(f' "{key}": ' + (f"[\n{text}\n ]" if lines else text))
    return "{\n" + ",\n".join(parts) + "\n}\n"


def load_measured(path: Path) -> Measured:
    """The table in a file; EnvlightError where there is none."""
    try:
        return _from(json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise EnvlightError(
            f"{path}: cannot be read ({error.strerror}); give a file that envlight advice-table "
            "made"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise EnvlightError(
            f"{path}: it is no table of measured errors ({error}); make one by envlight "
            "advice-table"
        ) from error


def _from(content: Mapping[str, Any]) -> Measured:
    if content["format"] != FORMAT or content["features"] != list(FEATURES):
        raise ValueError("it is of another version")
    samplers, maps = content["samplers"], content["maps"]
    return Measured(
        tuple(one["name"] for one in maps),
        tuple(one["name"] for one in samplers),
        tuple(one["league"] for one in samplers),
        tuple(content["counts"]),
        _array(one["features"] for one in maps),
        content["labels"],
        {name: _array(one[name] for one in maps) for name in content["labels"]},
        _array(one["rays"] for one in maps),
        _array(one["seconds_lights"] for one in samplers),
        _array(one["seconds_per_ray"] for one in samplers),
        float(content["machine_seconds"]),
        content["source"],
    )


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _rounded(values: Any, digits: int = DIGITS) -> Any:
    """Numbers, or lists of lists of them, to so many digits; None where they are not finite."""
    if np.ndim(values):
        return [_rounded(one, digits) for one in values]
    return float(f"{values:.{digits}g}") if math.isfinite(values) else None


def _array(values: Any) -> Array:
    found = np.array(list(values), object)
    return np.where(found == None, math.nan, found).astype(np.float64)  # noqa: E711
