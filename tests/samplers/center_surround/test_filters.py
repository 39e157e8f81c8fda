"""The bank of centre-surround filters."""

import math

import numpy as np
import pytest

from samplers.center_surround import CenterSurround
from samplers.sphere import cap_solid_angle


def constant_responses(sampler: CenterSurround) -> np.ndarray:
    """Responses to a map of radiance one, times the angular extent."""
    bank = sampler.bank()
    sums = np.bincount(bank.cap_filter, bank.cap_weight * cap_solid_angle(bank.cap_radius))
    extent = 2.0 * bank.outer if sampler.extent == "diameter" else bank.outer
    return sums * extent


def test_sizes_run_from_the_smallest_to_the_largest():
    bank = CenterSurround().bank()
    assert len(bank.outer) == 20
    assert np.degrees(bank.outer[[0, -1]]) == pytest.approx([4.5, 45.0])
    assert np.degrees(np.diff(bank.outer)) == pytest.approx(40.5 / 19)
    assert bank.inner == pytest.approx(0.75 * bank.outer)


def test_geometric_sizes_grow_by_a_constant_factor():
    outer = CenterSurround(spacing="geometric").bank().outer
    assert outer[1:] / outer[:-1] == pytest.approx(10.0 ** (1.0 / 19.0))


def test_extent_as_diameter_halves_the_filters():
    one, two = CenterSurround(extent="diameter").bank(), CenterSurround().bank()
    assert two.outer == pytest.approx(2.0 * one.outer)


def test_inner_radius_in_the_plane():
    bank = CenterSurround(extent="diameter", inner_in="plane").bank()
    # arctan(0.75 tan 22.5°) = 17.26°, worked out by hand.
    assert math.degrees(bank.inner[-1]) == pytest.approx(17.26, abs=0.005)


def test_center_must_outshine_the_ring_by_a_factor():
    sampler = CenterSurround(extent="diameter")
    bank = sampler.bank()
    ring = cap_solid_angle(bank.outer) - cap_solid_angle(bank.inner)
    needed = 10.0 * ring / cap_solid_angle(bank.inner)
    # In the plane the areas give 10 (1/0.75² − 1) = 7.78; a sphere's large rings are smaller.
    assert needed[[0, -1]] == pytest.approx([7.78, 7.68], abs=0.005)
    expected = cap_solid_angle(bank.inner) * (1.0 - needed)
    assert constant_responses(sampler) == pytest.approx(expected, rel=1e-9)


def test_planar_weights_give_the_planar_response():
    sampler = CenterSurround(surface="plane", inner_in="plane")
    outer = np.tan(sampler.bank().outer)
    # π r² (0.75² − 10 (1 − 0.75²)) = −3.8125 π r²; the staircase is exact for a constant map.
    assert constant_responses(sampler) == pytest.approx(-3.8125 * math.pi * outer**2, rel=1e-9)
