"""The model of errors: simple enough to be printed, kept as JSON, applied by NumPy alone.

The logarithm of a sampler's error on a map is linear in terms of the map's coordinates z and of the
number of lights: x = log₂ count over its spread, x², each z, z² and z · x. Squares are there, since
a map is easy where a small sun has all of its light and where none of it is concentrated, and hard
between. Ridge regression finds the coefficients: first those of the mean over the samplers, which
says how hard a map is, then those of what each sampler has more or less than that, which decides
between them. Rays are predicted in the same way. How far predictions are off is known from maps
that were left out: `residuals` are the logarithms of the measured over the predicted error on each
measured map, predicted without it. Intervals, and how sure an order is, are read off these.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES
from experiments.questions.advice.coordinates import Frame
from samplers import EnvlightError

Array = NDArray[np.float64]
SURE = 0.8
"""Share of maps whose error lies in the interval."""
FORMAT = 1


PARTS = ("count", "z", "z²", "z × count")
"""Groups of terms, in the order of `design`."""


def design(z: Array, x: Array) -> Array:
    """Terms (n, 2 + 3 f) of coordinates z (n, f) and scaled logarithms of counts x (n,)."""
    x = x[:, None]
    return np.concatenate([x, x * x, z, z * z - 1.0, z * x], axis=1)


def part_of_terms(features: int) -> Array:
    """Which of `PARTS` each term belongs to, (2 + 3 f,)."""
    return np.repeat(np.arange(len(PARTS)), [2, features, features, features])


@dataclass(frozen=True)
class CountScale:
    """Scaled logarithms of counts."""

    centre: float
    spread: float

    @classmethod
    def of(cls, counts: tuple[int, ...]) -> "CountScale":
        found = np.log2(counts)
        return cls(float(found.mean()), float(found.std()) or 1.0)

    def __call__(self, count: Array) -> Array:
        return (np.log2(count) - self.centre) / self.spread


@dataclass(frozen=True, eq=False)
class Regression:
    """ln y of each sampler.

    intercept : (s,); coefficient : (s, 2 + 3 f), of `design`'s terms; 0 for those left out
    """

    intercept: Array
    coefficient: Array

    def __call__(self, z: Array, x: Array) -> Array:
        """ln y (s, n) at the coordinates z (f,) of a map and counts x (n,)."""
        rows = design(np.broadcast_to(z, (len(x), len(z))), x)
        return self.intercept[:, None] + self.coefficient @ rows.T

    def moved(self, z: Array, x: float) -> Array:
        """By how much each coordinate z (…, f) moves ln y from a map with all of them 0, (s, …, f).

        x : scaled logarithm of the count
        """
        size = z.shape[-1]
        shape = (len(self.intercept),) + (1,) * (z.ndim - 1) + (size,)
        linear, square, product = (
            self.coefficient[:, 2 + k * size : 2 + (k + 1) * size].reshape(shape) for k in range(3)
        )
        return np.asarray((linear + x * product) * z + square * z * z)


@dataclass(frozen=True)
class Verdict:
    """What choosing by the model is worth at a budget, on maps that it has not seen.

    metric, league, kind, amount : by what, among whom, and with how much, e.g. 4 rays
    average : who is best on average over all maps
    choice, always, random : geometric mean over maps of the error of the chosen sampler, of whoever
        is best on average over the other maps, and of all in turn, over that of the best one there
    better : whether the choice is better than the average's by more than the standard error
    maps : how many
    """

    metric: str
    league: str
    kind: str
    amount: float
    average: str
    choice: float
    always: float
    random: float
    better: bool
    maps: int


@dataclass(frozen=True, eq=False)
class Model:
    """Errors and rays of samplers on maps.

    labels : what tables call each metric, the leading one last
    samplers, leagues, least : names, what each returns, and the smallest count of each
    counts : the numbers of lights that were measured
    maps, features : the measured maps (m,), and their features (m, f)
    errors : by metric, regressions; rays : of shadow and BRDF rays per sub-pixel
    measured, residuals : by metric, (m, s, c), measured errors, and ln of measured over predicted
        ones, predicted without the map; NaN where nothing was measured
    seconds_lights, seconds_per_ray : (s, c) and (s,), on a machine on which `REFERENCE` takes
        `machine_seconds` for a ray
    verdicts : what a choice is worth, by budget
    source : what it was trained from, in words
    """

    labels: Mapping[str, str]
    samplers: tuple[str, ...]
    leagues: tuple[str, ...]
    least: tuple[int, ...]
    counts: tuple[int, ...]
    maps: tuple[str, ...]
    features: Array
    frame: Frame
    scale: CountScale
    errors: Mapping[str, Regression]
    rays: Regression
    measured: Mapping[str, Array]
    residuals: Mapping[str, Array]
    seconds_lights: Array
    seconds_per_ray: Array
    machine_seconds: float
    verdicts: tuple[Verdict, ...]
    source: Mapping[str, Any]

    def log_errors(self, metric: str, features: Array, counts: Array) -> Array:
        """ln of predicted errors (s, n) on a map of these features (f,) at counts (n,)."""
        return self.errors[metric](self.frame.point(features), self.scale(counts))

    def log_rays(self, features: Array, counts: Array) -> Array:
        """ln of predicted rays per sub-pixel, (s, n)."""
        return self.rays(self.frame.point(features), self.scale(counts))

    def place(self, count: float) -> int:
        """Where among the measured counts the nearest one stands, by ratio."""
        return int(np.abs(np.log(np.array(self.counts) / count)).argmin())

    def interval(self, metric: str, sampler: int, count: float) -> tuple[float, float]:
        """Factors on a predicted error between which `SURE` of the left-out maps lie.

        The quantiles are those of one map more, the one at hand, which may be the most extreme.
        """
        found = self.residuals[metric][:, sampler, self.place(count)]
        found = found[np.isfinite(found)]
        return quantiles(found)

    def sureness(self, metric: str, one: int, other: int, counts: tuple[float, float],
                 gap: float) -> float:  # fmt: skip
        """Share of left-out maps on which a sampler stays before another.

        gap : ln of the predicted error of the other over that of the one; what the measured errors
            of both are off by is added, on each map
        """
        residuals = self.residuals[metric]
        off = residuals[:, other, self.place(counts[1])] - residuals[:, one, self.place(counts[0])]
        off = off[np.isfinite(off)]
        if not len(off):
            return math.nan
        return float((off + gap > 0.0).mean() + 0.5 * (off + gap == 0.0).mean())

    def to_json(self) -> str:
        """The model as text; numbers that are measured have five digits, coefficients seven."""
        content = {
            "format": FORMAT,
            "source": self.source,
            "labels": self.labels,
            "features": list(FEATURES),
            "frame": {name: _list(getattr(self.frame, name), 7) for name in FRAME},
            "count": {"centre": self.scale.centre, "spread": self.scale.spread},
            "counts": self.counts,
            "samplers": [
                {
                    "name": name, "league": league, "least": least,
                    "seconds_lights": _list(self.seconds_lights[k], 5),
                    "seconds_per_ray": _number(self.seconds_per_ray[k], 5),
                }
                for k, (name, league, least) in enumerate(
                    zip(self.samplers, self.leagues, self.least, strict=True)
                )
            ],
            "machine_seconds": _number(self.machine_seconds, 5),
            "errors": {name: _of_regression(found) for name, found in self.errors.items()},
            "rays": _of_regression(self.rays),
            "maps": [
                {
                    "name": name, "features": _list(self.features[k], 5),
                    **{
                        metric: {
                            "error": _list(self.measured[metric][k], 5),
                            "residual": _list(self.residuals[metric][k], 4),
                        }
                        for metric in self.errors
                    },
                }
                for k, name in enumerate(self.maps)
            ],
            "verdicts": [
                {key: _number(value, 5) if isinstance(value, float) else value
                 for key, value in asdict(verdict).items()}
                for verdict in self.verdicts
            ],
        }  # fmt: skip
        return _lines(content)

    @classmethod
    def from_json(cls, text: str) -> "Model":
        """The model of such a text; ValueError, KeyError or TypeError for another text."""
        content = json.loads(text)
        if content["format"] != FORMAT or content["features"] != list(FEATURES):
            raise ValueError("it is of another version")
        samplers, maps = content["samplers"], content["maps"]
        metrics = list(content["errors"])

        def cubes(what: str) -> dict[str, Array]:
            return {name: _array([one[name][what] for one in maps]) for name in metrics}

        return cls(
            content["labels"],
            tuple(one["name"] for one in samplers),
            tuple(one["league"] for one in samplers),
            tuple(one["least"] for one in samplers),
            tuple(content["counts"]),
            tuple(one["name"] for one in maps),
            _array([one["features"] for one in maps]),
            Frame(**{name: _array(content["frame"][name], math.inf) for name in FRAME}),
            CountScale(**content["count"]),
            {name: _regression(found) for name, found in content["errors"].items()},
            _regression(content["rays"]),
            cubes("error"),
            cubes("residual"),
            _array([one["seconds_lights"] for one in samplers]),
            _array([one["seconds_per_ray"] for one in samplers]),
            float(content["machine_seconds"]),
            tuple(Verdict(**one) for one in content["verdicts"]),
            content["source"],
        )


FRAME = ("centre", "spread", "low", "high")


def quantiles(residuals: Array) -> tuple[float, float]:
    """Factors between which `SURE` of errors lie, of n + 1 maps of which n are known."""
    n = len(residuals)
    if n < 2:
        return 0.0, math.inf
    place = ((n + 1) * 0.5 * (1.0 + SURE) - 1.0) / (n - 1)
    low, high = np.quantile(residuals, [max(0.0, 1.0 - place), min(1.0, place)])
    return math.exp(low), math.exp(high)


def load_model(path: Path) -> Model:
    """The model in a file; EnvlightError where there is none."""
    try:
        return Model.from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise EnvlightError(
            f"{path}: cannot be read ({error.strerror}); give a model that envlight train-advice "
            "made"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise EnvlightError(
            f"{path}: it is no model of errors ({error}); make one by envlight train-advice"
        ) from error


def _of_regression(found: Regression) -> dict[str, Any]:
    return {
        "terms": found.terms, "ridge": found.ridge, "intercept": _list(found.intercept, 7),
        "coefficient": _list(found.coefficient, 7),
    }  # fmt: skip


def _regression(content: dict[str, Any]) -> Regression:
    return Regression(
        content["terms"], content["ridge"], _array(content["intercept"]),
        _array(content["coefficient"]),
    )  # fmt: skip


def _number(value: float, digits: int) -> float | None:
    """Rounded to significant digits; None where it is not finite."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


def _list(values: Array, digits: int) -> list[Any]:
    if values.ndim > 1:
        return [_list(row, digits) for row in values]
    return [_number(value, digits) for value in values.tolist()]


def _array(values: list[Any], missing: float = math.nan) -> Array:
    found = np.array(values, object)
    return np.where(found == None, missing, found).astype(np.float64)  # noqa: E711


def _lines(content: dict[str, Any]) -> str:
    """JSON, a line for each entry of the longer lists."""
    parts = []
    for key, value in content.items():
        if key in ("maps", "samplers", "verdicts"):
            rows = ",\n".join(f"  {json.dumps(row, ensure_ascii=False)}" for row in value)
            parts.append(f' "{key}": [\n{rows}\n ]')
        else:
            parts.append(f' "{key}": {json.dumps(value, ensure_ascii=False)}')
    return "{\n" + ",\n".join(parts) + "\n}\n"
