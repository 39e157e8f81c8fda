"""What to expect of each sampler on a map: what was measured on the maps that are like it.

How like a measured map is falls with the distance between the two as points of their features,
exp(−d²/2w²), d being the root mean square over the features in units of their spread. An expected
error is the mean over maps, so weighted, of ln error; its interval holds the middle `SURE` of what
those maps' errors are; costs are means. A map that was itself measured, which all of its features
tell, is answered with its own rows. But for w nothing is fitted.

What advice is worth is told by maps that are kept aside: every map is asked about as `advise`
answers, from a table without it. The regret of a choice on a map is the error of the chosen sampler
over the least one there, as measured; over maps it is the geometric mean. Three choices: that of
least expected error; always the sampler of least mean logarithm over the other maps; any at random.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES
from experiments.questions.advice.measured import LEAGUES, Measured, plain
from samplers import EnvlightError

Array = NDArray[np.float64]
Kind = Literal["lights", "rays", "seconds", "error"]
SURE = 0.8
"""Share of maps whose error lies in an interval."""
WIDTH = 0.8
"""w, in spreads of the features: of least regret where each map is left out."""
SAME = 1e-4
"""Features of one map agree to this share: a table has six digits of them."""
LEAST_SHARE = 1e-3
"""Shares nearer to 0 or 1 count as so near."""
BY_RESOLUTION = ("contrast",)
"""Features that grow with the number of texels: they do not tell what a map is like."""
ALIKE = 5
ENGINE, PATH_TRACER = "fixed", "distribution"


@dataclass(frozen=True)
class Wish:
    """What somebody asks for.

    kind, amount : so many lights, rays per sub-pixel or seconds, or this error
    metric : by which error
    subpixels : of the whole image; speed : seconds for a ray on the asker's machine over those on
        the table's
    """

    kind: Kind
    amount: float
    metric: str
    subpixels: int = 640 * 480 * 4
    speed: float = 1.0


@dataclass(frozen=True)
class Expected:
    """What a sampler is expected to give.

    low, high : between which the error is on `SURE` of the maps alike
    rays : per sub-pixel; seconds_lights, seconds_image : to make the lights, and to render
    """

    sampler: str
    count: int
    error: float
    low: float
    high: float
    rays: float
    seconds_lights: float
    seconds_image: float


@dataclass(frozen=True)
class Answer:
    """For one use: whom to take.

    runner_up : None where nobody else is in the league
    better : share of the maps alike on which the chosen one's error is less than the runner-up's
    """

    league: str
    chosen: Expected
    runner_up: Expected | None
    better: float


@dataclass(frozen=True)
class Alike:
    """A measured map, its share of what is expected, and each answer's chosen one's error there."""

    name: str
    share: float
    errors: tuple[float, ...]


@dataclass(frozen=True)
class Advice:
    """wish : what was asked; label : what tables call its metric

    measured_as : the map's name in the table, empty where it was not measured
    answers : for an engine and for a path tracer, where the table has samplers that can
    alike : the maps most like it
    beyond : features that lie beyond all measured maps
    features : of the map, by name
    """

    wish: Wish
    label: str
    measured_as: str
    answers: tuple[Answer, ...]
    alike: tuple[Alike, ...]
    beyond: tuple[str, ...]
    features: Mapping[str, float]


def advise(table: Measured, columns: Mapping[str, float], wish: Wish) -> Advice:
    """The advice for a map of these features, by columns such as `map_contrast`.

    Raises EnvlightError for a metric that the table lacks, or a budget that no sampler can meet.
    """
    if wish.metric not in table.errors:
        known = ", ".join(table.errors)
        raise EnvlightError(f"--metric {wish.metric}: errors are known by {known}")
    features = plain(columns)
    own = own_rows(table, features)
    weights = likeness(table, features)
    alike_order = np.argsort(-weights, kind="stable")[:ALIKE]
    found = on_map(table, features, wish)
    answers = []
    for league in (ENGINE, PATH_TRACER):
        inside = {table.samplers[k] for k in table.members(league)}
        order = ranked(wish, [one for one in found if one.sampler in inside])
        if order:
            second = order[1] if len(order) > 1 else None
            used = weights if own is None else own
            better = _better(table, used, wish.metric, order[0], second)
            answers.append(Answer(league, order[0], second, better))
    if not answers:
        raise EnvlightError(_nobody(table, wish))
    errors = [_errors_at(table, wish.metric, one.chosen) for one in answers]
    low, high = table.features.min(axis=0), table.features.max(axis=0)
    outside = (features < low * (1.0 - SAME)) | (features > high * (1.0 + SAME))
    return Advice(
        wish,
        table.labels[wish.metric],
        "" if own is None else table.maps[int(own.argmax())],
        tuple(answers),
        tuple(
            Alike(table.maps[k], float(weights[k]), tuple(float(part[k]) for part in errors))
            for k in alike_order
        ),
        tuple(name for name, out in zip(FEATURES, outside, strict=True) if own is None and out),
        dict(zip(FEATURES, features.tolist(), strict=True)),
    )


def likeness(table: Measured, features: Array) -> Array:
    """How like each measured map is to one of these features (f,): shares (m,), of sum 1."""
    known = transformed(table.features)
    spread = known.std(axis=0)
    counted = (spread > 1e-9) & np.array([name not in BY_RESOLUTION for name in FEATURES])
    steps = (known - transformed(features))[:, counted] / spread[counted]
    square = (steps**2).sum(axis=1) / max(counted.sum(), 1)
    weights = np.exp(-0.5 * (square - square.min()) / WIDTH**2)
    return np.asarray(weights / weights.sum())


def transformed(features: Array) -> Array:
    """Features (…, f) so that a step is a factor: shares as log-odds, ratios as logarithms."""
    found = np.array(features, np.float64)
    for k, feature in enumerate(FEATURES.values()):
        value = found[..., k]
        match feature.unit:
            case "share":
                inside = np.clip(value, LEAST_SHARE, 1.0 - LEAST_SHARE)
                found[..., k] = np.log(inside / (1.0 - inside))
            case "count":
                found[..., k] = np.log1p(value)
            case "degrees" | "ratio":
                found[..., k] = np.log(np.maximum(value, 1e-30))
    return found


def own_rows(table: Measured, features: Array) -> Array | None:
    """1 for the map that has all of these features, (m,); None where none has.

    Turning a map about the vertical by whole columns, or scaling it, changes none of them.
    """
    same = np.isclose(table.features, features, rtol=SAME, atol=1e-9).all(axis=1)
    first = np.arange(len(table.maps)) == same.argmax()
    return first.astype(np.float64) if same.any() else None


def on_map(table: Measured, features: Array, wish: Wish) -> list[Expected]:
    """What each sampler that can meet the wish is expected to give, at the count it is allowed.

    For an error that is wanted the least count that reaches it; else the most that the budget
    allows, at most the largest one measured.
    """
    own = own_rows(table, features)
    weights, errors, rays = own, table.log_errors(wish.metric), table.rays
    if weights is None:
        weights, errors, rays = likeness(table, features), completed(errors), completed(rays)
    knots, measured_counts = np.log(table.counts), np.array(table.counts, np.float64)
    counts = np.arange(table.counts[0], table.counts[-1] + 1)
    level = between(_mean(errors, weights), knots, np.log(counts))
    traced, making = (
        between(costs, measured_counts, counts.astype(np.float64))
        for costs in (_mean(rays, weights), table.seconds_lights)
    )
    error, making = np.exp(level), wish.speed * making
    image = wish.speed * table.seconds_per_ray[:, None] * traced * wish.subpixels
    allowed = {
        "lights": np.broadcast_to(counts == int(wish.amount), error.shape),
        "rays": traced <= wish.amount,
        "seconds": making + image <= wish.amount,
        "error": error <= wish.amount,
    }[wish.kind] & np.isfinite(error)
    found = []
    for k in np.flatnonzero(allowed.any(axis=1)):
        place = np.flatnonzero(allowed[k])[0 if wish.kind == "error" else -1]
        there = between(errors[:, k], knots, np.log(counts[place : place + 1]))[:, 0]
        low, high = np.exp(middle(there, weights))
        values = error[k, place], low, high, traced[k, place], making[k, place], image[k, place]
        found.append(Expected(table.samplers[k], int(counts[place]), *map(float, values)))
    return found


def ranked(wish: Wish, found: list[Expected]) -> list[Expected]:
    """The least error first; where an error is wanted, the least count."""
    if wish.kind == "error":
        return sorted(found, key=lambda one: (one.count, one.error))
    return sorted(found, key=lambda one: (one.error, one.count))


def completed(values: Array) -> Array:
    """Values (m, s, c) with counts beyond a map's last one as far on as on the other maps."""
    found = values.copy()
    for k in range(1, found.shape[-1]):
        step = found[..., k] - found[..., k - 1]
        known = np.isfinite(step)
        mean = np.where(known, step, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        mean[~known.any(axis=0)] = math.nan
        missing = np.isnan(found[..., k])
        found[..., k] = np.where(missing, found[..., k - 1] + mean, found[..., k])
    return found


def between(values: Array, knots: Array, wanted: Array) -> Array:
    """Values (…, c) at rising knots (c,), interpolated to wanted places (n,) within: (…, n)."""
    place = np.clip(np.searchsorted(knots, wanted, side="right") - 1, 0, len(knots) - 2)
    part = (wanted - knots[place]) / (knots[place + 1] - knots[place])
    left, right = values[..., place], values[..., place + 1]
    # A sampler may begin, or a map end, at a knot: beyond it is NaN.
    inside = left + part * (right - left)
    return np.where(part <= 0.0, left, np.where(part >= 1.0, right, inside))


def middle(values: Array, weights: Array) -> tuple[float, float]:
    """Between which the middle `SURE` of the weight of values (m,) lies; NaNs weigh nothing."""
    known = np.flatnonzero(np.isfinite(values) & (weights > 0.0))
    order = known[np.argsort(values[known])]
    place = (np.cumsum(weights[order]) - 0.5 * weights[order]) / weights[order].sum()
    low, high = np.interp([0.5 * (1.0 - SURE), 0.5 * (1.0 + SURE)], place, values[order])
    return float(low), float(high)


def _mean(values: Array, weights: Array) -> Array:
    """Over maps (m, s, c), of those that have a value; NaN where none with any weight has."""
    known = np.isfinite(values)
    total = np.tensordot(weights, known.astype(np.float64), 1)
    summed = np.tensordot(weights, np.where(known, values, 0.0), 1)
    return np.divide(summed, total, out=np.full(total.shape, math.nan), where=total > 0.0)


def _errors_at(table: Measured, metric: str, one: Expected) -> Array:
    """The errors of a sampler on all maps, (m,), at its count."""
    errors = table.log_errors(metric)[:, table.samplers.index(one.sampler)]
    return np.asarray(np.exp(between(errors, np.log(table.counts), np.log([one.count]))[:, 0]))


def _better(
    table: Measured, weights: Array, metric: str, one: Expected, other: Expected | None
) -> float:
    if other is None:
        return math.nan
    ahead = _errors_at(table, metric, other) - _errors_at(table, metric, one)
    known = np.isfinite(ahead)
    if not weights[known].any():
        return math.nan
    return float(weights[known] @ (ahead[known] > 0.0) / weights[known].sum())


def _nobody(table: Measured, wish: Wish) -> str:
    least, most = table.counts[0], table.counts[-1]
    return {
        "lights": f"--lights {wish.amount:g}: give a number of lights from {least} to {most}",
        "rays": f"--rays {wish.amount:g}: even {least} lights cost more; give more rays",
        "seconds": f"--seconds {wish.amount:g}: even {least} lights take longer; give more seconds "
        "or a smaller image",
        "error": f"--error {wish.amount:g}: nobody is expected to reach it with {most} lights; "
        "give a larger error",
    }[wish.kind]


RAYS = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
COMPLETE = 0.9
"""Share of maps on which a sampler must be measured at a budget to be compared there."""
SLACK = 0.25
"""Budgets of rays may miss the measured ones by this share."""


@dataclass(frozen=True)
class Worth:
    """What a choice is worth among the samplers of a league at a budget.

    average : who is best on average over all maps
    choice, always, random : geometric means of regret: of the least expected error, of whoever is
        best on average over the other maps, and of any sampler
    inside : share of the measured errors that lie in the intervals which are given for them
    maps : how many
    """

    league: str
    average: str
    choice: float
    always: float
    random: float
    inside: float
    maps: int


def worth(table: Measured, wish: Wish) -> Iterator[Worth]:
    """For each league at a budget of lights or rays; none where it cannot be told.

    It takes two samplers that were measured there on nearly all maps.
    """
    truth = measured_at(table, wish)
    comparable = np.isfinite(truth).mean(axis=0) >= COMPLETE
    if comparable.sum() < 2:
        return
    expected, low, high = _left_out(table, wish)
    for league in LEAGUES:
        inside = [k for k in table.members(league) if comparable[k]]
        known = np.isfinite(truth[:, inside]).all(axis=1)
        known &= np.isfinite(expected[:, inside]).any(axis=1)
        if len(inside) > 1 and known.sum() > 1:
            error, guess, least, most = (
                part[np.ix_(known, inside)] for part in (truth, expected, low, high)
            )
            told = np.isfinite(guess)
            held = float(((least <= error) & (error <= most))[told].mean())
            guess = np.where(told, guess, np.inf)  # too dear: it is not offered
            best = table.samplers[inside[error.mean(axis=0).argmin()]]
            yield Worth(league, best, *_regrets(error, guess), held, int(known.sum()))


def judged_wish(table: Measured, wish: Wish, chosen: Expected) -> Wish:
    """The budget at which a choice can be judged: measured lights, or rays, nearest to a wish."""
    if wish.kind in ("rays", "seconds"):
        return replace(
            wish, kind="rays", amount=chosen.rays if wish.kind == "seconds" else wish.amount
        )
    count = min(table.counts, key=lambda count: abs(np.log(count / chosen.count)))
    return replace(wish, kind="lights", amount=float(count))


def _regrets(error: Array, guess: Array) -> tuple[float, float, float]:
    """By choice, by the best on average and at random, of ln errors (m, s) and expected ones."""
    regret = error - error.min(axis=1, keepdims=True)
    every = np.arange(len(error))
    average = ((error.sum(axis=0) - error) / (len(error) - 1)).argmin(axis=1)
    chosen = (regret[every, guess.argmin(axis=1)], regret[every, average], regret)
    choice, always, random = (float(np.exp(part.mean())) for part in chosen)
    return choice, always, random


def _left_out(table: Measured, wish: Wish) -> Array:
    """ln of the expected error and of its interval, (3, m, s), each map by the others."""
    found = np.full((3, len(table.maps), len(table.samplers)), np.nan)
    every = np.arange(len(table.maps))
    for k, features in enumerate(table.features):
        for one in on_map(table.only(every != k), features, wish):
            place = table.samplers.index(one.sampler)
            found[:, k, place] = np.log([one.error, one.low, one.high])
    return found


def measured_at(table: Measured, wish: Wish) -> Array:
    """ln of the measured errors (m, s) at a number of lights or rays; NaN where none was."""
    errors = table.log_errors(wish.metric)
    if wish.kind == "lights":
        if int(wish.amount) not in table.counts:
            return np.full(errors.shape[:2], np.nan)
        return errors[:, :, table.counts.index(int(wish.amount))]
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = np.log(table.rays)
    found, wanted, slack = np.full(errors.shape[:2], np.nan), np.log(wish.amount), np.log1p(SLACK)
    for place in np.ndindex(*found.shape):
        there = np.isfinite(rays[place]) & np.isfinite(errors[place])
        known, value = rays[place][there], errors[place][there]
        order = np.argsort(known)
        if len(known) and known.min() - slack <= wanted <= known.max() + slack:
            found[place] = np.interp(wanted, known[order], value[order])
    return found
