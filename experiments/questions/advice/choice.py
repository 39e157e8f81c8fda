"""The advice for a map: a sampler and a count, what error to expect, and why.

Every sampler of the league is taken at the count that the budget allows it, and the one of least
predicted error is chosen; but where choosing so was no better, on maps that the model had not seen,
than always taking whoever is best on average, or its predicted lead on that one is within the
margin that proved best there, that one is taken, and the advice says so. For an
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
from experiments.questions.advice.reasons import AlikeMap, Choice, Reason, alike_maps, reasons
from samplers import EnvlightError

Array = NDArray[np.float64]
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

    @property
    def choice(self) -> Choice:
        return self.sampler, self.count


@dataclass(frozen=True)
class Advice:
    """wish : what was asked; label : what tables call its metric

    chosen, runner_up : the latter None where nobody else is in the league
    sureness : share of left-out maps on which the order of both would stay
    verdict : what choosing is worth at the nearest budget that was judged, None where none was
    by_average : whether the best on average was taken, although another's prediction is less
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
    average = next((one for one in order if verdict and one.sampler == verdict.average), None)
    if verdict is not None and average is not None and average is not order[0]:
        lead = math.log(average.error / order[0].error)
        cautious = wish.kind != "error" and lead <= model.margins[wish.metric]
        if cautious or not verdict.better:
            order.remove(average)
            order.insert(0, average)
            by_average = True
    chosen, runner_up = order[0], order[1] if len(order) > 1 else None
    sureness, order_reasons = math.nan, tuple[Reason, ...]()
    if runner_up is not None:
        sureness = _sureness(model, wish, chosen, runner_up)
        order_reasons = reasons(model, features, wish.metric, chosen.choice, runner_up.choice)
    beyond = [
        feature.name
        for feature, value, low, high in zip(
            FEATURES.values(), features, model.features.min(0), model.features.max(0), strict=True
        )
        if not low <= value <= high
    ]
    return Advice(
        wish, model.labels[wish.metric], chosen, runner_up, sureness, verdict, by_average,
        alike_maps(model, features, wish.metric, chosen.choice),
        reasons(model, features, wish.metric, chosen.choice), order_reasons, tuple(beyond),
        dict(zip(FEATURES, features.tolist(), strict=True)),
    )  # fmt: skip


def _rank(wish: Wish, one: Expected) -> tuple[float, float]:
    return (one.count, one.error) if wish.kind == "error" else (one.error, one.count)


def candidates(model: Model, features: Array, wish: Wish) -> list[Expected]:
    """The samplers of the league that can meet the wish, each at its count."""
    leagues = dict(zip(model.samplers, model.leagues, strict=True))
    counts = np.arange(model.counts[0], model.counts[-1] + 1, dtype=np.float64)
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
