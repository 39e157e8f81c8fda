"""Which pixels of a map are light sources, and how a budget is shared between them and the rest.

A pixel is emissive if it is brighter than 98 % of the pixels, than 3 times the average and than a
thousandth of the maximum. The budget goes to the two regions in proportion to the importance
Γ = L ΔΩ^¼ of their integrated luminance L and solid angle ΔΩ.

Source: Wu, "Efficient environment map rendering based on decomposition", Computer Graphics Forum
44(1), 2025, section 3.2, Eq. 1 and 2; Γ is from Agarwal, Ramamoorthi, Belongie and Jensen,
"Structured importance sampling of environment maps", SIGGRAPH 2003.

The percentile is an exact order statistic, found by two histograms over the bits of the luminance.
With four passes over the map's luminance in all, the cost is linear in its pixels.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.map_kernels import ROWS
from samplers.threads import for_blocks

BRIGHT_SHARE = 0.98
"""Share of the map that is never emissive: L_b of Eq. 1 is this percentile."""
TIMES_AVERAGE = 3.0
"""λ of Eq. 1."""
TIMES_MAXIMUM = 0.001
"""γ of Eq. 1."""
HISTOGRAMS = 8
"""Partial histograms of a map."""


@dataclass(frozen=True, eq=False)
class Regions:
    """A map split in two, with what Eq. 2 needs of either part.

    emissive : (H, W) bool
    threshold : L_T; percentile, average, maximum : L_b, L_avg and L_max of Eq. 1
    emissive_flux, other_flux : ∫ Y dω of the two regions
    emissive_solid_angle, other_solid_angle : in sr
    """

    emissive: NDArray[np.bool_]
    threshold: float
    percentile: float
    average: float
    maximum: float
    emissive_flux: float
    other_flux: float
    emissive_solid_angle: float
    other_solid_angle: float


@kernel
def _high_histogram(bits, start, stop, histogram):
    """Values by their upper 16 bits; the order of bits is the order of floats ≥ 0."""
    for r in range(start, stop):
        for c in range(bits.shape[1]):
            histogram[(bits[r, c] & np.uint32(0x7FFFFFFF)) >> np.uint32(16)] += 1


@kernel
def _low_histogram(bits, high, start, stop, histogram):
    """Values whose upper 16 bits are `high` by their lower 16 bits."""
    for r in range(start, stop):
        for c in range(bits.shape[1]):
            value = bits[r, c] & np.uint32(0x7FFFFFFF)
            if value >> np.uint32(16) == high:
                histogram[value & np.uint32(0xFFFF)] += 1


def _cumulative(add: Callable, rows: int, bins: int) -> NDArray[np.int64]:
    """Running sums over the bins of a histogram that is made in parts."""
    block = -(-rows // HISTOGRAMS)
    partial = np.zeros((HISTOGRAMS, bins), np.int64)
    for_blocks(lambda a, b: add(a, b, partial[a // block]), rows, block)
    return np.cumsum(partial.sum(axis=0))


def quantile(value: NDArray[np.float32], share: float) -> float:
    """The least value of the map (H, W), none negative, that a `share` of it does not exceed."""
    bits = value.view(np.uint32)
    high = _cumulative(lambda a, b, out: _high_histogram(bits, a, b, out), len(bits), 1 << 15)
    target = math.ceil(share * value.size)
    upper = int(np.searchsorted(high, target))
    below = int(high[upper - 1]) if upper else 0
    low = _cumulative(
        lambda a, b, out: _low_histogram(bits, np.uint32(upper), a, b, out), len(bits), 1 << 16
    )
    lower = int(np.searchsorted(low, target - below))
    return float(np.array((upper << 16) | lower, np.uint32).view(np.float32))


@kernel
def _split_rows(luminance, threshold, start, stop, emissive, count, bright, dim):
    for r in range(start, stop):
        above = 0
        bright_sum = dim_sum = 0.0
        for c in range(luminance.shape[1]):
            value = np.float64(luminance[r, c])
            is_emissive = value > threshold
            emissive[r, c] = is_emissive
            if is_emissive:
                above += 1
                bright_sum += value
            else:
                dim_sum += value
        count[r], bright[r], dim[r] = above, bright_sum, dim_sum


def classify(environment: EnvironmentMap) -> Regions:
    """The emissive pixels of a map: Y > L_T = max(L_b, 3 L_avg, 0.001 L_max), Eq. 1.

    L_b counts pixels, as written; the average is over solid angle.
    """
    luminance, solid_angle = environment.luminance, environment.row_solid_angle
    height, width = luminance.shape
    percentile = quantile(luminance, BRIGHT_SHARE)
    average = environment.luminous_flux / (4.0 * math.pi)
    maximum = float(luminance.max())
    threshold = max(percentile, TIMES_AVERAGE * average, TIMES_MAXIMUM * maximum)
    emissive = np.empty((height, width), np.bool_)
    count, bright, dim = np.empty(height, np.int64), np.empty(height), np.empty(height)
    for_blocks(
        lambda a, b: _split_rows(luminance, threshold, a, b, emissive, count, bright, dim),
        height,
        ROWS,
    )
    return Regions(
        emissive=emissive,
        threshold=threshold,
        percentile=percentile,
        average=average,
        maximum=maximum,
        emissive_flux=float(solid_angle @ bright),
        other_flux=float(solid_angle @ dim),
        emissive_solid_angle=float(solid_angle @ count),
        other_solid_angle=float(solid_angle @ (width - count)),
    )


def budget(regions: Regions, count: int) -> tuple[int, int]:
    """(N, M): lights for the emissive and for the other region, N + M = count, Eq. 2.

    N = count · Γ_em / (Γ_em + Γ_other), rounded half up; either region gets a light if it has
    energy. One light alone stands for the whole map: N is 0, unless all energy is emissive. ΔΩ has
    no limit here, as Eq. 2 is printed; where Γ comes from, it counts up to 0.01 sr.
    """
    if not regions.emissive_flux > 0.0:
        return 0, count
    if not regions.other_flux > 0.0:
        return count, 0
    emissive = regions.emissive_flux * regions.emissive_solid_angle**0.25
    other = regions.other_flux * regions.other_solid_angle**0.25
    share = math.floor(count * (emissive / (emissive + other)) + 0.5)
    direct = min(max(share, 1), count - 1)
    return direct, count - direct
