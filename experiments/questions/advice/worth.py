"""What advice is worth: its regret on maps that were kept aside, beside that of simpler choices.

Every map is asked about as `advise` answers, from a table without it. The regret of a choice on a
map is the error of the chosen sampler over the least one there, as measured; over maps it is the
geometric mean. Three choices: that of least expected error; always the sampler of least mean
logarithm over the other maps; any at random.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from experiments.questions.advice.expected import Array, Expected, Wish, on_map
from experiments.questions.advice.measured import LEAGUES, Measured

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
