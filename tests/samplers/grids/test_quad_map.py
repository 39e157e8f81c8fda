"""Integrals over quads: no energy lost, and what dense sampling finds."""

import numpy as np
import pytest

from samplers import EnvironmentMap
from samplers.grids.healpix_grid import nested_index
from samplers.grids.quad_map import QuadMap
from samplers.sphere import direction_from_uv, uv_from_direction
from tests.samplers.grids.test_healpix_quads import quads_of
from tests.samplers.maps import healpix_cells, noisy_map


@pytest.mark.parametrize("height", [1, 3, 16, 333])
@pytest.mark.parametrize("level", [0, 2, 4])
def test_energy_is_conserved_at_every_level(height, level):
    environment = noisy_map(height, 1, 1e6)
    total = QuadMap.of(environment).sums(quads_of(level)).sum(axis=0)
    np.testing.assert_allclose(total, environment.total_flux, rtol=1e-12)


def test_no_quad_has_more_than_the_one_it_is_part_of():
    environment = noisy_map(16, 2, 1e9)
    source = QuadMap.of(environment)
    for level in range(5):
        coarse, fine = quads_of(level), quads_of(level + 1)
        whole = source.sums(coarse).reshape(12, 1 << level, 1 << level, 3)
        parts = source.sums(fine).reshape(12, 2 << level, 2 << level, 3)
        # Exactly: their ends are the same numbers and all sums run in the same order.
        assert (parts <= whole.repeat(2, axis=1).repeat(2, axis=2)).all()
        assert (parts >= 0.0).all()


def test_integrals_agree_with_dense_sampling():
    environment = noisy_map(9, 3)
    rng = np.random.default_rng(0)
    n = 2_000_000
    v = np.arccos(1.0 - 2.0 * (np.arange(n) + rng.random(n)) / n) / np.pi
    direction = direction_from_uv(rng.random(n), v)
    radiance = environment.lookup(direction).astype(np.float64)
    number = healpix_cells(direction, 2)
    found = QuadMap.of(environment).sums(quads_of(1))
    order = [nested_index(f, i, j, 2) for _, f, i, j in quads_of(1)]
    for channel in range(3):
        value = np.bincount(number, radiance[:, channel], 48) * (4.0 * np.pi / n)
        square = np.bincount(number, radiance[:, channel] ** 2, 48) * (4.0 * np.pi / n) ** 2
        # Each is a sum of n independent terms; 144 comparisons, so five standard errors.
        assert (np.abs(found[:, channel] - value[order]) < 5.0 * np.sqrt(square[order])).all()


def test_a_constant_map_gives_each_quad_its_solid_angle():
    source = QuadMap.of(EnvironmentMap.from_array(np.ones((512, 1024, 3), np.float32)))
    for level in range(4):
        quad = quads_of(level)
        expected = np.pi / 3.0 / 4.0**level
        # Midpoint rule over some 680 / 2^level rows of a quad: kinks at its corners, no jumps.
        np.testing.assert_allclose(source.sums(quad)[:, 1], expected, rtol=3e-4 * 4.0**level)


def test_moments_lie_where_the_light_is():
    radiance = np.zeros((64, 128, 3), np.float32)
    radiance[20, 127] = 3.0
    source = QuadMap.of(EnvironmentMap.from_array(radiance))
    moment = source.moments(quads_of(0)).sum(axis=0)
    u, v = uv_from_direction(moment)
    # The parallel that halves a row's solid angle is not its middle: (π/64)² / 8 cot θ, in rows.
    assert abs(v * 64 - 20.5) < 0.01
    assert u * 128 == pytest.approx(127.5, abs=1e-9)
    # Four parts of a row stand up to 3/8 of it from the middle: the mean is short by its square.
    short = (0.375 * np.pi / 64) ** 2
    assert np.linalg.norm(moment) == pytest.approx(source.environment.luminous_flux, rel=short)
