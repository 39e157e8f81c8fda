"""FHIS: exact counts, energy, density, and the way over seam and poles."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from samplers import make_sampler
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.fhis import importance_points
from samplers.fhis.max_pyramid import max_pyramid
from samplers.fhis.penrose_correction import correction_table
from samplers.sphere import angular_distance, pixel_direction, pixel_directions


def lights(environment: EnvironmentMap, count: int, **parameters):
    """Lights at every accepted point, unless cells are asked for."""
    parameters.setdefault("light", "point")
    return make_sampler("fhis", **parameters).prepare(environment, count, np.random.default_rng(0))


def random_map(height: int, power: float = 4.0) -> EnvironmentMap:
    rng = np.random.default_rng(height)
    return EnvironmentMap((rng.random((height, 2 * height, 3)) ** power).astype(np.float32))


def lone_pixel(row: int, column: int, height: int = 16) -> EnvironmentMap:
    radiance = np.zeros((height, 2 * height, 3), np.float32)
    radiance[row, column] = (3.0, 1.0, 2.0)
    return EnvironmentMap(radiance)


@pytest.mark.parametrize("count", [1, 3, 300, 4096])
@pytest.mark.parametrize("height", [1, 5, 64])
def test_the_count_is_exact_and_lights_are_alike(height, count):
    environment = random_map(height)
    share = lights(environment, count).irradiance @ LUMINANCE_WEIGHTS
    # Each share is rounded once or twice.
    np.testing.assert_allclose(share, np.full(count, environment.luminous_flux / count), 1e-12)


@pytest.mark.parametrize("pixel", [(8, 5), (0, 3), (15, 7), (4, 0), (4, 31)])
def test_a_lone_pixel_gets_every_light(pixel):
    environment = lone_pixel(*pixel)
    result = lights(environment, 64)
    distance = angular_distance(result.direction, pixel_direction(*pixel, 16))
    # Corrections reach a little past the pixel: half its diagonal, and a tile's displacement,
    # which is at most 1.2 spacings (here 1/8 of a pixel each).
    assert distance.max() < (math.sqrt(0.5) + 1.2 * 1.5 / 8.0) * math.pi / 16.0
    assert np.allclose(result.irradiance, environment.total_flux / 64, rtol=1e-12)


def test_density_follows_importance():
    environment = random_map(8)
    result = lights(environment, 20000, correct=False)
    theta, phi = (
        np.arccos(result.direction[:, 1]),
        np.arctan2(result.direction[:, 0], -result.direction[:, 2]) % (2.0 * math.pi),
    )
    found, _, _ = np.histogram2d(theta, phi, (8, 16), ((0.0, math.pi), (0.0, 2.0 * math.pi)))
    expected = 20000 * environment.flux / environment.flux.sum()
    # Random points would stray by √expected (one σ); the tiling is far more even than that.
    assert (np.abs(found - expected) < 2.0 * np.sqrt(expected) + 3.0).all()


def test_points_of_a_constant_map_keep_their_distance():
    result = lights(EnvironmentMap(np.ones((64, 128, 3), np.float32)), 2000)
    equator = np.abs(result.direction[:, 1]) < 0.5
    nearest = cKDTree(result.direction).query(result.direction[equator], k=2)[0][:, 1]
    # In units of 1/√density: ½ for random points. The plane's .94 falls where the sphere's
    # columns draw together, by cos 30° at most.
    assert nearest.mean() / math.sqrt(4.0 * math.pi / 2000) > 0.94 * math.cos(math.pi / 6.0)


def test_extents_are_those_of_equal_caps_on_a_constant_map():
    count = 500
    even = EnvironmentMap(np.ones((64, 128, 3), np.float32))
    result = lights(even, count, light_extent="mean")
    # The mean angle in a flat cap of solid angle 4π/n is two thirds of its radius 2/√n; cells
    # that are not round have a larger one.
    cap = 2.0 / 3.0 * 2.0 / math.sqrt(count)
    assert cap * 0.98 < result.extent.mean() < cap * 1.15


def test_crowded_lights_have_small_extents():
    result = lights(lone_pixel(8, 5), 300, light_extent="mean")
    middle = pixel_direction(8, 5, 16)
    inner = angular_distance(result.direction, middle) < 0.3 * math.pi / 16.0
    assert inner.sum() > 20
    # Mean spacing is π/16/√300 = 0.011; a cell's mean angle is about a third of it.
    assert (result.extent[inner] > 0.0).all()
    assert result.extent[inner].max() < 0.011


def test_lights_in_one_pixel_share_it_equally():
    """All points are accepted in it; a cell with other pixels' centres holds no other light."""
    environment = lone_pixel(50, 90, height=128)
    result = lights(environment, 7, light="cell")
    inside = angular_distance(result.direction, pixel_direction(50, 90, 128)) < math.pi / 256
    assert inside.sum() >= 3
    assert np.allclose(result.irradiance, environment.total_flux / len(result), rtol=1e-12)


def test_a_light_stands_at_the_centroid_of_the_cell_of_its_point():
    environment = random_map(128)
    at_point = lights(environment, 20, light="cell")
    at_centroid = lights(environment, 20, light="centroid")
    np.testing.assert_array_equal(at_point.irradiance, at_centroid.irradiance)
    texel = pixel_directions(128)
    owner = angular_distance(texel[:, :, None], at_point.direction).argmin(axis=-1)
    flux = environment.luminance * environment.row_solid_angle[:, None]
    for k in range(20):
        moment = (flux[..., None] * texel)[owner == k].sum(axis=0)
        moment /= np.linalg.norm(moment)
        # Luminance is rounded to float32, and of ties one may fall to either side.
        assert angular_distance(moment, at_centroid.direction[k]) < 1e-6


def test_seeds_are_shifts_and_sets_may_be_further_ones():
    environment, sampler = random_map(32), make_sampler("fhis", sets="shifted")
    one, again, other = (
        sampler.prepare(environment, 16, np.random.default_rng(seed)) for seed in (0, 0, 1)
    )
    perturbed = make_sampler("fhis").prepare(environment, 16, np.random.default_rng(0))
    assert len(one.sets) == 8 and not perturbed.further_sets
    np.testing.assert_array_equal(one.direction, perturbed.direction)
    for a, b in zip(one.sets, again.sets, strict=True):
        np.testing.assert_array_equal(a.direction, b.direction)
    distance = [
        angular_distance(one.direction[:, None], lights.direction).min(axis=1).max()
        for lights in (*one.further_sets, other)
    ]
    # Spacings are half a radian: some light of one shift is far from all of another.
    assert min(distance) > 0.05


@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
def test_the_map_lies_in_the_root_at_any_shift(shift):
    """At the ends of the range of shifts, points still cover the map evenly up to its corners."""
    environment = EnvironmentMap(np.ones((32, 64, 3), np.float32))
    importance = max_pyramid(environment.luminance, environment.row_solid_angle)
    points = importance_points(environment, importance, 4000, correction_table(), shift)
    expected = 4000 * environment.row_solid_angle.reshape(4, 8).sum(axis=1) * 16 / (4.0 * math.pi)
    found, _, _ = np.histogram2d(*points.pixel.T, bins=(4, 4), range=((0, 32), (0, 64)))
    # Stratified points: off by about the square root of those on the border of a box, 4·√250.
    assert (
        np.abs(found - expected[:, None]) < 3.0 * np.sqrt(4.0 * np.sqrt(expected))[:, None]
    ).all()
