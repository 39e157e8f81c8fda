"""Uniform cells: as many as asked for, of equal size, over all of the sphere."""

import math

import numpy as np
import pytest

from samplers import EnvironmentMap, make_sampler
from samplers.conformance.stress_maps import stress_map
from samplers.sphere import angular_distance, pixel_directions
from samplers.uniform import cells_per_band


def lights(environment, count):
    return make_sampler("uniform").prepare(environment, count, np.random.default_rng(0))


def test_bands_hold_the_count_and_mirror_each_other():
    for count in range(1, 500):
        cells = cells_per_band(count)
        assert cells.sum() == count
        assert (cells >= 0).all()
        # Rounding the running share may shift one cell from a band to its mirror image.
        assert np.abs(cells - cells[::-1]).max() <= 1


@pytest.mark.parametrize("count", [1, 2, 5, 16, 64])
def test_cells_share_the_sphere_equally(count):
    height = 512
    found = lights(EnvironmentMap.from_array(np.ones((height, 2 * height, 3))), count)
    assert len(found) == count
    share = found.irradiance[:, 0] / (4 * math.pi / count)
    # An edge moves by up to half a texel: half a row of the least band, which has H / 2 bands
    # rows or more for 7 bands, on both sides, and half a column of 2H / 16 on both sides.
    assert share == pytest.approx(np.ones(count), abs=2 * 0.5 / (height / 14) + 0.5 / (height / 16))


def test_every_direction_has_a_light_nearby():
    found = lights(EnvironmentMap.from_array(np.ones((64, 128, 3))), 64)
    distance = angular_distance(pixel_directions(32)[:, :, None], found.direction).min(axis=2)
    # A squarish cell of 4π / 64 sr is 0.44 wide; its corner is 0.44 / √2 from its middle.
    assert distance.max() < 1.5 * math.sqrt(4 * math.pi / 64 / 2)


def test_the_map_decides_nothing_but_the_energy():
    noise = stress_map("noise")
    turned = EnvironmentMap.from_array(noise.radiance[::-1, ::-1])
    assert len(lights(noise, 16)) == len(lights(turned, 16)) == 16
