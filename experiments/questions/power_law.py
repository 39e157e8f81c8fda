"""Error as a power of cost: slopes by least squares of logarithms, with intervals.

log error = a + b · log cost. Independent samples have b = −1/2, stratified ones are steeper. The
interval is Student's, from the residuals, with n − 2 degrees of freedom: it says how well a power
law holds over the budgets measured, and not how errors of other maps would scatter.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

LEAST_POINTS = 3


@dataclass(frozen=True)
class PowerLaw:
    """error ≈ level · cost^slope. low, high : the slope's 95 % interval; points : behind the fit"""

    slope: float
    low: float
    high: float
    level: float
    points: int

    def at(self, cost: float) -> float:
        """The error that the law gives at a cost."""
        return self.level * cost**self.slope


def fit_power_law(cost: ArrayLike, error: ArrayLike, confidence: float = 0.95) -> PowerLaw | None:
    """The law through points (n,) each; None with fewer than three positive, finite points or
    fewer than three different costs."""
    from scipy.stats import t

    x, y = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    good = (x > 0.0) & (y > 0.0) & np.isfinite(x) & np.isfinite(y)
    x, y = np.log(x[good]), np.log(y[good])
    if len(np.unique(x)) < LEAST_POINTS:
        return None
    spread = float(((x - x.mean()) ** 2).sum())
    slope = float(((x - x.mean()) * (y - y.mean())).sum()) / spread
    start = float(y.mean()) - slope * float(x.mean())
    freedom = len(x) - 2
    residual = float(((y - start - slope * x) ** 2).sum()) / freedom
    reach = float(t.ppf(0.5 + 0.5 * confidence, freedom)) * math.sqrt(residual / spread)
    return PowerLaw(slope, slope - reach, slope + reach, math.exp(start), len(x))


def cost_to_reach(cost: ArrayLike, error: ArrayLike, target: float) -> float:
    """The least cost at which the error is at most `target`, between measured points only.

    Between neighbouring points, in order of cost, logarithms are interpolated. Infinite where no
    measured error is that small; the first cost where already its error is.
    """
    order = np.argsort(np.asarray(cost, np.float64), kind="stable")
    x, y = np.asarray(cost, np.float64)[order], np.asarray(error, np.float64)[order]
    reached = np.flatnonzero(y <= target)
    if not len(reached):
        return math.inf
    last = int(reached[0])
    if last == 0:
        return float(x[0])
    if not (y[last] > 0.0 and x[last - 1] > 0.0):
        return float(x[last])
    high, low = math.log(y[last - 1]), math.log(y[last])
    part = (high - math.log(target)) / (high - low) if target > 0.0 else 1.0
    return float(math.exp(math.log(x[last - 1]) * (1.0 - part) + math.log(x[last]) * part))
