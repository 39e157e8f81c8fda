"""Probabilities of sorted blocks by a one-parameter law, its fit, and an exact table to compare.

With n blocks sorted by falling probability, p(x) = 1 / (ln(1 + n/α) (α + x)) on 0 ≤ x ≤ n follows
the block numbers. Its inverse, x = α ((1 + n/α)^ξ − 1), draws a block without a search. Block i is
drawn when i ≤ x < i + 1, so its probability is ln((α + i + 1)/(α + i)) / ln(1 + n/α).

Source: Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of environment maps",
Spring Conference on Computer Graphics 2012, section 3.2, equations 4–8. The L1 fit is made over
the spread c = ln(1 + n/α), from 1e-12 (flat) to 690 (one block): a grid, then golden section
about its best point, because the objective is not convex.
"""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel

FLATTEST, STEEPEST = 1e-12, 690.0
"""Bounds of c: flatter is constant to rounding, steeper overflows α."""
GRID = 400
GOLDEN_STEPS = 40


@kernel
def block_mass(i, n, alpha):
    """Probability that block i of n is drawn."""
    return math.log1p(1.0 / (alpha + i)) / math.log1p(n / alpha)


@kernel
def density_at(x, n, alpha):
    """p(x) of the law on 0 ≤ x ≤ n."""
    return 1.0 / (math.log1p(n / alpha) * (alpha + x))


@kernel
def _distance(probability, spread, at_points):
    """Σ |p̃ − model|, with the model's masses or, as published, its density at x = 1 … n."""
    n = len(probability)
    alpha = n / math.expm1(spread)
    total = 0.0
    for i in range(n):
        model = density_at(i + 1.0, n, alpha) if at_points else block_mass(i, n, alpha)
        total += abs(probability[i] - model)
    return total


@kernel
def fit_alpha(probability, at_points):
    """α of least L1 distance to the falling probabilities (n,), and that distance.

    at_points : compare with p(1) … p(n), as published, in place of the blocks' masses
    """
    step = math.log(STEEPEST / FLATTEST) / (GRID - 1)
    best, least = 0, math.inf
    for k in range(GRID):
        value = _distance(probability, FLATTEST * math.exp(k * step), at_points)
        if value < least:
            best, least = k, value
    low, high = max(0, best - 1) * step, min(GRID - 1, best + 1) * step
    place = best * step
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(GOLDEN_STEPS):
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        value_a = _distance(probability, FLATTEST * math.exp(a), at_points)
        value_b = _distance(probability, FLATTEST * math.exp(b), at_points)
        if value_a < least:
            place, least = a, value_a
        if value_b < least:
            place, least = b, value_b
        if value_a <= value_b:
            high = b
        else:
            low = a
    return len(probability) / math.expm1(FLATTEST * math.exp(place)), least


def masses(n: int, alpha: float) -> NDArray[np.float64]:
    """Probability (n,) that each block is drawn; they sum to 1."""
    return np.log1p(1.0 / (alpha + np.arange(n))) / np.log1p(n / alpha)


def densities(n: int, alpha: float) -> NDArray[np.float64]:
    """p(1) … p(n), the published probabilities of the blocks; they do not sum to 1."""
    return 1.0 / (np.log1p(n / alpha) * (alpha + np.arange(1, n + 1)))


@kernel
def alias_table(probability):
    """Threshold (n,) and alias (n,) of Vose's method for probabilities that sum to 1.

    Vose, "A linear algorithm for generating random numbers with a given distribution", 1991.
    """
    n = len(probability)
    scaled = probability * n
    threshold, alias = np.ones(n), np.arange(n)
    small, large = np.empty(n, np.int64), np.empty(n, np.int64)
    smalls = larges = 0
    for i in range(n):
        if scaled[i] < 1.0:
            small[smalls] = i
            smalls += 1
        else:
            large[larges] = i
            larges += 1
    while smalls > 0 and larges > 0:
        smalls -= 1
        less, more = small[smalls], large[larges - 1]
        threshold[less], alias[less] = scaled[less], more
        scaled[more] -= 1.0 - scaled[less]
        if scaled[more] < 1.0:
            larges -= 1
            small[smalls] = more
            smalls += 1
    return threshold, alias
