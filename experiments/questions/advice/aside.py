"""What advice is worth on maps that were kept aside: maps that no part of training has seen.

Each map is asked about as anybody would ask, `choice.advise` at a budget, and what it chooses is
compared with what was measured there: the regret of the advice, of always the best on average over
the maps that the model was trained on, and of any sampler; and how many of all samplers' errors lie
in the intervals that are given for them.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.features import FEATURES, PREFIX
from experiments.questions.advice.choice import Kind, Wish, advise, candidates
from experiments.questions.advice.judged import REGRET, REGRET_HEADINGS, at_rays
from experiments.questions.advice.leagues import LEAGUES, members
from experiments.questions.advice.measured import Measured
from experiments.questions.advice.model import SURE, Model
from experiments.report.parts import Table

Array = NDArray[np.float64]
BUDGETS: tuple[tuple[Kind, float], ...] = (("lights", 8.0), ("lights", 32.0), ("rays", 4.0))
FORMATS = {**REGRET, "inside": ".2f", "maps": "d"}
HEADINGS = {
    **REGRET_HEADINGS,
    "choice": "× by advice",
    "inside": f"in the {100 * SURE:.0f} % interval",
}


def judged_aside(model: Model, aside: Measured) -> Table:
    """A line per metric, league and budget of `BUDGETS` that was measured."""
    lines = []
    for metric in model.errors:
        for league in LEAGUES:
            for kind, amount in BUDGETS:
                truth = _truth(aside, metric, kind, amount)
                if truth is not None:
                    line = _line(model, aside, truth, Wish(kind, amount, metric, league))
                    lines += [line] if line else []
    rows = pd.DataFrame(lines, columns=list(FORMATS))
    caption = (
        f"On the {len(aside.maps)} maps kept aside: {', '.join(aside.maps)}. Regret is the error "
        "of the chosen sampler over that of the best one on a map, in the geometric mean over "
        "maps. Intervals are of errors at so many lights, of all samplers of the league."
    )
    return Table("aside", rows, FORMATS, HEADINGS, caption=caption)


def _truth(aside: Measured, metric: str, kind: Kind, amount: float) -> Array | None:
    """ln of measured errors (m, s) at a budget; None where it was not measured."""
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.log(aside.errors[metric])
        if kind == "rays":
            return at_rays(np.log(aside.rays), errors, amount)
    if int(amount) not in aside.counts:
        return None
    return np.asarray(errors[:, :, aside.counts.index(int(amount))])


def _line(model: Model, aside: Measured, truth: Array, wish: Wish) -> dict[str, object] | None:
    """None where the league has fewer than two samplers."""
    league = members(aside.leagues, aside.samplers, wish.league)
    if len(league) < 2:
        return None
    choice, always, random, inside, average = [], [], [], [], ""
    for features, errors in zip(aside.features, truth, strict=True):
        columns = {PREFIX + name: value for name, value in zip(FEATURES, features, strict=True)}
        found = advise(model, columns, wish)
        average = found.verdict.average if found.verdict else found.chosen.sampler
        regret = errors - np.nanmin(errors[league])
        choice.append(regret[aside.samplers.index(found.chosen.sampler)])
        always.append(regret[aside.samplers.index(average)])
        random.append(np.nanmean(regret[league]))
        if wish.kind == "lights":
            for one in candidates(model, features, wish):
                error = np.exp(errors[aside.samplers.index(one.sampler)])
                if np.isfinite(error):
                    inside.append(one.low <= error <= one.high)
    means = (float(np.exp(np.nanmean(part))) for part in (choice, always, random))
    return {
        "metric": model.labels[wish.metric], "league": wish.league,
        "budget": f"{wish.kind}={wish.amount:g}", "average": average,
        **dict(zip(("choice", "always", "random"), means, strict=True)),
        "inside": float(np.mean(inside)) if inside else float("nan"), "maps": len(choice),
    }  # fmt: skip
