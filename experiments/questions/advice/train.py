"""From measured errors to a model of them, and what it is worth on maps that it has not seen.

Maps are what is left out: all rows of a map at once, with the standardisation of its features. The
strength of a ridge and the groups of terms are those of least mean square error of the logarithm
over eight groups of maps, once for the mean over samplers and once for what each has beside it;
residuals and verdicts are of each map predicted from all others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.advice.coordinates import Frame
from experiments.questions.advice.judged import judged
from experiments.questions.advice.measured import REFERENCE, Measured, measured, parted
from experiments.questions.advice.model import (
    PARTS,
    CountScale,
    Model,
    Regression,
    design,
)
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import family_of
from metrics.registry import find_metric
from samplers import sampler_class, sampler_names

Array = NDArray[np.float64]
RAYS, PARTS_OF_ERROR = "rays", ("all samplers", "each beside it")
FOLDS = 8
RIDGES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
TERMS = {
    "the count alone": (),
    "and features": (0,),
    "and their squares": (0, 1),
    "and their products with the count": (0, 2),
    "and both": (0, 1, 2),
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
    return trained_without(runs, ())[0]


def trained_without(runs: Sequence[Run], aside: Sequence[str]) -> tuple[Trained, Measured]:
    """The model of what runs have measured without the maps aside, and what was measured on these.

    Raises EnvlightError where runs have no features of maps, or not the maps aside.
    """
    table, kept_aside = parted(measured(runs), aside)
    source = {
        "runs": [run.folder.name for run in runs],
        "commits": [run.record["machine"].get("commit", "") for run in runs],
        "maps": len(table.maps),
        "scenes": list(table.scenes),
        "images": list(table.sizes),
        "single_scene": {
            name: [round(factor, 3) for factor in found]
            for name, found in table.single_scene.items()
        },
        "machine": runs[0].record["machine"].get("processor", ""),
    }
    return train(table, source), kept_aside


def train(table: Measured, source: Mapping[str, Any]) -> Trained:
    """The model of what was measured."""
    with np.errstate(divide="ignore", invalid="ignore"):
        targets = {name: np.log(errors) for name, errors in table.errors.items()}
        rays = np.log(table.rays)
    rays[~np.isfinite(rays)] = np.nan
    trials: list[Trial] = []
    predicted: dict[str, Array] = {}
    fitted: dict[str, Regression] = {}
    tried_on, kept_from, all_maps = _splits(table, FOLDS), _splits(table, None), _whole(table)
    for name, target in {**targets, RAYS: rays}.items():
        predicted[name] = np.zeros_like(target)
        parts = []
        for part, values in zip(PARTS_OF_ERROR, _parted(target), strict=True):
            tried = _trials(tried_on, name, part, values)
            best = min(tried, key=lambda one: one.error)
            trials += tried
            how = best.terms, (best.ridge,)
            predicted[name] += _left_out(kept_from, values, *how)[0]
            parts += _fits(all_maps, values, *how)
        fitted[name] = parts[0] + parts[1]
    predicted_rays, fitted_rays = predicted.pop(RAYS), fitted.pop(RAYS)
    place = table.samplers.index(REFERENCE) if REFERENCE in table.samplers else 0
    margins, verdicts = judged(table, predicted, predicted_rays)
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
        margins,
        tuple(verdicts),
        dict(source),
    )
    return Trained(model, tuple(trials), predicted, predicted_rays)


def _least(label: str, counts: tuple[int, ...]) -> int:
    name = family_of(label)
    own = sampler_class(name).minimum_count if name in sampler_names() else 1
    return max(own, counts[0])


def _parted(target: Array) -> tuple[Array, Array]:
    """The mean (m, 1, c) over the samplers that have everything, and all beside it (m, s, c).

    Everything is what any sampler has: runs that are put together may differ in their counts.
    """
    known = np.isfinite(target)
    whole = (known | ~known.any(axis=1, keepdims=True)).all(axis=(0, 2))
    if not whole.any():
        return np.zeros_like(target[:, :1]), target
    common = target[:, whole].mean(axis=1, keepdims=True)
    return common, target - common


@dataclass(frozen=True, eq=False)
class Split:
    """Maps that are kept, those that are left out, and the terms as the kept ones scale them.

    knots : (c,) scaled logarithms of the measured counts
    terms : (m, c, t), of all maps at those
    """

    kept: NDArray[np.int64]
    left: NDArray[np.int64]
    knots: Array
    terms: Array


def _splits(table: Measured, folds: int | None) -> list[Split]:
    """Every map left out once: in so many groups, or by itself."""
    from sklearn.model_selection import GroupKFold

    every = np.arange(len(table.maps))
    count = min(folds or len(every), len(every))
    return [
        _split(table, kept, left) for kept, left in GroupKFold(count).split(every, groups=every)
    ]


def _whole(table: Measured) -> Split:
    every = np.arange(len(table.maps))
    return _split(table, every, every[:0])


def _split(table: Measured, kept: NDArray[np.int64], left: NDArray[np.int64]) -> Split:
    x = CountScale.of(table.counts)(np.array(table.counts, np.float64))
    z = np.repeat(Frame.of(table.features[kept]).point(table.features), len(x), axis=0)
    terms = design(z, np.tile(x, len(table.maps)))
    return Split(kept, left, x, terms.reshape(len(table.maps), len(x), -1))


def _trials(splits: list[Split], of: str, part: str, target: Array) -> list[Trial]:
    found = []
    for terms, groups in TERMS.items():
        ridges = RIDGES if groups else RIDGES[:1]
        for ridge, guess in zip(ridges, _left_out(splits, target, terms, ridges), strict=True):
            error = float(np.sqrt(np.nanmean((target - guess) ** 2)))
            found.append(Trial(of, part, terms, ridge, error))
    return found


def _left_out(
    splits: list[Split], target: Array, terms: str, ridges: tuple[float, ...]
) -> list[Array]:
    """ln y (m, s, c) of each map as the maps that are kept with it left out predict it.

    For each of the ridges.
    """
    found = [np.full(target.shape, np.nan) for _ in ridges]
    for split in splits:
        for predicted, fitted in zip(found, _fits(split, target, terms, ridges), strict=True):
            guess = split.terms[split.left] @ fitted.coefficient.T
            predicted[split.left] = fitted.mean + guess.transpose(0, 2, 1)
    return found


def _fits(split: Split, target: Array, terms: str, ridges: tuple[float, ...]) -> list[Regression]:
    """Regressions of all samplers on the kept maps by each of the ridges.

    At each count, errors and terms are centred over the maps that have it, since the others may be
    harder or easier. Samplers with the same gaps, and all ridges, are solved for at once.
    """
    from sklearn import config_context
    from sklearn.linear_model import Ridge

    samplers, size = target.shape[1], split.terms.shape[2]
    inside = np.flatnonzero(np.isin(np.arange(size) // (size // len(PARTS)), TERMS[terms]))
    kept = target[split.kept].transpose(0, 2, 1)
    known = split.terms[split.kept][:, :, inside]
    centre = _mean(kept, np.isfinite(kept))
    mean = np.tile(centre.T, (len(ridges), 1, 1))
    coefficient = np.zeros((len(ridges), samplers, size))
    patterns, pattern = np.unique(
        np.isfinite(kept).reshape(-1, samplers), axis=1, return_inverse=True
    )
    for one, there in enumerate(patterns.T if len(inside) else ()):
        members = np.flatnonzero(pattern.ravel() == one)
        if not there.any():
            continue
        middle = _mean(known, there.reshape(*kept.shape[:2], 1))
        rows = (kept - centre).reshape(-1, samplers)[np.ix_(there, members)]
        each = Ridge(np.repeat(ridges, len(members)), fit_intercept=False, solver="svd")
        with config_context(assume_finite=True, skip_parameter_validation=True):
            each.fit((known - middle).reshape(len(there), -1)[there], np.tile(rows, len(ridges)))
        solved = np.reshape(each.coef_, (len(ridges), len(members), -1))
        coefficient[np.ix_(np.arange(len(ridges)), members, inside)] = solved
        mean[:, members] -= solved @ middle.T
    return [Regression(split.knots, *found) for found in zip(mean, coefficient, strict=True)]


def _mean(values: Array, there: NDArray[np.bool_]) -> Array:
    """Over the first axis of values (n, …), of those that are there; NaN where none is."""
    count = there.sum(axis=0)
    total = np.where(there, values, 0.0).sum(axis=0)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
