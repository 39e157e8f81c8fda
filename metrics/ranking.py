"""Who is better, over many blocks: ranks, comparisons of pairs, and tests of either.

A block is what all methods are measured on alike, a map or a pair of scene and map. Within a block
methods are ranked by error, 1 for the smallest; ranks are then averaged over the blocks. The
Friedman test asks whether such differences in mean rank arise by chance, and Nemenyi's critical
difference says how far two mean ranks must lie apart before the two methods count as different.
Ranks hide sizes, so the geometric mean of the ratio to a baseline stands beside them, with an
interval from a bootstrap over the blocks.

Ranks, and with them Friedman's and Nemenyi's tests, depend on which other methods take part. What
is said of two methods must not, so they are compared with each other alone (`compare_pairs`): on
how many blocks one is better, by how much, and Wilcoxon's signed-rank test of the logarithms of the
ratio. Only the correction for there being many pairs, Holm's, knows of the others.

Sources: Friedman, "The use of ranks to avoid the assumption of normality implicit in the analysis
of variance", JASA 32, 1937; Nemenyi, "Distribution-free multiple comparisons", thesis, Princeton
1963; the form used is that of Demšar, "Statistical comparisons of classifiers over multiple data
sets", JMLR 7, 2006, section 3.2. The case against ranks among many: Benavoli, Corani and Mangili,
"Should we really use post-hoc tests based on mean-ranks?", JMLR 17, 2016. Wilcoxon, "Individual
comparisons by ranking methods", Biometrics Bulletin 1, 1945; Holm, "A simple sequentially
rejective multiple test procedure", Scandinavian Journal of Statistics 6, 1979. Bootstrap: Efron,
"Bootstrap methods: another look at the jackknife", Annals of Statistics 7, 1979.

Errors are (blocks, methods), smaller is better, without gaps: a block in which a method is missing
has to be left out by the caller, who knows why. A NaN raises EnvlightError.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.errors import EnvlightError

Ties = Literal["min", "average"]
CONFIDENCE, RESAMPLES, SEED = 0.95, 10_000, 20_250_101
"""Of intervals."""


def _checked(errors: ArrayLike, least_methods: int = 1) -> NDArray[np.float64]:
    table = np.asarray(errors, np.float64)
    if table.ndim != 2 or len(table) == 0 or table.shape[1] < least_methods:
        raise EnvlightError(
            f"ranking: errors of shape {table.shape}; wanted (blocks, methods) with at least one "
            f"block and {least_methods} methods"
        )
    if np.isnan(table).any():
        block, method = np.argwhere(np.isnan(table))[0]
        raise EnvlightError(
            f"ranking: no error in block {block} for method {method}; leave incomplete blocks out"
        )
    return table


def block_ranks(errors: ArrayLike, ties: Ties = "min") -> NDArray[np.float64]:
    """Ranks (blocks, methods) within each block, 1 for the smallest error.

    ties : "min" gives tied methods the best of the ranks that they share, as in a competition;
        "average" their mean, so that every block has the same sum of ranks, which tests need
    """
    from scipy.stats import rankdata

    if ties not in ("min", "average"):
        raise EnvlightError(f"ranking: ties are ranked by 'min' or 'average', not {ties!r}")
    return np.asarray(rankdata(_checked(errors), method=ties, axis=1), np.float64)


def mean_ranks(errors: ArrayLike, ties: Ties = "min") -> NDArray[np.float64]:
    """Mean over the blocks of each method's rank, (methods,)."""
    return block_ranks(errors, ties).mean(axis=0)


def mean_rank_intervals(ranks: ArrayLike) -> NDArray[np.float64]:
    """Both ends, (2, methods), of the bootstrap interval over blocks of each method's mean rank.

    ranks : (blocks, methods), among all methods: blocks are drawn anew, and nothing is ranked anew
    """
    return middle(resampled(_checked(ranks)))


@dataclass(frozen=True)
class FriedmanTest:
    """statistic : χ² with methods - 1 degrees of freedom, corrected for ties; its p-value."""

    statistic: float
    p_value: float
    blocks: int
    methods: int


def friedman_test(errors: ArrayLike) -> FriedmanTest:
    """Are the methods' errors drawn from the same distribution? At least three methods.

    The p-value comes from the χ² distribution, which needs about ten blocks or more to be good.
    Where every block is one single tie, the statistic is 0 and p is 1.
    """
    from scipy.stats import friedmanchisquare

    table = _checked(errors, least_methods=3)
    blocks, methods = table.shape
    if (table == table[:, :1]).all():
        return FriedmanTest(0.0, 1.0, blocks, methods)
    statistic, p_value = friedmanchisquare(*table.T)
    return FriedmanTest(float(statistic), float(p_value), blocks, methods)


def critical_difference(methods: int, blocks: int, level: float = 0.05) -> float:
    """Nemenyi: mean ranks farther apart than q √(k (k + 1) / 6N) differ at the significance level.

    q is the upper quantile of the studentised range for k methods and infinite degrees of freedom,
    divided by √2.
    """
    from scipy.stats import studentized_range

    if methods < 2 or blocks < 1 or not 0.0 < level < 1.0:
        raise EnvlightError(
            f"ranking: {methods} methods, {blocks} blocks, level {level}; wanted at least 2, at "
            "least 1, and a level between 0 and 1"
        )
    q = float(studentized_range.ppf(1.0 - level, methods, np.inf)) / math.sqrt(2.0)
    return q * math.sqrt(methods * (methods + 1) / (6.0 * blocks))


def indistinct_groups(ranks: ArrayLike, difference: float) -> list[tuple[int, ...]]:
    """The bars of a critical-difference diagram: largest groups whose mean ranks span too little.

    ranks : (methods,) mean ranks
    Returns the groups of two or more methods, as indices from best to worst.
    """
    mean = np.asarray(ranks, np.float64)
    order = np.argsort(mean, kind="stable")
    groups: list[tuple[int, ...]] = []
    covered = 0
    for first in range(len(order)):
        last = int(np.searchsorted(mean[order], mean[order[first]] + difference, side="right"))
        if last > covered and last - first > 1:
            groups.append(tuple(int(k) for k in order[first:last]))
        covered = max(covered, last)
    return groups


@dataclass(frozen=True, eq=False)
class GeometricRatio:
    """ratio : (methods,) geometric mean over blocks of error / baseline's error.

    low, high : (methods,) bootstrap interval
    """

    ratio: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def ratio_to_baseline(errors: ArrayLike, baseline: int) -> GeometricRatio:
    """How many times larger than the baseline's a method's error is, and how sure that is.

    baseline : column of the method to compare with; its own ratio is 1

    Blocks are drawn anew, with replacement, `RESAMPLES` times; the interval holds the middle
    `CONFIDENCE` of the ratios found. Methods share the draws; so do tables of as many blocks.

    Raises EnvlightError for errors of zero or infinity, of which no geometric mean exists.
    """
    table = _checked(errors)
    if not -table.shape[1] <= baseline < table.shape[1]:
        raise EnvlightError(f"ranking: baseline {baseline} of {table.shape[1]} methods")
    bad = ~((table > 0.0) & np.isfinite(table))
    if bad.any():
        block, method = np.argwhere(bad)[0]
        raise EnvlightError(
            f"ranking: the error {table[block, method]:g} in block {block} for method {method} "
            "has no ratio; all must be positive and finite"
        )
    logarithm = np.log(table)
    difference = logarithm - logarithm[:, baseline, None]
    means = resampled(logarithm)
    low, high = middle(means - means[:, baseline, None])
    return GeometricRatio(np.exp(difference.mean(axis=0)), np.exp(low), np.exp(high))


def mean_ratio(logarithms: ArrayLike) -> tuple[float, float, float]:
    """The geometric mean of ratios, from their logarithms (blocks,), and its interval as of
    `ratio_to_baseline`; NaN without a block."""
    values = np.asarray(logarithms, np.float64)
    if not len(values):
        return math.nan, math.nan, math.nan
    errors = np.exp(np.stack([np.zeros_like(values), values], axis=1))
    found = ratio_to_baseline(errors, 0)
    return float(found.ratio[1]), float(found.low[1]), float(found.high[1])


def resampled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means (RESAMPLES, methods) over blocks drawn anew with replacement, alike for all methods."""
    return _drawn(len(values)) @ values / len(values)


@lru_cache(maxsize=16)
def _drawn(blocks: int) -> NDArray[np.float64]:
    """How often each block is drawn, (RESAMPLES, blocks)."""
    even = np.full(blocks, 1.0 / blocks)
    return np.random.default_rng(SEED).multinomial(blocks, even, size=RESAMPLES).astype(np.float64)


def middle(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """What holds the middle `CONFIDENCE` of the values along the first axis: its two ends."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    return np.asarray(np.quantile(values, [tail, 1.0 - tail], axis=0))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Every method against every other, (methods, methods): the row's against the column's.

    wins, ties, losses : on how many blocks the row's error is the smaller one, equal, the larger
    ratio, low, high : geometric mean of the row's error over the column's, and its interval, over
        those blocks on which all methods' errors are positive and finite; NaN where there is none
    p_value : Wilcoxon's, corrected by Holm's method over all pairs; 1 on the diagonal
    """

    wins: NDArray[np.int64]
    ties: NDArray[np.int64]
    losses: NDArray[np.int64]
    ratio: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    p_value: NDArray[np.float64]


def compare_pairs(errors: ArrayLike) -> Pairs:
    """Compare every method with every other, block by block; ratios and intervals are those of
    `ratio_to_baseline`."""
    table = _checked(errors)
    methods = table.shape[1]
    wins = (table[:, :, None] < table[:, None, :]).sum(axis=0)
    ratio, low, high = (np.full((methods, methods), math.nan) for _ in range(3))
    positive = table[((table > 0.0) & np.isfinite(table)).all(axis=1)]
    if len(positive):
        logarithm = np.log(positive)
        means, mean = resampled(logarithm), logarithm.mean(axis=0)
        ratio = np.exp(mean[:, None] - mean[None, :])
        low, high = np.ones((2, methods, methods))
        for a in range(methods - 1):
            low[a, a + 1 :], high[a, a + 1 :] = np.exp(middle(means[:, [a]] - means[:, a + 1 :]))
            low[a + 1 :, a], high[a + 1 :, a] = 1.0 / high[a, a + 1 :], 1.0 / low[a, a + 1 :]
    p_value = np.ones((methods, methods))
    rows, columns = np.triu_indices(methods, 1)
    found = holm(_signed_ranks(_log_ratio(table[:, rows], table[:, columns])))
    p_value[rows, columns] = p_value[columns, rows] = found
    return Pairs(wins, len(table) - wins - wins.T, wins.T, ratio, low, high, p_value)


def _log_ratio(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """log(a / b), 0 where both are equal, also where both are 0 or infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(a == b, 0.0, np.log(a) - np.log(b))


def signed_rank(differences: ArrayLike) -> float:
    """Wilcoxon's two-sided p-value; differences of zero are left out, and 1 where none is left."""
    from scipy.stats import wilcoxon

    values = np.asarray(differences, np.float64)
    changed = values[values != 0.0]
    return float(wilcoxon(changed).pvalue) if len(changed) else 1.0


def _signed_ranks(differences: NDArray[np.float64]) -> NDArray[np.float64]:
    """`signed_rank` of each column; those without zeros and ties at once, which is 40 times as
    fast."""
    from scipy.stats import wilcoxon

    sizes = np.sort(np.abs(differences), axis=0)
    plain = (sizes[0] > 0.0) & (sizes[1:] > sizes[:-1]).all(axis=0)
    found = np.empty(differences.shape[1])
    if plain.any():
        found[plain] = wilcoxon(differences[:, plain], axis=0).pvalue
    found[~plain] = [signed_rank(column) for column in differences[:, ~plain].T]
    return found


def holm(p_values: ArrayLike) -> NDArray[np.float64]:
    """p-values corrected for there being several: the k-th smallest of n times n + 1 - k, at most
    1, and never below a smaller one's."""
    found = np.asarray(p_values, np.float64)
    order = np.argsort(found, kind="stable")
    factors = np.arange(len(found), 0, -1)
    corrected = np.empty(len(found))
    corrected[order] = np.minimum(np.maximum.accumulate(found[order] * factors), 1.0)
    return corrected
