"""A model of errors as a file: JSON that a person can read, and nothing that runs.

Measured numbers have five digits, coefficients seven, residuals four; what is not finite is null.
"""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES
from experiments.questions.advice.coordinates import Frame
from experiments.questions.advice.model import CountScale, Model, Regression, Verdict
from samplers import EnvlightError

Array = NDArray[np.float64]
FORMAT = 1
FRAME = ("centre", "spread", "low", "high")
REGRESSION = ("knots", "mean", "coefficient")


def to_json(model: Model) -> str:
    """The model as text; numbers that are measured have five digits, coefficients seven."""
    content = {
        "format": FORMAT,
        "source": model.source,
        "labels": model.labels,
        "features": list(FEATURES),
        "frame": {name: _list(getattr(model.frame, name), 7) for name in FRAME},
        "count": {"centre": model.scale.centre, "spread": model.scale.spread},
        "counts": model.counts,
        "samplers": [
            {
                "name": name, "league": league, "least": least,
                "seconds_lights": _list(model.seconds_lights[k], 5),
                "seconds_per_ray": _number(model.seconds_per_ray[k], 5),
            }
            for k, (name, league, least) in enumerate(
                zip(model.samplers, model.leagues, model.least, strict=True)
            )
        ],
        "machine_seconds": _number(model.machine_seconds, 5),
        "margins": model.margins,
        "errors": {name: _of_regression(found) for name, found in model.errors.items()},
        "rays": _of_regression(model.rays),
        "maps": [
            {
                "name": name, "features": _list(model.features[k], 5),
                **{
                    metric: {
                        "error": _list(model.measured[metric][k], 5),
                        "residual": _list(model.residuals[metric][k], 4),
                    }
                    for metric in model.errors
                },
            }
            for k, name in enumerate(model.maps)
        ],
        "verdicts": [
            {key: _number(value, 5) if isinstance(value, float) else value
             for key, value in asdict(verdict).items()}
            for verdict in model.verdicts
        ],
    }  # fmt: skip
    return _lines(content)


def from_json(text: str) -> Model:
    """The model of such a text; ValueError, KeyError or TypeError for another text."""
    content = json.loads(text)
    if content["format"] != FORMAT or content["features"] != list(FEATURES):
        raise ValueError("it is of another version")
    samplers, maps = content["samplers"], content["maps"]
    metrics = list(content["errors"])

    def cubes(what: str) -> dict[str, Array]:
        return {name: _array([one[name][what] for one in maps]) for name in metrics}

    return Model(
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
        content["margins"],
        tuple(Verdict(**one) for one in content["verdicts"]),
        content["source"],
    )


def load_model(path: Path) -> Model:
    """The model in a file; EnvlightError where there is none."""
    try:
        return from_json(path.read_text(encoding="utf-8"))
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
    return {name: _list(getattr(found, name), 7) for name in REGRESSION}


def _regression(content: dict[str, Any]) -> Regression:
    return Regression(*(_array(content[name]) for name in REGRESSION))


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
