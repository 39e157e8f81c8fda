"""Do other random numbers explain that the seeds of a case differ between two runs?

They cannot where a sampler drew the same ones: where seeds of a case agree to the last digit, all
of that case must; where most of a sampler's rows do, all of them must. Else the noise that a case
may have is what the other cases of its sampler show: the relative variance between seeds of one
run, pooled as Smyth pools those of genes. A case's own variance has as much weight as its seeds
give it, so that a row that is off does not excuse itself. Of each case and metric these are tested:

- whether the means of both runs differ (F of one degree, the square of a t-test);
- whether the seeds of either run spread more than those of the other and the pool do (F).

A rare outlier, such as a light that a sampler hardly ever draws leaves in an image, is told from a
row that is off where other cases of the sampler have some, too. Values below the noise floor's
`NEAR` times are taken as that, as in rankings.

Source: Smyth, "Linear models and empirical Bayes methods for assessing differential expression in
microarray experiments", Statistical Applications in Genetics and Molecular Biology 3, 2004, section
6; the degrees of freedom are found here from quantiles, which single outliers do not move.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metrics.ranking import signed_rank

Array = NDArray[np.float64]
Places = Sequence[NDArray[np.intp]]
TESTS = 3
"""Tests of a case by one metric."""
DEGREES = 2.0 ** np.arange(0, 13)
"""Degrees of freedom that a pool may have."""
TAIL = np.array([0.75, 0.9, 0.97])
"""Quantiles by which variances are found to be less alike than chance has them."""


@dataclass(frozen=True)
class Noise:
    """A pooled relative variance. degrees : of freedom, 0 where nothing is known"""

    variance: float = 0.0
    degrees: float = 0.0

    def with_own(self, *own: float, degrees: float) -> "Noise":
        """The same with variances of a case itself, each of so many degrees of freedom."""
        total = self.degrees + degrees * len(own)
        return Noise((self.degrees * self.variance + degrees * sum(own)) / total, total)


def explained(
    a: Array, b: Array, cases: Places, doubtful: Sequence[int], levels: Array
) -> list[int]:
    """Which of the doubtful cases of a sampler seeds explain, by their places in `cases`.

    a, b : (rows, metrics), finite, both runs' values
    levels : of a test of one case, and of one whether all cases are shifted
    """
    width = a.shape[1]
    for k in range(width):
        ours, theirs = (
            np.array([table[cases[one], k].mean() for one in doubtful]) for table in (a, b)
        )
        if _shifted(ours, theirs, levels[1]):
            return []
    variances = np.array([_variances(a, b, places) for places in cases])
    seeds = np.array([len(places) for places in cases])
    found = []
    for one in doubtful:
        others = np.arange(len(cases)) != one
        pools = [
            pooled(variances[others, :, k].ravel(), np.repeat(seeds[others] - 1.0, 2))
            for k in range(width)
        ]
        if all(
            _alike(a[cases[one], k], b[cases[one], k], pools[k], levels[0]) for k in range(width)
        ):
            found.append(one)
    return found


def _shifted(a: Array, b: Array, level: float) -> bool:
    """Whether values of one side are the larger ones over cases, more than chance explains."""
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.where(a == b, 0.0, np.log(a / b))
    return signed_rank(logarithm[~np.isnan(logarithm)]) < level


def _relative(a: Array, b: Array) -> tuple[Array, Array]:
    """Both sets of seeds in units of their median size, or mean where that is 0."""
    both = np.abs(np.concatenate([a, b]))
    unit = float(np.median(both)) or float(both.mean()) or 1.0
    return a / unit, b / unit


def _variances(a: Array, b: Array, places: NDArray[np.intp]) -> Array:
    """(2, metrics) the relative variances between the seeds of a case in either run."""
    columns = [_relative(a[places, k], b[places, k]) for k in range(a.shape[1])]
    return np.array([[side.var(ddof=1) for side in sides] for sides in columns]).T


def pooled(variances: Array, degrees: Array) -> Noise:
    """What variances of several cases tell of that of another: their scale, and how alike they are.

    Those of the same true variance would spread as F with infinite degrees of freedom; how much
    more they do tells the degrees, which are no more than all of them have. Variances of 0 are of
    cases without noise, and tell nothing.
    """
    from scipy.special import fdtri

    positive = np.isfinite(variances) & (variances > 0.0)
    if positive.sum() < 2:
        return Noise()
    own, most = float(np.median(degrees[positive])), float(degrees[positive].sum())
    middle = float(np.median(variances[positive]))
    high = np.quantile(variances[positive], TAIL) / middle
    tried = DEGREES[most >= DEGREES, None]
    wide = (fdtri(own, tried, TAIL) / fdtri(own, tried, 0.5) >= high).all(axis=1)
    found = float(tried[wide].max(initial=DEGREES[0]))
    return Noise(middle / float(fdtri(own, found, 0.5)), found)


def _alike(a: Array, b: Array, pool: Noise, level: float) -> bool:
    """Whether two sets of seeds are not told apart; equal sets are not, constant others are."""
    from scipy.special import fdtrc

    if np.array_equal(a, b):
        return True
    a, b = _relative(a, b)
    own = [float(side.var(ddof=1)) for side in (a, b)]
    if own == [0.0, 0.0]:
        return False
    degrees = len(a) - 1.0
    both = pool.with_own(*own, degrees=degrees)
    square = float(a.mean() - b.mean()) ** 2 / (both.variance * 2.0 / len(a))
    p_values = [float(fdtrc(1.0, both.degrees, square))]
    for one, other in (own, own[::-1]):
        rest = pool.with_own(other, degrees=degrees)
        ratio = one / rest.variance if rest.variance > 0.0 else np.inf
        p_values.append(float(fdtrc(degrees, rest.degrees, ratio)) if one > 0.0 else 1.0)
    return min(p_values) >= level
