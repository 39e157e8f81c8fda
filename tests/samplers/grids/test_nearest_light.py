"""Cells of the pixels that are nearest to each light."""

import math

import numpy as np

from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.grids.nearest_light import nearest_light_cells, shining_radius
from samplers.sphere import (
    angular_distance,
    cap_solid_angle,
    normalized,
    pixel_directions,
    row_solid_angle,
)


def random_lights(count: int) -> np.ndarray:
    rng = np.random.default_rng(count)
    return normalized(rng.normal(size=(count, 3)), [0.0, 1.0, 0.0])


def test_cells_agree_with_a_search_over_all_pairs():
    rng = np.random.default_rng(4)
    direction, radiance = random_lights(23), rng.random((40, 80, 3)).astype(np.float32)
    cells = nearest_light_cells(direction, radiance)
    elsewhere = random_lights(24)[1:]
    mean, largest = cells.angle(direction, "mean"), cells.angle(elsewhere, "largest")
    luminance = radiance.astype(np.float64) @ LUMINANCE_WEIGHTS
    distance = angular_distance(pixel_directions(40)[:, :, None], direction)
    owner, nearest = distance.argmin(axis=-1), distance.min(axis=-1)
    solid = np.broadcast_to(row_solid_angle(40, 80)[:, None], owner.shape)
    for k in range(len(direction)):
        mine = owner == k
        # Float64 sums of a few hundred terms.
        assert math.isclose(cells.solid_angle[k], solid[mine].sum(), rel_tol=1e-12)
        expected = (solid * nearest)[mine].sum() / solid[mine].sum()
        assert math.isclose(mean[k], expected, rel_tol=1e-12)
        expected = angular_distance(pixel_directions(40)[mine], elsewhere[k]).max()
        # An arc sine near 1 keeps half of the digits.
        assert math.isclose(largest[k], expected, rel_tol=1e-7)
        expected = (radiance * solid[..., None])[mine].sum(axis=0)
        assert np.allclose(cells.flux[k], expected, rtol=1e-12, atol=0.0)
        expected = ((luminance * solid)[..., None] * pixel_directions(40))[mine].sum(axis=0)
        # Terms of either sign: relative to the flux.
        flux = cells.flux[k].sum()
        assert np.allclose(cells.moment[k], expected, rtol=0.0, atol=1e-12 * flux)


def test_cutting_pixels_keeps_the_sums():
    radiance = np.random.default_rng(5).random((3, 6, 3)).astype(np.float32)
    cells = nearest_light_cells(random_lights(50), radiance, repeat=20)
    assert math.isclose(cells.solid_angle.sum(), 4.0 * math.pi, rel_tol=1e-12)
    exact = np.einsum("r,rcx->x", row_solid_angle(3, 6), radiance.astype(np.float64))
    assert np.allclose(cells.flux.sum(axis=0), exact, rtol=1e-12, atol=0.0)


def test_a_light_without_pixels_is_marked():
    close = normalized([[0.0, 0.0, -1.0], [0.0, 1e-5, -1.0], [0.0, -1e-5, -1.0]], [1.0, 0.0, 0.0])
    cells = nearest_light_cells(close, np.zeros((2, 4, 3)))
    without = cells.solid_angle == 0.0
    assert without.any()
    for which in ("mean", "largest"):
        assert np.array_equal(np.isnan(cells.angle(close, which)), without)


def test_a_grey_map_shines_everywhere() -> None:
    environment = EnvironmentMap.from_array(np.full((64, 128, 3), 0.3))
    direction = random_lights(20)
    radius = shining_radius(environment, direction)
    cells = nearest_light_cells(direction, environment.radiance)
    np.testing.assert_allclose(cap_solid_angle(radius), cells.solid_angle, rtol=1e-6)
    assert not shining_radius(EnvironmentMap(np.zeros((4, 8, 3), np.float32)), direction).any()
