"""The advice for a map: a sampler and a count, what error to expect, and why.

Every sampler of the league is taken at the count that the budget allows it, and the one of least
predicted error is chosen; but where choosing so was no better, on maps that the model had not seen,
than always taking whoever is best on average, that one is taken, and the advice says so. For an
error that is wanted, each sampler is taken at the least count that is predicted to reach it, and
the one of least count is chosen.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES
from experiments.questions.advice.coordinates import plain
from experiments.questions.advice.leagues import LEAGUES, members
from experiments.questions.advice.model import Model, Verdict
from samplers import EnvlightError

Array = NDArray[np.float64]
ALIKE = 5
REASONS = 3
Kind = Literal["lights", "rays", "seconds", "error"]


@dataclass(frozen=True)
class Wish:
    """What somebody asks for.

    kind, amount : so many lights, rays per sub-pixel or seconds, or this error
    metric, league : by which error, and who may be chosen
    subpixels : of the whole image, and speed : seconds for a ray here over those of the model's
        machine; both for budgets of seconds
    """

    kind: Kind
    amount: float
    metric: str
    league: str = "all"
    subpixels: int = 640 * 480 * 4
    speed: float = 1.0


@dataclass(frozen=True)
class Expected:
    """What a sampler is expected to give.

    low, high : between which the error lies on four of five maps; rays : per sub-pixel; seconds :
        to make the lights and render the image
    """

    sampler: str
    count: int
    error: float
    low: float
    high: float
    rays: float
    seconds: float


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
    """A measured map, and the error that the chosen sampler had there at the nearest count."""

    name: str
    distance: float
    count: int
    error: float


@dataclass(frozen=True)
class Advice:
    """wish : what was asked; label : what tables call its metric

    chosen, runner_up : the latter None where nobody else is in the league
    sureness : share of left-out maps on which the order of both would stay
    verdict : what choosing is worth at the nearest budget that was judged, None where none was
    by_average : whether the best on average was taken, and not the least prediction
    level : why the error is as large as it is; order : why the chosen one is before the runner-up
    beyond : features that lie beyond all measured maps
    features : of the map, by name
    """

    wish: Wish
    label: str
    chosen: Expected
    runner_up: Expected | None
    sureness: float
    verdict: Verdict | None
    by_average: bool
    alike: tuple[AlikeMap, ...]
    level: tuple[Reason, ...]
    order: tuple[Reason, ...]
    beyond: tuple[str, ...]
    features: Mapping[str, float]


def advise(model: Model, columns: Mapping[str, float], wish: Wish) -> Advice:
    """The advice for a map of these features, by columns such as `map_contrast`.

    Raises EnvlightError for what the model does not know, or no sampler can meet.
    """
    if wish.metric not in model.errors:
        known = ", ".join(model.errors)
        raise EnvlightError(f"--metric {wish.metric}: the model knows errors by {known}")
    if wish.league not in LEAGUES:
        raise EnvlightError(f"--league {wish.league}: use {', '.join(LEAGUES)}")
    features = plain(columns)
    found = candidates(model, features, wish)
    if not found:
        raise EnvlightError(_nobody(model, wish))
    order = sorted(found, key=lambda one: _rank(wish, one))
    verdict = nearest_verdict(model, wish, order[0])
    by_average = False
    if verdict is not None and not verdict.better:
        best = next((one for one in order if one.sampler == verdict.average), None)
        if best is not None:
            order.remove(best)
            order.insert(0, best)
            by_average = True
    chosen, runner_up = order[0], order[1] if len(order) > 1 else None
    sureness, reasons = math.nan, ()
    if runner_up is not None:
        sureness = _sureness(model, wish, chosen, runner_up)
        reasons = _reasons(model, features, wish.metric, chosen, runner_up)
    beyond = [
        feature.name
        for feature, value, low, high in zip(
            FEATURES.values(), features, model.features.min(0), model.features.max(0), strict=True
        )
        if not low <= value <= high
    ]
    return Advice(
        wish,
        model.labels[wish.metric], chosen, runner_up, sureness, verdict, by_average,
        alike_maps(model, features, wish.metric, chosen),
        _reasons(model, features, wish.metric, chosen, None), reasons, tuple(beyond),
        dict(zip(FEATURES, features.tolist(), strict=True)),
    )  # fmt: skip


def _rank(wish: Wish, one: Expected) -> tuple[float, float]:
    return (one.count, one.error) if wish.kind == "error" else (one.error, one.count)


def candidates(model: Model, features: Array, wish: Wish) -> list[Expected]:
    """The samplers of the league that can meet the wish, each at its count."""
    leagues = dict(zip(model.samplers, model.leagues, strict=True))
    counts = np.arange(model.counts[0], model.counts[-1] + 1)
    error = np.exp(model.log_errors(wish.metric, features, counts))
    rays = np.exp(model.log_rays(features, counts))
    found = []
    for k in members(leagues, model.samplers, wish.league):
        seconds = _seconds(model, k, counts, rays[k], wish)
        allowed = counts >= model.least[k]
        if wish.kind == "lights":
            allowed &= counts == int(wish.amount)
        elif wish.kind == "error":
            allowed &= error[k] <= wish.amount
        else:
            allowed &= (rays[k] if wish.kind == "rays" else seconds) <= wish.amount
        allowed &= np.isfinite(error[k])
        if not allowed.any():
            continue
        # The least that reaches an error; otherwise the most that the budget allows.
        place = np.flatnonzero(allowed)[0 if wish.kind == "error" else -1]
        low, high = model.interval(wish.metric, k, float(counts[place]))
        value = float(error[k, place])
        found.append(
            Expected(
                model.samplers[k],
                int(counts[place]),
                value,
                value * low,
                value * high,
                float(rays[k, place]),
                float(seconds[place]),
            )
        )
    return found


def _seconds(model: Model, sampler: int, counts: Array, rays: Array, wish: Wish) -> Array:
    """Seconds (n,) for the lights, by the measured counts next to these, and for the image."""
    known = np.isfinite(model.seconds_lights[sampler])
    if not known.any():
        return np.full(len(counts), np.nan)
    lights = np.interp(counts, np.array(model.counts)[known], model.seconds_lights[sampler][known])
    return wish.speed * (lights + model.seconds_per_ray[sampler] * rays * wish.subpixels)


def _nobody(model: Model, wish: Wish) -> str:
    least, most = model.counts[0], model.counts[-1]
    what = {
        "lights": f"--lights {wish.amount:g}: give a number of lights from {least} to {most}",
        "rays": f"--rays {wish.amount:g}: even {least} lights cost more; give more rays",
        "seconds": f"--seconds {wish.amount:g}: even {least} lights take longer; give more seconds "
        "or a smaller image",
        "error": f"--error {wish.amount:g}: nobody is expected to reach it with {most} lights; "
        "give a larger error",
    }
    return f"{what[wish.kind]}, or another --league"


def nearest_verdict(model: Model, wish: Wish, best: Expected) -> Verdict | None:
    """What choosing is worth at the budget nearest to the wish, by ratio.

    Budgets of seconds are judged by the rays that the best one traces in them, an error by its
    count.
    """
    kind, amount = wish.kind, wish.amount
    if kind == "seconds":
        kind, amount = "rays", best.rays
    if kind == "error":
        kind, amount = "lights", best.count
    judged = [
        one
        for one in model.verdicts
        if (one.metric, one.league, one.kind) == (wish.metric, wish.league, kind)
    ]
    return min(judged, key=lambda one: abs(math.log(one.amount / amount)), default=None)


def _sureness(model: Model, wish: Wish, one: Expected, other: Expected) -> float:
    first, second = (model.samplers.index(found.sampler) for found in (one, other))
    gap = math.log(other.error / one.error)
    return model.sureness(wish.metric, first, second, (one.count, other.count), gap)


def alike_maps(
    model: Model, features: Array, metric: str, chosen: Expected
) -> tuple[AlikeMap, ...]:
    """The measured maps nearest to a map, and what the chosen sampler's error was there.

    Coordinates count by what they do to errors (`importance`). A distance is thus a typical
    difference of ln error.
    """
    difference = model.frame.point(model.features) - model.frame.point(features)
    distance = np.sqrt((difference**2) @ importance(model, metric) ** 2)
    sampler, place = model.samplers.index(chosen.sampler), model.place(chosen.count)
    return tuple(
        AlikeMap(
            model.maps[k],
            float(distance[k]),
            model.counts[place],
            float(model.measured[metric][k, sampler, place]),
        )
        for k in np.argsort(distance, kind="stable")[:ALIKE]
    )


def importance(model: Model, metric: str) -> Array:
    """How much each feature moves ln error at the middle count, (f,).

    The root mean square over samplers of its standard deviation over the measured maps.
    """
    moved = model.errors[metric].moved(model.frame.point(model.features), 0.0)
    return np.asarray(np.sqrt(np.nanmean(moved.std(axis=1) ** 2, axis=0)))


def _reasons(
    model: Model, features: Array, metric: str, one: Expected, other: Expected | None
) -> tuple[Reason, ...]:
    """The features that changed ln error of one sampler, or its lead on another, the most."""
    point = model.frame.point(features)

    def parts(expected: Expected) -> Array:
        x = float(model.scale(np.float64(expected.count)))
        return model.errors[metric].moved(point, x)[model.samplers.index(expected.sampler)]

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
