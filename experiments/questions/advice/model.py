"""The model of errors: simple enough to be printed, kept as JSON, applied by NumPy alone.

The logarithm of a sampler's error on a map is its mean over all maps at that number of lights, and
what the map's coordinates z change of it: linear in each z, z² and z · x, where x = log₂ count over
its spread. Between the measured counts means are interpolated. Squares are there, since a map is
easy where a small sun has all of its light and where none of it is concentrated, and hard between.
Ridge regression finds the coefficients: first those of the mean over the samplers, which says how
hard a map is, then those of what each sampler has more or less than that, which decides between
them. Rays are predicted in the same way. How far predictions are off is known from maps that were
left out: `residuals` are the logarithms of the measured over the predicted error on each measured
map, predicted without it. Intervals, and how sure an order is, are read off these.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.advice.coordinates import Frame

Array = NDArray[np.float64]
SURE = 0.8
"""Share of maps whose error lies in the interval."""


PARTS = ("z", "z²", "z × count")
"""Groups of terms, in the order of `design`."""


def design(z: Array, x: Array) -> Array:
    """Terms (n, 3 f) of coordinates z (n, f) and scaled logarithms of counts x (n,)."""
    return np.concatenate([z, z * z - 1.0, z * x[:, None]], axis=1)


@dataclass(frozen=True)
class CountScale:
    """Scaled logarithms of counts."""

    centre: float
    spread: float

    @classmethod
    def of(cls, counts: tuple[int, ...]) -> "CountScale":
        found = np.log2(counts)
        return cls(float(found.mean()), float(found.std()) or 1.0)

    def __call__(self, count: Array) -> Array:
        """Of counts (n,)."""
        return (np.log2(count) - self.centre) / self.spread


@dataclass(frozen=True, eq=False)
class Regression:
    """ln y of each sampler.

    knots : (k,) scaled logarithms of the measured counts
    mean : (s, k), at those of a map with all terms 0: where every map was measured, the mean over
        all; NaN where nothing was
    coefficient : (s, 3 f), of `design`'s terms; 0 for those left out
    """

    knots: Array
    mean: Array
    coefficient: Array

    def __call__(self, z: Array, x: Array) -> Array:
        """ln y (s, n) at the coordinates z (f,) of a map and counts x (n,)."""
        rows = design(np.broadcast_to(z, (len(x), len(z))), x)
        return self.means(x) + self.coefficient @ rows.T

    def means(self, x: Array) -> Array:
        """Means (s, n) at counts x (n,); beyond the measured ones those of the nearest."""
        found = np.full((len(self.mean), len(x)), np.nan)
        for row, mean in zip(found, self.mean, strict=True):
            known = np.isfinite(mean)
            if known.any():
                row[:] = np.interp(x, self.knots[known], mean[known])
        return found

    def __add__(self, other: "Regression") -> "Regression":
        """The regression of the product of two quantities: ln adds up."""
        return Regression(self.knots, self.mean + other.mean, self.coefficient + other.coefficient)

    def moved(self, z: Array, x: float) -> Array:
        """By how much each coordinate z (…, f) moves ln y from a map with all of them 0, (s, …, f).

        x : scaled logarithm of the count
        """
        size = z.shape[-1]
        shape = (len(self.mean),) + (1,) * (z.ndim - 1) + (size,)
        linear, square, product = (
            self.coefficient[:, k * size : (k + 1) * size].reshape(shape) for k in range(3)
        )
        return np.asarray((linear + x * product) * z + square * z * z)


@dataclass(frozen=True)
class Verdict:
    """What choosing by the model is worth at a budget, on maps that it has not seen.

    metric, league, kind, amount : by what, among whom, and with how much, e.g. 4 rays
    average : who is best on average over all maps
    choice, always, random : geometric mean over maps of the error of the chosen sampler, of whoever
        is best on average over the other maps, and of all in turn, over that of the best one there
    better : whether the choice is better than the average's by more than the standard error
    maps : how many
    """

    metric: str
    league: str
    kind: str
    amount: float
    average: str
    choice: float
    always: float
    random: float
    better: bool
    maps: int


@dataclass(frozen=True, eq=False)
class Model:
    """Errors and rays of samplers on maps.

    labels : what tables call each metric, the leading one last
    samplers, leagues, least : names, what each returns, and the smallest count of each
    counts : the numbers of lights that were measured
    maps, features : the measured maps (m,), and their features (m, f)
    errors : by metric, regressions; rays : of shadow and BRDF rays per sub-pixel
    measured, residuals : by metric, (m, s, c), measured errors, and ln of measured over predicted
        ones, predicted without the map; NaN where nothing was measured
    seconds_lights, seconds_per_ray : (s, c) and (s,), on a machine on which `REFERENCE` takes
        `machine_seconds` for a ray
    margins : by metric, by how much of ln error a prediction must lead to be followed
    verdicts : what a choice is worth, by budget
    source : what it was trained from, in words
    """

    labels: Mapping[str, str]
    samplers: tuple[str, ...]
    leagues: tuple[str, ...]
    least: tuple[int, ...]
    counts: tuple[int, ...]
    maps: tuple[str, ...]
    features: Array
    frame: Frame
    scale: CountScale
    errors: Mapping[str, Regression]
    rays: Regression
    measured: Mapping[str, Array]
    residuals: Mapping[str, Array]
    seconds_lights: Array
    seconds_per_ray: Array
    machine_seconds: float
    margins: Mapping[str, float]
    verdicts: tuple[Verdict, ...]
    source: Mapping[str, Any]

    def log_errors(self, metric: str, features: Array, counts: Array) -> Array:
        """ln of predicted errors (s, n) on a map of these features (f,) at counts (n,)."""
        return self.errors[metric](self.frame.point(features), self.scale(counts))

    def log_rays(self, features: Array, counts: Array) -> Array:
        """ln of predicted rays per sub-pixel, (s, n)."""
        return self.rays(self.frame.point(features), self.scale(counts))

    def off(self, count: float) -> Array:
        """How far each of the measured counts is from this one, (c,): |ln| of their ratio."""
        return np.abs(np.log(np.array(self.counts) / count))

    def place(self, count: float) -> int:
        """Where among the measured counts the nearest one stands."""
        return int(self.off(count).argmin())

    def interval(self, metric: str, sampler: int, count: float) -> tuple[float, float]:
        """Factors on a predicted error between which `SURE` of the left-out maps lie.

        The quantiles are those of one map more, the one at hand, which may be the most extreme.
        """
        found = self.residuals[metric][:, sampler, self.place(count)]
        found = found[np.isfinite(found)]
        return quantiles(found)

    def sureness(self, metric: str, one: int, other: int, counts: tuple[float, float],
                 gap: float) -> float:  # fmt: skip
        """Share of left-out maps on which a sampler stays before another.

        gap : ln of the predicted error of the other over that of the one; what the measured errors
            of both are off by is added, on each map
        """
        residuals = self.residuals[metric]
        off = residuals[:, other, self.place(counts[1])] - residuals[:, one, self.place(counts[0])]
        off = off[np.isfinite(off)]
        if not len(off):
            return math.nan
        return float((off + gap > 0.0).mean() + 0.5 * (off + gap == 0.0).mean())


def levels(residuals: Array) -> Array:
    """Quantiles (2, …) of residuals (n, …) between which `SURE` of n + 1 would lie."""
    n = len(residuals)
    place = ((n + 1) * 0.5 * (1.0 + SURE) - 1.0) / max(n - 1, 1)
    return np.asarray(np.quantile(residuals, [max(0.0, 1.0 - place), min(1.0, place)], axis=0))


def quantiles(residuals: Array) -> tuple[float, float]:
    """Factors between which `SURE` of errors lie, of n + 1 maps of which n are known."""
    if len(residuals) < 2:
        return 0.0, math.inf
    low, high = levels(residuals).tolist()
    return math.exp(low), math.exp(high)
