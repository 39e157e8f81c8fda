"""Why an advice is what it is: features that moved predictions, and measured maps alike."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES
from experiments.questions.advice.model import Model

Array = NDArray[np.float64]
Choice = tuple[str, int]
"""A sampler and a count."""
ALIKE = 5
REASONS = 3


@dataclass(frozen=True)
class Reason:
    """A feature that moved a prediction.

    higher_than : share of the measured maps whose value is lower; factor : on the error
    """

    feature: str
    meaning: str
    value: float
    higher_than: float
    factor: float


@dataclass(frozen=True)
class AlikeMap:
    """A measured map, and the chosen sampler's error at the nearest count measured there."""

    name: str
    distance: float
    count: int
    error: float


def alike_maps(model: Model, features: Array, metric: str, chosen: Choice) -> tuple[AlikeMap, ...]:
    """The measured maps nearest to a map, and what the chosen sampler's error was there.

    Coordinates count by what they do to errors (`importance`). A distance is thus a typical
    difference of ln error.
    """
    difference = model.frame.point(model.features) - model.frame.point(features)
    distance = np.sqrt((difference**2) @ importance(model, metric) ** 2)
    errors = model.measured[metric][:, model.samplers.index(chosen[0])]
    known = np.isfinite(errors)
    nearest = np.where(known, model.off(chosen[1]), np.inf).argmin(axis=1)
    order = np.argsort(distance, kind="stable")
    return tuple(
        AlikeMap(
            model.maps[k],
            float(distance[k]),
            model.counts[nearest[k]],
            float(errors[k, nearest[k]]),
        )
        for k in order[known[order].any(axis=1)][:ALIKE]
    )


def importance(model: Model, metric: str) -> Array:
    """How much each feature moves ln error at the middle count, (f,).

    The root mean square over samplers of its standard deviation over the measured maps.
    """
    moved = model.errors[metric].moved(model.frame.point(model.features), 0.0)
    return np.asarray(np.sqrt(np.nanmean(moved.std(axis=1) ** 2, axis=0)))


def decisive(model: Model, metric: str, inside: list[int]) -> Array:
    """How much each feature changes the order of some samplers at the middle count, (f,).

    The root mean square, over measured maps, of what it moves each by beside their mean.
    """
    moved = model.errors[metric].moved(model.frame.point(model.features), 0.0)[inside]
    return np.asarray(np.sqrt(((moved - moved.mean(axis=0)) ** 2).mean(axis=(0, 1))))


def reasons(
    model: Model, features: Array, metric: str, one: Choice, other: Choice | None = None
) -> tuple[Reason, ...]:
    """The features that changed ln error of one sampler, or its lead on another, the most."""
    point = model.frame.point(features)

    def parts(choice: Choice) -> Array:
        x = float(model.scale(np.array([choice[1]]))[0])
        return model.errors[metric].moved(point, x)[model.samplers.index(choice[0])]

    moved = parts(one) - (parts(other) if other is not None else 0.0)
    found = []
    for k in np.argsort(-np.abs(moved))[:REASONS]:
        if moved[k] == 0.0:
            continue
        feature = list(FEATURES.values())[k]
        lower = float((model.features[:, k] < features[k]).mean())
        found.append(
            Reason(
                feature.name, feature.meaning, float(features[k]), lower, math.exp(float(moved[k]))
            )
        )
    return tuple(found)
