"""What choosing by the model is worth: regret beside that of choosing without looking at the map.

The regret of a choice on a map is the error of the chosen sampler over the least one there; over
maps it is the geometric mean. Three choices: the least predicted error, predicted from the other
maps; always the sampler of least mean logarithm over the other maps; any at random.

At so many rays errors lie between those at numbers of lights: logarithms are interpolated, of what
was measured and of what is predicted.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from experiments.questions.advice.leagues import LEAGUES, members
from experiments.questions.advice.measured import Measured
from experiments.questions.advice.model import Model, Verdict, quantiles

Array = NDArray[np.float64]
RAYS = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
COMPLETE = 0.9
"""Share of maps on which a sampler must be measured at a budget to be compared there."""
SLACK = 0.25
"""Budgets of rays may miss the measured ones by this share."""


def at_rays(rays: Array, errors: Array, budget: float) -> Array:
    """ln of errors (m, s) at a budget, from logarithms of rays and errors (m, s, c)."""
    found, wanted = np.full(rays.shape[:2], np.nan), np.log(budget)
    for place in np.ndindex(*found.shape):
        there = np.isfinite(rays[place]) & np.isfinite(errors[place])
        if not there.any():
            continue
        known, value = rays[place][there], errors[place][there]
        order = np.argsort(known)
        slack = np.log1p(SLACK)
        if known.min() - slack <= wanted <= known.max() + slack:
            found[place] = np.interp(wanted, known[order], value[order])
    return found


def verdicts(
    table: Measured, predicted: Mapping[str, Array], predicted_rays: Array
) -> Iterator[Verdict]:
    """At every measured number of lights and every budget of rays, by metric and league."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = np.log(table.rays)
        errors = {name: np.log(found) for name, found in table.errors.items()}
    for metric, truth in errors.items():
        budgets = [
            ("lights", float(count), truth[:, :, k], predicted[metric][:, :, k])
            for k, count in enumerate(table.counts)
        ] + [
            ("rays", budget, at_rays(rays, truth, budget),
             at_rays(predicted_rays, predicted[metric], budget))
            for budget in RAYS
        ]  # fmt: skip
        for league in LEAGUES:
            inside = members(table.leagues, table.samplers, league)
            for kind, amount, true, guess in budgets:
                found = _verdict(table, inside, true, guess)
                if found is not None:
                    yield Verdict(metric, league, kind, amount, *found)


def _verdict(
    table: Measured, inside: list[int], truth: Array, guess: Array
) -> tuple[str, float, float, float, bool, int] | None:
    """None where fewer than two samplers, or too few maps, can be compared."""
    both = np.isfinite(truth) & np.isfinite(guess)
    kept = [k for k in inside if both[:, k].mean() >= COMPLETE]
    maps = np.flatnonzero(both[:, kept].all(axis=1)) if len(kept) > 1 else np.array([])
    if len(maps) < 2:
        return None
    truth, guess = truth[np.ix_(maps, kept)], guess[np.ix_(maps, kept)]
    regret = truth - truth.min(axis=1, keepdims=True)
    every = np.arange(len(maps))
    choice = regret[every, guess.argmin(axis=1)]
    others = (truth.sum(axis=0) - truth) / (len(maps) - 1)
    always = regret[every, others.argmin(axis=1)]
    gain = always - choice
    better = bool(gain.mean() > gain.std(ddof=1) / np.sqrt(len(maps)))
    means = (float(np.exp(part.mean())) for part in (choice, always, regret))
    return table.samplers[kept[truth.mean(axis=0).argmin()]], *means, better, len(maps)


def coverage(model: Model, metric: str) -> Array:
    """Share of maps (s, c) whose error lies in the interval that the other maps give."""
    residuals = model.residuals[metric]
    found = np.full(residuals.shape[1:], np.nan)
    for place in np.ndindex(*found.shape):
        known = residuals[:, *place]
        known = known[np.isfinite(known)]
        if len(known) < 3:
            continue
        inside = []
        for k, one in enumerate(known):
            low, high = quantiles(np.delete(known, k))
            inside.append(low <= np.exp(one) <= high)
        found[place] = np.mean(inside)
    return found


def median_factor(model: Model, metric: str) -> float:
    """The factor by which half of the predicted errors of left-out maps are off, or more."""
    return float(np.exp(np.nanmedian(np.abs(model.residuals[metric]))))
