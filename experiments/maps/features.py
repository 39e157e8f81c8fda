"""What samplers respond to, measured on any map.

How much of the light comes from how little of the sphere decides what a set of lights can do with
it: a sun wants one light exactly there, an overcast sky wants many anywhere. Each feature is one
number of a map that says something of this kind. All are shares, ratios, counts or angles: they do
not change when the map is scaled, nor when it turns about the vertical by whole columns. Every map
has all of them, finite; a black map has those of a constant one.

`survey` computes what they share.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.maps.survey import BANDS, OCTAVES, SECTORS, SPHERE, Survey
from samplers import EnvironmentMap

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
