"""Integrals of a density over the texels of a map, and how far they may be off."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from samplers.sphere import direction_from_uv, pixel_of_direction, row_solid_angle

FINE = 8
"""Midpoints along each side of a texel, by which a density is integrated."""
DIRECTIONS = 1 << 20
"""Directions looked up at once."""
Density = Callable[[NDArray[np.float32]], NDArray[np.float32]]


def texel_masses(
    pdf: Density,
    height: int,
    drawn: NDArray[np.float32],
    density: NDArray[np.float32],
    fine: int = FINE,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """∫ pdf dω over each texel (H, 2H) by fine² midpoints, and how far it may be off.

    drawn, density : directions (n, 3) and their densities (n,), which may show of a texel what no
        midpoint does

    Exact, up to float32 rounding, where the density is constant over texels or their `fine` parts.
    The edge of a cell that lies across a texel passes about `fine` of the fine² parts, and is wrong
    by a uniform share of each: 0.29 · fine^-1.5 of the step, as a standard deviation. The whole
    fine^-1.5 of the density's range is returned, which leaves room for several edges; what is
    smooth errs less.
    """
    mass = np.empty((height, 2 * height))
    low, high = _range_of_samples(drawn, density, height)
    across = (np.arange(2 * height * fine) + 0.5) / (2 * height * fine)
    fine_solid_angle = row_solid_angle(fine * height, 2 * fine * height).reshape(height, fine)
    rows = max(1, DIRECTIONS // (2 * height * fine**2))
    for first in range(0, height, rows):
        block = slice(first, min(first + rows, height))
        v = (np.arange(first * fine, block.stop * fine) + 0.5) / (height * fine)
        direction = direction_from_uv(across[None], v[:, None]).reshape(-1, 3)
        parts = pdf(direction.astype(np.float32)).reshape(-1, fine, 2 * height, fine)
        mass[block] = np.einsum("rfcg,rf->rc", parts, fine_solid_angle[block], dtype=np.float64)
        low[block] = np.minimum(low[block], parts.min(axis=(1, 3)))
        high[block] = np.maximum(high[block], parts.max(axis=(1, 3)))
    step = np.where(high - low > 1e-5 * high, high - low, 0.0)  # less is rounding
    return mass, step * row_solid_angle(height, 2 * height)[:, None] * fine**-1.5


def integral_error(mass: NDArray[np.float64], error: NDArray[np.float64]) -> float:
    """By how much a density's integral misses 1, beyond five standard deviations of the sum."""
    off = abs(float(mass.sum()) - 1.0)
    return max(0.0, off - 5.0 * float(np.sqrt((error**2).sum())))


def _range_of_samples(
    drawn: NDArray[np.float32], pdf: NDArray[np.float32], height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest density of the samples in each texel, which may fall between midpoints."""
    texel = pixel_of_direction(drawn, height)
    low, high = np.full((height, 2 * height), np.inf), np.zeros((height, 2 * height))
    np.minimum.at(low, texel, pdf.astype(np.float64))
    np.maximum.at(high, texel, pdf.astype(np.float64))
    return low, high
