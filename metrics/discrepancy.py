"""Generalised discrepancy: how far a pattern of points is from covering the sphere evenly.

D = (1 / (2 √π N)) √ Σᵢⱼ (1 − 2 ln(1 + √((1 − cos γᵢⱼ) / 2))) with γᵢⱼ the angle between two of N
points. It is the worst error of the points' plain mean over functions of unit norm in a Sobolev
space: 0 is even, √(1 / 4πN) is the root mean square of random points, and lower is better. It
judges patterns that are meant to be uniform, not the lights of an adaptive sampler.

Source: Cui and Freeden, "Equidistribution on the sphere", SIAM Journal on Scientific Computing 18,
1997; used to compare patterns of directions in Wan, Wong and Leung, "Spherical Q²-tree for sampling
dynamic environment sequences", EGSR 2005, equation 7.

Cost O(N²), compiled and threaded: about 10⁸ pairs a second on two cores.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.compiled import kernel
from samplers.errors import EnvlightError
from samplers.threads import for_blocks

ROWS = 64
"""Points per block."""
FACTORS = 128
"""Factors of at most 2 that are multiplied before one logarithm is taken of all of them."""
UNIT_TOLERANCE = 1e-5


@kernel
def _log_sums(point, start, stop, out):
    """Σ ln(1 + |a − b| / 2) of each point with all later ones; half a chord is the root in D."""
    for i in range(start, stop):
        total, product = 0.0, 1.0
        x, y, z = point[i]
        for j in range(i + 1, len(point)):
            dx, dy, dz = x - point[j, 0], y - point[j, 1], z - point[j, 2]
            product *= 1.0 + 0.5 * math.sqrt(dx * dx + dy * dy + dz * dz)
            if (j - i) % FACTORS == 0:
                total += math.log(product)
                product = 1.0
        out[i] = total + math.log(product)


def generalized_discrepancy(points: ArrayLike) -> float:
    """D of the unit vectors (n, 3).

    Raises EnvlightError for another shape, no points, or points off the unit sphere.
    """
    point: NDArray[np.float64] = np.ascontiguousarray(points, np.float64)
    if point.ndim != 2 or point.shape[1] != 3 or len(point) == 0:
        raise EnvlightError(f"discrepancy: points of shape {point.shape}; wanted (n, 3), n ≥ 1")
    length = np.linalg.norm(point, axis=1, keepdims=True)
    if not (np.abs(length - 1.0) < UNIT_TOLERANCE).all():
        raise EnvlightError("discrepancy: a point is not of unit length")
    point = point / length
    count, sums = len(point), np.empty(len(point))
    for_blocks(lambda a, b: _log_sums(point, a, b, sums), count, ROWS)
    # Each pair counts twice, a point with itself contributes exactly 1.
    total = float(count) ** 2 - 4.0 * math.fsum(sums)
    return math.sqrt(max(0.0, total)) / (2.0 * math.sqrt(math.pi) * count)
