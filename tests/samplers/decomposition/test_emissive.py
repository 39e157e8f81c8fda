"""Eq. 1 and 2: which pixels are emissive, and how the budget is shared."""

import math

import numpy as np
import pytest

from samplers.decomposition.emissive import budget, classify, quantile
from samplers.environment import EnvironmentMap


def grey(luminance):
    return EnvironmentMap.from_array(np.repeat(luminance[..., None], 3, axis=2))


def textured(height, seed=0):
    """Dim noise, 0.5 on average."""
    return np.random.default_rng(seed).uniform(0.0, 1.0, (height, 2 * height))


@pytest.mark.parametrize("height", [1, 2, 3, 5, 8, 65])
@pytest.mark.parametrize("scale", [1.0, 1e-44, 3e37])
def test_percentile_is_the_order_statistic(height, scale):
    value = (textured(height) ** 8 * scale).astype(np.float32)
    ranked = np.sort(value, axis=None)
    assert quantile(value, 0.98) == ranked[math.ceil(0.98 * value.size) - 1]


def test_percentile_of_ties():
    value = np.zeros((10, 20), np.float32)
    value.ravel()[:5] = 7.0  # 2.5 % of the pixels
    assert quantile(value, 0.98) == 7.0
    value.ravel()[4] = 0.0  # 2 %: 98 % do not exceed 0
    assert quantile(value, 0.98) == 0.0


def test_the_percentile_decides_where_bright_pixels_are_many():
    luminance = textured(64) * 0.01
    luminance.ravel()[::30] = np.random.default_rng(1).uniform(10.0, 11.0, 274)  # 3.3 %
    regions = classify(grey(luminance))
    assert (
        regions.threshold
        == regions.percentile
        > max(3.0 * regions.average, 0.001 * regions.maximum)
    )


@pytest.mark.parametrize(
    ("height", "bright", "decisive", "factor"),
    [
        (64, {(20, 30): 5.0}, "average", 3.0),
        (256, {(3, 30): 1e5, (100, 300): 50.0}, "maximum", 0.001),  # a thousandth is 100
    ],
)
def test_average_or_maximum_decide_where_few_pixels_stand_out(height, bright, decisive, factor):
    luminance = textured(height)
    for place, value in bright.items():
        luminance[place] = value
    regions = classify(grey(luminance))
    assert regions.threshold == factor * getattr(regions, decisive)
    assert np.argwhere(regions.emissive).tolist() == [list(next(iter(bright)))]


def test_a_constant_map_has_no_emissive_pixel():
    assert not classify(grey(np.full((16, 32), 4.2))).emissive.any()


def test_flux_and_solid_angle_of_the_regions_add_up():
    environment = grey(textured(64) ** 20)
    regions = classify(environment)
    assert regions.emissive.any()
    # Float32 luminance against float64 sums of channels: 6e-8 relative.
    total = regions.emissive_flux + regions.other_flux
    assert total == pytest.approx(environment.luminous_flux, rel=1e-6)
    wanted = environment.flux[regions.emissive].sum()
    assert regions.emissive_flux == pytest.approx(wanted, rel=1e-12)
    sphere = regions.emissive_solid_angle + regions.other_solid_angle
    assert sphere == pytest.approx(4.0 * np.pi, rel=1e-12)


@pytest.mark.parametrize("power", [1, 3, 10, 100])
@pytest.mark.parametrize("height", [1, 3, 5, 64])
def test_at_most_a_fiftieth_of_the_pixels_is_emissive(height, power):
    regions = classify(grey(textured(height, power) ** power))
    assert regions.emissive.mean() <= 0.02


def sun_and_sky(sun):
    """A sky of 1 with a lamp of 2 × 2 pixels."""
    luminance = np.ones((32, 64))
    luminance[10:12, 20:22] = sun
    return classify(grey(luminance))


@pytest.mark.parametrize("sun", [30.0, 1e3, 1e4])
def test_the_budget_follows_importance(sun):
    regions = sun_and_sky(sun)
    bright = regions.emissive_flux * regions.emissive_solid_angle**0.25
    dim = regions.other_flux * regions.other_solid_angle**0.25
    for count in (8, 16, 64, 1000):
        direct, indirect = budget(regions, count)
        assert direct + indirect == count
        assert 1 <= direct < count
        unrounded = count * bright / (bright + dim)
        assert abs(direct - min(max(unrounded, 1.0), count - 1.0)) <= 0.5


def test_either_region_gets_a_light_if_it_has_energy():
    assert budget(sun_and_sky(1e9), 16) == (15, 1)
    assert budget(sun_and_sky(4.0), 4) == (1, 3)
    assert budget(sun_and_sky(1e9), 1) == (0, 1)
    black = np.zeros((32, 64))
    black[5, 5] = 1.0
    assert budget(classify(grey(black)), 16) == (16, 0)
    assert budget(classify(grey(np.ones((32, 64)))), 16) == (0, 16)
