"""What samplers respond to, measured on any map.

How much of the light comes from how little of the sphere decides what a set of lights can do with
it: a sun wants one light exactly there, an overcast sky wants many anywhere. Each feature is one
number of a map that says something of this kind. All are shares, ratios, counts or angles: they do
not change when the map is scaled, nor when it turns about the vertical by whole columns. Every map
has all of them, finite; a black map has those of a constant one.

A `Survey` computes what they share, in four passes over the texels besides sorting the brightest
tenth. Where texels would count, a coarse map of equal cells stands in for the map: 128 bands of
equal height in z = cos θ, each cell a 256th of a turn wide. By Archimedes all cells have the solid
angle 4π/32768, and what a row of texels shares with a band is a difference of cosines: means over
cells are exact for maps of any size. Windows of a cell's width begin at every column of the map, so
that no turn of the map by whole columns changes what they see.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from samplers import EnvironmentMap
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
    bits, size = np.ascontiguousarray(value).view(np.uint32), 1 << 16
    high = np.zeros(size)
    for row, weight in zip(bits, row_weight, strict=True):
        high += weight * np.bincount(row >> 16, minlength=size)
    high = np.cumsum(high)
    target = share * high[-1]
    upper = int(np.searchsorted(high, target))
    below = high[upper - 1] if upper else 0.0
    lit, column = np.nonzero(bits >> 16 == upper)
    low = below + np.cumsum(np.bincount(bits[lit, column] & 0xFFFF, row_weight[lit], size))
    lower = min(int(np.searchsorted(low, target)), size - 1)
    return float(np.array([upper << 16 | lower], np.uint32).view(np.float32)[0])


PREFIX = "map_"
FINE = 16.0
"""Texture counts from this angular degree on, the first of an octave."""


@dataclass(frozen=True)
class Feature:
    """One number of a map.

    unit : what it is counted in; meaning : one line for tables and pages
    """

    name: str
    unit: str
    meaning: str
    measure: Callable[[Survey], float]


FEATURES: dict[str, Feature] = {}
"""All features by name, in the order in which they are shown."""

Measure = Callable[[Survey], float]


def feature(name: str, unit: str, meaning: str) -> Callable[[Measure], Measure]:
    """Enter the decorated function under a name."""

    def enter(measure: Measure) -> Measure:
        if name in FEATURES:
            raise ValueError(f"feature '{name}' is there already")
        FEATURES[name] = Feature(name, unit, meaning, measure)
        return measure

    return enter


def map_features(environment: EnvironmentMap) -> dict[str, float]:
    """Every feature of a map by the name of its column, such as `map_contrast`; all are finite."""
    survey = Survey(environment)
    return {f"{PREFIX}{name}": float(found.measure(survey)) for name, found in FEATURES.items()}


def share_in_brightest(survey: Survey, part: float) -> float:
    """Share of the energy that comes from the brightest `part` ≤ 0.1 of the sphere.

    Texels are ranked by luminance and counted by solid angle, the last one in proportion. A
    constant map gives `part` itself.
    """
    solid_angle, energy = survey.brightest
    return float(np.interp(part * SPHERE, solid_angle, energy)) / survey.energy


for _percent in (0.01, 0.1, 1, 10):
    feature(
        f"share_in_{_percent}_percent".replace(".", "_"),
        "share",
        f"energy that comes from the brightest {_percent} % of the sphere",
    )(partial(share_in_brightest, part=_percent / 100))


@feature("share_in_emitters", "share", "energy that comes from emissive texels")
def share_in_emitters(survey: Survey) -> float:
    """Share of the energy that Eq. 1 of Wu 2025 calls emissive; 0 where it finds nothing.

    A map of fewer than 50 texels has no emitters: its brightest texel is its 98th percentile.
    """
    return float(survey.emitters.energy.sum()) / survey.energy


@feature("emitters", "count", "connected regions of emissive texels")
def emitter_count(survey: Survey) -> float:
    """Number of connected regions of emissive texels, large and small; 0 where there is none."""
    return float(len(survey.emitters.energy))


@feature("effective_emitters", "count", "regions of equal energy that would be as spread out")
def effective_emitters(survey: Survey) -> float:
    """(Σ e)² / Σ e² over the energies of the emitters: faint ones hardly count; 0 without any."""
    energy = survey.emitters.energy
    if not len(energy):
        return 0.0
    share = energy / energy.sum()
    return float(1.0 / (share @ share))


@feature("emitter_size", "degrees", "angular diameter of emitters, weighted by energy")
def emitter_size(survey: Survey) -> float:
    """Mean diameter of caps as large as the emitters, weighted by their energy; the sun's is 0.53.

    Without emitters the sphere itself is the light, and its diameter is 360.
    """
    found = survey.emitters
    if not len(found.energy):
        return 360.0
    half_angle = 2.0 * np.arcsin(np.sqrt(np.minimum(found.solid_angle / SPHERE, 1.0)))
    share = found.energy / found.energy.sum()
    return math.degrees(2.0 * float(share @ half_angle))


@feature("entropy", "share", "how evenly the energy is spread: 1 constant, 0 all in one cell")
def entropy(survey: Survey) -> float:
    """Entropy of the energy over the coarse map's cells, divided by that of a constant map."""
    level = survey.coarse
    # The mean of L log L over windows of equal size, with L of mean 1; L log L is 0 at 0.
    excess = np.mean(level * np.log(np.where(level > 0.0, level, 1.0)))
    return float(1.0 - excess / math.log(BANDS * SECTORS))


@feature("contrast", "ratio", "largest over mean luminance")
def contrast(survey: Survey) -> float:
    """Luminance of the brightest texel over the mean over the sphere; it grows with resolution."""
    return float(survey.environment.luminance.max()) * SPHERE / survey.energy


@feature("texture", "stops", "variation of the luminance over a few degrees")
def texture(survey: Survey) -> float:
    """Standard deviation of log₂ luminance along rows at angular degrees 16 to 64 (22° to 6°).

    Luminances far below a ten-thousandth of the mean count as that. 0 for a constant map.
    """
    fine = [k for k, start in enumerate(OCTAVES[:-1]) if start >= FINE]
    return math.sqrt(float(survey.octave_power()[fine].sum()))


@feature("spectral_slope", "power of the degree", "how fast texture falls off towards fine detail")
def spectral_slope(survey: Survey) -> float:
    """Slope of log power density of log luminance over log angular degree, 4 to 64, along rows.

    0 for noise whose texels have nothing to do with each other, about −2 for areas with edges, less
    for smooth maps. 0 too where there are not two octaves with any power: no texture has no slope.
    """
    power = survey.octave_power()
    known = np.flatnonzero(power > 1e-12)  # below a millionth of a stop is rounding
    if len(known) < 2:
        return 0.0
    start = np.array(OCTAVES[:-1])[known]
    # An octave is as wide as its lower bound: density is power over that.
    return float(np.polyfit(np.log2(start), np.log2(power[known] / start), 1)[0])


@feature("share_above_horizon", "share", "energy that comes from above the horizon")
def share_above_horizon(survey: Survey) -> float:
    """Share of the energy from directions with y > 0; half of a row that the horizon cuts."""
    height = len(survey.row_energy)
    upper = survey.row_energy[: height // 2].sum()
    if height % 2:
        upper += 0.5 * survey.row_energy[height // 2]
    return float(upper) / survey.energy
