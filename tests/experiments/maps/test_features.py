"""Features of maps: closed forms, brute force, and what must not change them."""

import math
from itertools import pairwise

import numpy as np
import pytest

from experiments.maps.features import (
    BANDS,
    FEATURES,
    FLOOR,
    OCTAVES,
    PREFIX,
    WIDEST_BAND,
    Survey,
    feature,
    map_features,
)
from samplers import EnvironmentMap
from samplers.sphere import angular_distance, pixel_directions, row_solid_angle
from tests.robustness.strange_maps import MapRecipe

SPHERE = 4.0 * math.pi
PARTS = {1e-4: "0_01", 1e-3: "0_1", 1e-2: "1", 1e-1: "10"}
SHARES = [name for name, found in FEATURES.items() if found.unit == "share"]


def grey(luminance) -> EnvironmentMap:
    return EnvironmentMap.from_array(np.repeat(np.asarray(luminance)[..., None], 3, axis=2))


def measured(luminance) -> dict[str, float]:
    """Features by name without the prefix, of a grey map."""
    found = map_features(grey(luminance))
    return {name.removeprefix(PREFIX): value for name, value in found.items()}


def speckled(height: int, seed: int = 0) -> np.ndarray:
    """Noise over eight decades, with a patch that is brighter by far."""
    rng = np.random.default_rng(seed)
    luminance = 10.0 ** rng.normal(0.0, 0.8, (height, 2 * height))
    luminance[height // 5 : height // 5 + 3, -2:] *= 1e4
    return luminance


def diameter(solid_angle: float) -> float:
    """Angular diameter in degrees of a cap: 2 arccos(1 − Ω/2π)."""
    return 2.0 * math.degrees(math.acos(1.0 - solid_angle / (2.0 * math.pi)))


def test_features_are_named_and_described():
    for name, found in FEATURES.items():
        assert found.name == name
        assert found.unit and found.meaning and "\n" not in found.meaning
        assert (getattr(found.measure, "func", found.measure)).__doc__
    assert list(measured(np.ones((4, 8)))) == list(FEATURES)
    with pytest.raises(ValueError, match="contrast"):
        feature("contrast", "ratio", "once more")(lambda survey: 0.0)


def test_one_disc_over_a_dim_sky():
    height, level, disc = 512, 0.2, 900.0
    centre = np.array([0.6, 0.64, 0.48])
    directions = pixel_directions(height)
    inside = angular_distance(directions, centre) < math.radians(2.0)
    texel = row_solid_angle(height, 2 * height)
    area = float(texel @ inside.sum(axis=1))
    luminance = np.where(inside, disc, level).astype(np.float32)
    total = disc * area + level * (SPHERE - area)
    found = measured(luminance)
    # Each value is rounded to float32 once, and so is luminance, a weighted sum of three of them.
    exact = {"rel": 4.0 * float(np.finfo(np.float32).eps)}
    assert found["share_in_emitters"] == pytest.approx(disc * area / total, **exact)
    assert found["emitters"] == 1.0
    assert found["effective_emitters"] == 1.0
    assert found["emitter_size"] == pytest.approx(diameter(area), rel=1e-9)
    # A disc of 4° that is cut along texels' sides; its area is off by less than its rim's texels.
    assert found["emitter_size"] == pytest.approx(4.0, abs=0.25 * 180.0 / height)
    assert found["contrast"] == pytest.approx(disc * SPHERE / total, **exact)
    for part, name in PARTS.items():
        bright = min(part * SPHERE, area)
        energy = disc * bright + level * (part * SPHERE - bright)
        assert found[f"share_in_{name}_percent"] == pytest.approx(energy / total, **exact)
    above = 0.5 * level * SPHERE + (disc - level) * area
    assert found["share_above_horizon"] == pytest.approx(above / total, **exact)


CONSTANT = {
    "share_in_0_01_percent": 1e-4, "share_in_0_1_percent": 1e-3, "share_in_1_percent": 1e-2,
    "share_in_10_percent": 0.1, "share_in_emitters": 0.0, "emitters": 0.0,
    "effective_emitters": 0.0, "emitter_size": 360.0, "entropy": 1.0, "contrast": 1.0,
    "texture": 0.0, "spectral_slope": 0.0, "share_above_horizon": 0.5,
}  # fmt: skip


@pytest.mark.parametrize("height", [1, 2, 3, 16, 129])
@pytest.mark.parametrize("level", [0.0, 1e-40, 1e-30, 0.7, 1e36])
def test_constant_and_black_maps_have_the_same_features(height, level):
    # 1e-40 is kept by float32 to 17 bits only, and luminance, a sum of products, to 15 or so.
    found = measured(np.full((height, 2 * height), level))
    assert found == pytest.approx(CONSTANT, rel=1e-4 if level == 1e-40 else 1e-6, abs=1e-9)


def test_strange_maps_have_finite_features():
    for seed in range(300):
        radiance = MapRecipe.draw(np.random.default_rng([5, seed])).radiance()
        found = map_features(EnvironmentMap(radiance))
        assert all(math.isfinite(value) for value in found.values()), seed
        # Sums in another order; a share may miss 0 or 1 by their rounding.
        assert all(-1e-9 <= found[f"{PREFIX}{name}"] <= 1.0 + 1e-9 for name in SHARES), seed
        parts = [found[f"{PREFIX}share_in_{name}_percent"] for name in PARTS.values()]
        assert all(a <= b * (1.0 + 1e-9) for a, b in pairwise(parts))
        assert found[f"{PREFIX}contrast"] >= 1.0 - 1e-6


@pytest.mark.parametrize("height", [16, 75, 256])
def test_the_scale_of_a_map_does_not_count(height):
    luminance = speckled(height)
    found = measured(luminance)
    assert measured(2.0**40 * luminance) == found  # exact: no digit of any value changes
    # Another factor rounds every texel anew; no feature amplifies relative errors of 1e-7 by 1e3.
    assert measured(0.37 * luminance) == pytest.approx(found, rel=1e-4)


@pytest.mark.parametrize("height", [16, 75, 256])
def test_turns_by_whole_columns_do_not_count(height):
    luminance = speckled(height)
    found = measured(luminance)
    for columns in (1, 2, 7, height, 2 * height - 1):
        turned = measured(np.roll(luminance, columns, axis=1))
        # Sums over a row in another order.
        assert turned == pytest.approx(found, rel=1e-9)


def test_shares_of_the_brightest_by_brute_force():
    luminance = np.round(4.0 * speckled(60)) / 4.0  # many texels of one luminance
    solid_angle = np.repeat(row_solid_angle(60, 120), 120)
    value = grey(luminance).luminance.ravel().astype(np.float64)
    order = np.argsort(-value)
    size, energy = (np.cumsum(x[order]) for x in (solid_angle, solid_angle * value))
    found = measured(luminance)
    for part, name in PARTS.items():
        expected = np.interp(part * SPHERE, [0.0, *size], [0.0, *energy]) / energy[-1]
        assert found[f"share_in_{name}_percent"] == pytest.approx(expected, rel=1e-9)


def neighbours(row: int, column: int, height: int) -> set[tuple[int, int]]:
    """Texels that share a point with a texel."""
    width = 2 * height
    near = {
        (row + down, (column + right) % width)
        for down in (-1, 0, 1)
        for right in (-1, 0, 1)
        if 0 <= row + down < height
    }
    poles = {(pole, k) for pole in (0, height - 1) if row == pole for k in range(width)}
    return near | poles


def test_emitters_by_flooding():
    height = 32
    for seed in range(12):
        rng = np.random.default_rng(seed)
        # 40 of 2048 texels, less than Eq. 1 takes for its brightest 2 %; clustered at the seam,
        # and at a pole.
        lit = {(0, int(rng.integers(64))) for _ in range(3)} | {(31, 9), (31, 40)}
        while len(lit) < 40:
            lit.add((int(rng.integers(32)), int(rng.integers(-5, 6)) % 64))
        luminance = np.ones((height, 2 * height))
        for row, column in lit:
            luminance[row, column] = rng.uniform(500.0, 1000.0)
        environment = grey(luminance)
        energies = []
        waiting = set(lit)
        while waiting:
            front, energy = [waiting.pop()], 0.0
            while front:
                row, column = front.pop()
                energy += float(environment.flux[row, column])
                joined = neighbours(row, column, height) & waiting
                waiting -= joined
                front += joined
            energies.append(energy)
        found = Survey(environment)
        assert found.regions.emissive.sum() == len(lit)
        assert sorted(found.emitters.energy) == pytest.approx(sorted(energies), rel=1e-12)
        share = np.array(energies) / sum(energies)
        assert measured(luminance)["emitters"] == len(energies)
        assert measured(luminance)["effective_emitters"] == pytest.approx(1.0 / (share @ share))


@pytest.mark.parametrize("width", [256, 512, 2048])
def test_texture_of_a_wave(width):
    """log₂ luminance of amplitude a has the variance a²/2, at the degree m / sin θ."""
    waves, amplitude = 20, 0.01
    turn = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
    # A texel shows the wave's mean over its width.
    wave = np.cos(waves * turn) * np.sinc(waves / width)
    luminance = np.broadcast_to(2.0 ** (amplitude * wave), (width // 2, width))
    # Degrees are 20 to 20/0.66 where |z| < 0.75, inside 16 to 64. The logarithm of a mean is the
    # mean of logarithms but for a relative a ln 2; the floor takes a share of 1e-4 away.
    assert measured(luminance)["texture"] == pytest.approx(
        amplitude / math.sqrt(2.0), rel=amplitude * math.log(2.0) + 2.0 * FLOOR
    )


def test_waves_of_two_texels_are_not_counted():
    """They have no phase: a shift by half a texel would hide them."""
    # Rounding of log₂ near 1 is 2e-16; sums of 64 of them, squared, are far below.
    assert measured(np.broadcast_to(1.0 + np.arange(64) % 2, (32, 64)))["texture"] < 1e-9


@pytest.mark.parametrize("steepness", [0.0, 1.0, 2.0, 3.0])
def test_slope_of_a_known_spectrum(steepness):
    width, amplitude, waves = 512, 0.01, np.arange(1, 128)
    rng = np.random.default_rng(7)
    size = waves ** (-0.5 * steepness)
    size *= amplitude / np.linalg.norm(size)
    turn = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
    phase = rng.uniform(0.0, 2.0 * math.pi, (width // 2, 1, len(waves)))
    # Rows of the map that share a band must agree, or their mean is another spectrum.
    phase = np.broadcast_to(phase[:1], phase.shape)
    shown = size * np.sinc(waves / width)
    stops = np.cos(waves * turn[:, None] + phase[0]) @ shown
    luminance = np.broadcast_to(2.0**stops, (width // 2, width))
    z = (np.arange(BANDS) + 0.5) * 2.0 / BANDS - 1.0
    sine = np.sqrt(1.0 - z[np.abs(z) < WIDEST_BAND] ** 2)
    power = [
        np.mean([0.5 * (size[(waves >= a * s) & (waves < b * s)] ** 2).sum() for s in sine])
        for a, b in pairwise(OCTAVES)
    ]
    expected = np.polyfit(np.log2(OCTAVES[:-1]), np.log2(np.array(power) / OCTAVES[:-1]), 1)[0]
    # Second-order terms of the logarithm, of relative size a, fill what the spectrum leaves empty:
    # a² against the least power, in the highest octave.
    slack = amplitude * math.log(2.0) + amplitude**2 * power[0] / power[-1]
    found = measured(luminance)["spectral_slope"]
    assert found == pytest.approx(expected, abs=slack)
    # Whole waves fall on either side of an octave's bounds: of about 3.4 waves of a row in the
    # lowest octave at most one, or 0.4 in log₂, weighed by 1.5/5 in the fit.
    assert found == pytest.approx(-steepness, abs=0.4 * 1.5 / 5.0 + slack)
