"""What the features of a map are made of, each computed when it is first asked for.

Where texels would count, a coarse map of equal cells stands in for the map: 128 bands of equal
height in z = cos θ, each cell a 256th of a turn wide. By Archimedes all cells have the solid angle
4π/32768, and what a row of texels shares with a band is a difference of cosines: means over cells
are exact for maps of any size. Windows of a cell's width begin at every column of the map, instead
of at every 256th of a turn, so that no turn of the map by whole columns changes what they see.

A black map has no ratios; it is measured as what it is the limit of, a map of constant radiance.

Cost: four passes over the texels, besides sorting the brightest tenth.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from samplers import EnvironmentMap
from samplers.compiled import kernel
from samplers.decomposition.emissive import Regions, classify

Array = NDArray[np.float64]

SPHERE = 4.0 * math.pi
BANDS, SECTORS = 128, 256
"""Cells of the coarse map from pole to pole and round the horizon."""
FLOOR = 1e-4
"""Share of the mean luminance that is added before a logarithm is taken."""
WIDEST_BAND = 0.75
"""Texture is measured where |cos θ| is below this: three quarters of the sphere."""
OCTAVES = (4.0, 8.0, 16.0, 32.0, 64.0)
"""Bounds of the octaves of angular degree, in waves per turn of a great circle."""


@dataclass(frozen=True, eq=False)
class Emitters:
    """The connected components of a map's emissive texels.

    energy : (n,) ∫ Y dω of each; solid_angle : (n,) in sr
    """

    energy: Array
    solid_angle: Array


class Survey:
    """A map, and what is known of it."""

    def __init__(self, environment: EnvironmentMap) -> None:
        if not environment.luminance.any():
            environment = EnvironmentMap(np.ones_like(environment.radiance), environment.name)
        self.environment = environment

    @cached_property
    def row_energy(self) -> Array:
        """∫ Y dω over each row, (H,)."""
        rows = self.environment.luminance.sum(axis=1, dtype=np.float64)
        return np.asarray(rows * self.environment.row_solid_angle)

    @cached_property
    def energy(self) -> float:
        """∫ Y dω over the sphere."""
        return float(self.row_energy.sum())

    @cached_property
    def brightest(self) -> tuple[Array, Array]:
        """Solid angle in sr, rising, and the energy that its brightest part of that size holds.

        A texel is constant, so that between two entries energy grows in proportion. The last entry
        ends the brightest tenth, of which the darkest part may have one luminance.
        """
        environment = self.environment
        luminance, solid_angle = environment.luminance, environment.row_solid_angle
        level = weighted_quantile(luminance, solid_angle, 0.9)
        texel = np.flatnonzero(luminance > level)
        value = luminance.ravel()[texel]
        order = np.argsort(value)[::-1]
        share = solid_angle[texel[order] // environment.width]
        size = np.concatenate([[0.0], np.cumsum(share)])
        energy = np.concatenate([[0.0], np.cumsum(share * value[order])])
        rest = max(0.1 * SPHERE - size[-1], 0.0)
        return np.append(size, size[-1] + rest), np.append(energy, energy[-1] + rest * level)

    @cached_property
    def regions(self) -> Regions:
        """The emissive texels of Wu 2025, Eq. 1, and the rest."""
        return classify(self.environment)

    @cached_property
    def emitters(self) -> Emitters:
        """Emissive texels that share a side or a corner, over the seam and over the poles too."""
        environment, emissive = self.environment, self.regions.emissive
        row, column = np.nonzero(emissive)
        component = _components(emissive, row, column)
        solid_angle = environment.row_solid_angle[row]
        energy = environment.luminance[row, column] * solid_angle
        sums = (np.bincount(component, weight) for weight in (energy, solid_angle))
        return Emitters(*(np.asarray(total, np.float64) for total in sums))

    @cached_property
    def coarse(self) -> Array:
        """Mean luminance over the map's mean in cells of equal solid angle, (128, W)."""
        luminance = self.environment.luminance
        height, width = luminance.shape
        row = np.cos(np.arange(height + 1) * (math.pi / height))
        band = np.linspace(1.0, -1.0, BANDS + 1)
        mean = np.empty((BANDS, width))
        for k, (top, bottom) in enumerate(pairwise(band)):
            overlap = np.minimum(row[:-1], top) - np.maximum(row[1:], bottom)
            met = np.flatnonzero(overlap > 0.0)
            used = slice(met[0], met[-1] + 1)
            mean[k] = overlap[used] @ luminance[used] / (top - bottom)
        return _windows(mean, width / SECTORS) * (SPHERE / self.energy)

    @cached_property
    def spectrum(self) -> tuple[Array, Array]:
        """Angular degrees (m,) and the power at each of log₂ luminance along rows, in stops².

        Power is that of one row's circle, by its share of all rows that are looked at; the fall-off
        that the windows of `coarse` cause is taken out. Waves of two cells and shorter are left
        out; with them the powers would add up to the variance along rows.
        """
        z = (np.arange(BANDS) + 0.5) * (2.0 / BANDS) - 1.0
        used = np.abs(z) < WIDEST_BAND
        rows = np.log2(self.coarse[used] + FLOOR)
        cells = min(rows.shape[1], SECTORS)  # round the horizon: texels, or windows of many
        wave = np.fft.rfft(rows, axis=1)[:, 1 : (cells + 1) // 2] / rows.shape[1]
        count = np.arange(1, wave.shape[1] + 1)
        power = 2.0 * np.abs(wave) ** 2 / np.sinc(count / cells) ** 2 / used.sum()
        degree = count / np.sqrt(1.0 - z[used] ** 2)[:, None]
        return degree.ravel(), power.ravel()

    def octave_power(self) -> Array:
        """Power in each of the octaves of degree, (4,), in stops²."""
        degree, power = self.spectrum
        return np.histogram(degree, OCTAVES, weights=power)[0]


def _components(
    lit: NDArray[np.bool_], row: NDArray[np.int64], column: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The component (n,) of each lit texel, given by their rows and columns (n,) in their order."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    height, width = lit.shape
    number = np.full((height + 1, width), -1, np.int32)  # and nothing below the last row
    number[row, column] = np.arange(len(row), dtype=np.int32)
    one, other = [], []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        near = number[row + down, (column + right) % width]
        one.append(np.flatnonzero(near >= 0))
        other.append(near[near >= 0])
    for pole in (number[0], number[height - 1]):
        met = pole[pole >= 0]
        one.append(met[:-1])
        other.append(met[1:])
    joined = np.concatenate(one), np.concatenate(other)
    graph = coo_array((np.ones(len(joined[0]), np.bool_), joined), (len(row), len(row)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _windows(rows: Array, size: float) -> Array:
    """Means over the `size` columns, not a whole number, that follow each column's left edge."""
    count, width = rows.shape
    around = np.concatenate([rows, rows[:, : math.ceil(size) + 1]], axis=1)
    total = np.zeros((count, around.shape[1] + 1))
    np.cumsum(around, axis=1, out=total[:, 1:])
    whole = math.floor(size)
    part = size - whole
    end = total[:, whole : whole + width]
    if part > 0.0:
        end = end + part * around[:, whole : whole + width]
    return (end - total[:, :width]) / size


def weighted_quantile(value: NDArray[np.float32], row_weight: Array, share: float) -> float:
    """The least value of a map (H, W) that at least `share` of the weight does not exceed.

    row_weight : (H,) weight of each texel of a row. Values must not be negative: then their bits
        have the same order as they, and two passes over halves of the bits find one without a sort.
    """
    bits = np.ascontiguousarray(value).view(np.uint32)
    high, low = np.zeros(1 << 16), np.zeros(1 << 16)
    _weigh_upper(bits, row_weight, high)
    high = np.cumsum(high)
    target = share * high[-1]
    upper = int(np.searchsorted(high, target))
    below = high[upper - 1] if upper else 0.0
    _weigh_lower(bits, np.uint32(upper), row_weight, low)
    low = below + np.cumsum(low)
    lower = min(int(np.searchsorted(low, target)), len(low) - 1)
    return float(np.array([upper << 16 | lower], np.uint32).view(np.float32)[0])


@kernel
def _weigh_upper(bits, row_weight, weight):
    """Add the weights of texels by the upper half of their bits, in their order."""
    for r in range(bits.shape[0]):
        for c in range(bits.shape[1]):
            weight[bits[r, c] >> np.uint32(16)] += row_weight[r]


@kernel
def _weigh_lower(bits, upper, row_weight, weight):
    """Add the weights of texels of this upper half by the lower half of their bits."""
    for r in range(bits.shape[0]):
        for c in range(bits.shape[1]):
            if bits[r, c] >> np.uint32(16) == upper:
                weight[bits[r, c] & np.uint32(0xFFFF)] += row_weight[r]
