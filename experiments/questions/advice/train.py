"""From measured errors to a model of them, and what it is worth on maps that it has not seen.

Maps are what is left out: all rows of a map at once, with the standardisation of its features. The
strength of a ridge and the groups of terms are those of least mean square error of the logarithm
over eight groups of maps, once for the mean over samplers and once for what each has beside it;
residuals and verdicts are of each map predicted from all others.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.advice.coordinates import Frame
from experiments.questions.advice.judged import verdicts
from experiments.questions.advice.measured import REFERENCE, Measured, measured
from experiments.questions.advice.model import (
    CountScale,
    Model,
    Regression,
    design,
    part_of_terms,
)
from experiments.run.loaded_run import Run
from metrics.registry import find_metric
from samplers import sampler_class, sampler_names

Array = NDArray[np.float64]
FOLDS = 8
RIDGES = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
TERMS = {
    "the count alone": (0,),
    "and features": (0, 1),
    "and their squares": (0, 1, 2),
    "and their products with the count": (0, 1, 3),
    "and both": (0, 1, 2, 3),
}
"""Groups of terms that are tried, by what is said of them."""


@dataclass(frozen=True)
class Trial:
    """Terms and a ridge, and the root mean square by which predicted logarithms are off.

    of : a metric or "rays"; part : "all samplers" for their mean, or "each beside it"
    """

    of: str
    part: str
    terms: str
    ridge: float
    error: float


@dataclass(frozen=True, eq=False)
class Trained:
    """A model, what was tried, and predictions of each map from all others.

    predicted : by metric, ln of errors (m, s, c); predicted_rays : ln of rays
    """

    model: Model
    trials: tuple[Trial, ...]
    predicted: Mapping[str, Array]
    predicted_rays: Array


def trained_on(runs: Sequence[Run]) -> Trained:
    """The model of what runs have measured; EnvlightError where they have no features of maps."""
    table = measured(runs)
    source = {
        "runs": [run.folder.name for run in runs],
        "commits": [run.record["machine"].get("commit", "") for run in runs],
        "maps": len(table.maps),
        "scenes": list(table.scenes),
        "images": list(table.sizes),
        "machine": runs[0].record["machine"].get("processor", ""),
    }
    return train(table, source)


def train(table: Measured, source: Mapping[str, Any]) -> Trained:
    """The model of what was measured."""
    with np.errstate(divide="ignore", invalid="ignore"):
        targets = {name: np.log(errors) for name, errors in table.errors.items()}
        rays = np.log(table.rays)
    rays[~np.isfinite(rays)] = np.nan
    trials: list[Trial] = []
    predicted: dict[str, Array] = {}
    fitted: dict[str, Regression] = {}
    for name, target in {**targets, RAYS: rays}.items():
        common, beside = _parted(target)
        tried = [
            list(_trials(table, name, BOTH[0], common)),
            list(_trials(table, name, BOTH[1], beside)),
        ]
        best = [min(part, key=lambda one: one.error) for part in tried]
        trials += [one for part in tried for one in part]
        every = len(table.maps)
        predicted[name] = _left_out(table, common, best[0], every) + _left_out(
            table, beside, best[1], every
        )
        fitted[name] = _sum(_fit_all(table, common, best[0]), _fit_all(table, beside, best[1]))
    predicted_rays, fitted_rays = predicted.pop(RAYS), fitted.pop(RAYS)
    place = table.samplers.index(REFERENCE) if REFERENCE in table.samplers else 0
    model = Model(
        {name: find_metric(name).label for name in table.errors},
        table.samplers,
        tuple(table.leagues.get(name, "") for name in table.samplers),
        tuple(_least(name, table.counts) for name in table.samplers),
        table.counts,
        table.maps,
        table.features,
        Frame.of(table.features),
        CountScale.of(table.counts),
        fitted,
        fitted_rays,
        table.errors,
        {name: targets[name] - found for name, found in predicted.items()},
        table.seconds_lights,
        table.seconds_per_ray,
        float(table.seconds_per_ray[place]),
        tuple(verdicts(table, predicted, predicted_rays)),
        dict(source),
    )
    return Trained(model, tuple(trials), predicted, predicted_rays)


RAYS, BOTH = "rays", ("all samplers", "each beside it")


def _least(label: str, counts: tuple[int, ...]) -> int:
    name = label.partition("[")[0]
    own = sampler_class(name).minimum_count if name in sampler_names() else 1
    return max(own, counts[0])


def _parted(target: Array) -> tuple[Array, Array]:
    """The mean (m, 1, c) over the samplers that have everything, and all beside it (m, s, c)."""
    whole = np.isfinite(target).all(axis=(0, 2))
    common = target[:, whole].mean(axis=1, keepdims=True) if whole.any() else 0.0 * target[:, :1]
    return common, target - common


def _sum(common: Regression, beside: Regression) -> Regression:
    return Regression(common.intercept + beside.intercept, common.coefficient + beside.coefficient)


def _trials(table: Measured, of: str, part: str, target: Array) -> Iterator[Trial]:
    for terms, groups in TERMS.items():
        for ridge in RIDGES if len(groups) > 1 else RIDGES[:1]:
            found = Trial(of, part, terms, ridge, np.nan)
            off = target - _left_out(table, target, found, FOLDS)
            yield Trial(of, part, terms, ridge, float(np.sqrt(np.nanmean(off**2))))


def _left_out(table: Measured, target: Array, trial: Trial, folds: int) -> Array:
    """ln y (m, s, c) of each map as the maps of the other folds predict it."""
    from sklearn.model_selection import GroupKFold

    groups = np.arange(len(table.maps))
    found = np.full(target.shape, np.nan)
    x = CountScale.of(table.counts)(np.array(table.counts, np.float64))
    for kept, left in GroupKFold(min(folds, len(groups))).split(groups, groups=groups):
        frame = Frame.of(table.features[kept])
        regression = _fit(table, frame, target, trial, np.isin(groups, kept))
        for one in left:
            found[one] = regression(frame.point(table.features[one]), x)
    return found


def _fit_all(table: Measured, target: Array, trial: Trial) -> Regression:
    return _fit(table, Frame.of(table.features), target, trial, np.ones(len(table.maps), bool))


def _fit(
    table: Measured, frame: Frame, target: Array, trial: Trial, used: NDArray[np.bool_]
) -> Regression:
    """Ridge regressions of all samplers on the used maps, those with the same gaps at once."""
    from sklearn.linear_model import Ridge

    maps, samplers, counts = target.shape
    x = CountScale.of(table.counts)(np.array(table.counts, np.float64))
    z = np.repeat(frame.point(table.features), counts, axis=0)
    terms = design(z, np.tile(x, maps))
    inside = np.isin(part_of_terms(z.shape[1]), TERMS[trial.terms])
    rows = target.transpose(0, 2, 1).reshape(-1, samplers)
    known = np.isfinite(rows) & np.repeat(used, counts)[:, None]
    intercept = np.full(samplers, np.nan)
    coefficient = np.zeros((samplers, terms.shape[1]))
    _, pattern = np.unique(known, axis=1, return_inverse=True)
    for one in np.unique(pattern):
        members = np.flatnonzero(pattern.ravel() == one)
        there = known[:, members[0]]
        if not there.any():
            continue
        found = Ridge(trial.ridge).fit(terms[there][:, inside], rows[np.ix_(there, members)])
        intercept[members] = found.intercept_
        coefficient[np.ix_(members, np.flatnonzero(inside))] = np.reshape(
            found.coef_, (len(members), -1)
        )
    return Regression(intercept, coefficient)
