"""What choosing by the model is worth: regret beside that of choosing without looking at the map.

The regret of a choice on a map is the error of the chosen sampler over the least one there; over
maps it is the geometric mean. Three choices: the least predicted error, predicted from the other
maps; always the sampler of least mean logarithm over the other maps; any at random. The first
leaves the second only for a predicted lead of more than a margin, because predictions err: of a few
margins it is, by metric, the one of least regret over all budgets and leagues.

At so many rays errors lie between those at numbers of lights: logarithms are interpolated, of what
was measured and of what is predicted.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from experiments.questions.advice.leagues import LEAGUES, members
from experiments.questions.advice.measured import Measured
from experiments.questions.advice.model import Model, Verdict, levels

Array = NDArray[np.float64]
RAYS = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
MARGINS = (0.2, 0.15, 0.1, 0.06, 0.03, 0.0)
"""Of ln error, the most cautious first."""
COMPLETE = 0.9
"""Share of maps on which a sampler must be measured at a budget to be compared there."""
REGRET = {
    "metric": "s", "league": "s", "budget": "s", "average": "s", "choice": ".3f", "always": ".3f",
    "random": ".3f",
}  # fmt: skip
"""Columns of a table of regrets, and their formats."""
REGRET_HEADINGS = {
    "average": "best on average", "always": "× always the best", "random": "× any",
}  # fmt: skip
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


Budgets = list[tuple[str, float, Array, Array]]
"""Kind, amount, and ln of errors (m, s) as they were measured and as they are predicted."""


def judged(
    table: Measured, predicted: Mapping[str, Array], predicted_rays: Array
) -> tuple[dict[str, float], list[Verdict]]:
    """By metric the margin of least regret; what choosing with it is worth, budget by budget.

    Budgets are every measured number of lights and `RAYS`.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = np.log(table.rays)
        errors = {name: np.log(found) for name, found in table.errors.items()}
    margins, verdicts = {}, []
    for metric, truth in errors.items():
        guess = predicted[metric]
        budgets: Budgets = [
            ("lights", float(count), truth[:, :, k], guess[:, :, k])
            for k, count in enumerate(table.counts)
        ]
        for amount in RAYS:
            both = at_rays(rays, truth, amount), at_rays(predicted_rays, guess, amount)
            budgets.append(("rays", amount, *both))
        tried = {margin: list(_verdicts(table, metric, budgets, margin)) for margin in MARGINS}
        margins[metric] = min(
            MARGINS, key=lambda margin: sum(math.log(one.choice) for one in tried[margin])
        )
        verdicts += tried[margins[metric]]
    return margins, verdicts


def _verdicts(table: Measured, metric: str, budgets: Budgets, margin: float) -> Iterator[Verdict]:
    for league in LEAGUES:
        inside = members(table.leagues, table.samplers, league)
        for kind, amount, truth, guess in budgets:
            found = _verdict(table, inside, truth, guess, margin)
            if found is not None:
                yield Verdict(metric, league, kind, amount, *found)


def _verdict(
    table: Measured, inside: list[int], truth: Array, guess: Array, margin: float
) -> tuple[str, float, float, float, bool, int] | None:
    """None where fewer than two samplers, or too few maps, can be compared."""
    both = np.isfinite(truth) & np.isfinite(guess)
    kept = [k for k in inside if both[:, k].mean() >= COMPLETE]
    maps = np.flatnonzero(both[:, kept].all(axis=1)) if len(kept) > 1 else np.array([])
    if len(maps) < 2:
        return None
    truth, guess = truth[maps][:, kept], guess[maps][:, kept]
    regret = truth - truth.min(axis=1, keepdims=True)
    every = np.arange(len(maps))
    average = ((truth.sum(axis=0) - truth) / (len(maps) - 1)).argmin(axis=1)
    least = guess.argmin(axis=1)
    lead = guess[every, average] - guess[every, least]
    choice = regret[every, np.where(lead > margin, least, average)]
    always = regret[every, average]
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
        others = np.tile(known, (len(known), 1))[~np.eye(len(known), dtype=bool)]
        low, high = levels(others.reshape(len(known), -1).T)
        found[place] = ((low <= known) & (known <= high)).mean()
    return found


def median_factor(model: Model, metric: str) -> float:
    """The factor by which half of the predicted errors of left-out maps are off, or more."""
    return float(np.exp(np.nanmedian(np.abs(model.residuals[metric]))))
