"""Suns that are taken out of a map, and the smooth rest."""

import math

import numpy as np
import pytest

from samplers import DiscLights, EnvironmentMap, make_sampler
from samplers.extracted_suns import smoothed
from samplers.sphere import angular_distance, direction_from_uv, pixel_directions

AT = (0.31, 0.29)


def cap_map(radius: float, bright: float, height: int = 64) -> EnvironmentMap:
    """A grey sky of 1 and a cap of so many degrees."""
    radiance = np.ones((height, 2 * height, 3), np.float32)
    inside = angular_distance(pixel_directions(height), direction_from_uv(*AT)) < radius
    radiance[inside] = bright
    return EnvironmentMap(radiance)


def discs(name: str, environment: EnvironmentMap, count: int = 16, **parameters: float):
    found = make_sampler(name, **parameters).prepare(environment, count, np.random.default_rng(0))
    assert isinstance(found, DiscLights)
    return found


def test_a_map_of_second_order_stays_as_it_is() -> None:
    way = pixel_directions(64)
    linear = 2.0 + way[..., :1] - 0.5 * way[..., 1:2] + 0.3 * way[..., 2:] * way[..., :1]
    environment = EnvironmentMap.from_array(linear * [1.0, 0.5, 2.0])
    # The midpoint rule over polynomials of the sine: (π/64)² of them, twice over.
    np.testing.assert_allclose(smoothed(environment).radiance, environment.radiance, rtol=6e-3)


@pytest.mark.parametrize("name", ["sun-and-sh", "mksource"])
@pytest.mark.parametrize("radius", [4.0, 6.0])
def test_a_cap_of_light_becomes_one_disc_of_its_place_and_size(name: str, radius: float) -> None:
    environment = cap_map(math.radians(radius), 1000.0)
    found = discs(name, environment)
    assert len(found) == 1 and found.rays_per_light == 16
    assert angular_distance(found.direction[0], direction_from_uv(*AT)) < math.pi / 64
    # Texels of 2.8° cut its edge.
    assert abs(math.degrees(found.half_angle[0]) - radius) < 2.0
    total = found.irradiance.sum(axis=0) + found.ambient.total_flux
    np.testing.assert_allclose(total, environment.total_flux, rtol=1e-6)


@pytest.mark.parametrize("name", ["sun-and-sh", "mksource"])
def test_an_even_map_has_no_sun(name: str) -> None:
    environment = EnvironmentMap.from_array(np.full((16, 32, 3), 0.7))
    found = discs(name, environment)
    assert len(found) == 0
    # Harmonics by cells of 11°.
    np.testing.assert_allclose(found.ambient.radiance, 0.7, rtol=0.05)


def test_no_disc_is_more_than_fifteen_degrees_across_or_reaches_into_the_dim() -> None:
    uneven = np.random.default_rng(0).uniform(1.0, 2.0, (64, 128, 1)).astype(np.float32)
    cap = cap_map(math.radians(10.0), 50.0)
    wide = discs("mksource", EnvironmentMap.from_array(cap.radiance * uneven))
    assert len(wide) > 1
    assert 5.0 < np.degrees(wide.half_angle).max() < 7.5
    narrow = discs("mksource", cap_map(math.radians(4.0), 50.0))
    assert math.degrees(narrow.half_angle[0]) < 4.0 + 2.9


def test_what_is_little_beside_a_wide_disc_stays_in_the_rest() -> None:
    """A cell at three times the percentile has less than 5 % of the light of a disc of 15°."""
    height, radiance = 128, np.ones((128, 256, 3), np.float32)
    inside = angular_distance(pixel_directions(height), direction_from_uv(*AT)) < math.radians(20.0)
    radiance[inside] = 2.0  # 3 % of the sphere: the percentile
    radiance[height // 2, 200] = 6.0
    environment = EnvironmentMap(radiance)
    size = environment.row_solid_angle[height // 2]
    assert 6.0 * size < 0.05 * 2.0 * 2.0 * math.pi * (1.0 - math.cos(math.radians(7.5)))
    assert len(discs("mksource", environment)) == 0
    brighter = radiance.copy()
    brighter[height // 2, 200] = 60.0
    found = discs("mksource", EnvironmentMap(brighter))
    assert len(found) == 1
    np.testing.assert_allclose(found.irradiance[0], 60.0 * size, rtol=1e-4)
