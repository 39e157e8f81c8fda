"""Layers by brightness against scipy's components, and the samples that regions are given."""

import math

import numpy as np
import pytest
from scipy.ndimage import label as components

from samplers.environment import EnvironmentMap
from samplers.structured.layers import importance, layers_of, numbers_of_samples


def lamps(height: int = 24) -> EnvironmentMap:
    """Lamps of several sizes and levels, none over the seam or a pole."""
    radiance = np.full((height, 2 * height, 3), 0.1, np.float32)
    radiance[3:6, 4:9] = 5.0
    radiance[4, 6] = 50.0
    radiance[10:12, 20:23] = 8.0
    radiance[12, 23] = 8.0  # touches the one before at a corner only
    radiance[18, 30:40] = 30.0
    return EnvironmentMap(radiance)


def test_regions_are_the_components_of_each_layer():
    environment = lamps()
    threshold = np.array([0.0, 1.0, 6.0, 20.0, 40.0])
    for layer, level in zip(layers_of(environment, threshold), threshold[:0:-1], strict=True):
        expected, number = components(environment.luminance >= level)
        assert len(layer.flux) == number
        pairs = np.unique(np.stack([layer.label + 1, expected.reshape(-1)]), axis=1)
        assert pairs.shape[1] == number + 1  # a one-to-one renaming, the outside among it
        for region in range(number):
            members = layer.members(region)
            assert np.array_equal(members, np.flatnonzero(layer.label == region))
            flux = environment.flux.reshape(-1)[members].sum()
            assert layer.flux[region] == pytest.approx(flux, rel=1e-12)


def test_regions_reach_over_the_seam_and_the_pole():
    radiance = np.full((8, 16, 3), 0.1, np.float32)
    radiance[3, [0, 15]] = 9.0
    radiance[0, [2, 10]] = 9.0
    (layer,) = layers_of(EnvironmentMap(radiance), np.array([0.0, 1.0]))
    assert sorted(np.diff(layer.start).tolist()) == [2, 2]


def test_what_is_all_that_is_lit_or_nothing_is_no_layer():
    radiance = np.zeros((4, 8, 3), np.float32)
    radiance[1, 1], radiance[2, 6] = 1.0, 2.0
    (layer,) = layers_of(EnvironmentMap(radiance), np.array([0.0, 0.5, 1.5, 2.5]))
    assert layer.members(0).tolist() == [22]


@pytest.mark.parametrize("useful", [0.01, None])
def test_numbers_follow_importance_less_what_is_held(useful):
    environment = lamps()
    (layer,), count = layers_of(environment, np.array([0.0, 1.0])), 200
    held = np.array([4 * 48 + 6, 10 * 48 + 20])
    given = dict(numbers_of_samples(layer, environment.luminous_flux, count, held, useful))
    for region in range(len(layer.flux)):
        solid = (
            layer.solid_angle[region] if useful is None else min(layer.solid_angle[region], 0.01)
        )
        sphere = 4.0 * math.pi if useful is None else 0.01
        gamma = layer.flux[region] * solid**0.25 / (environment.luminous_flux * sphere**0.25)
        texels = len(layer.members(region))
        inside = int((layer.label[held] == region).sum())
        wanted = min(math.floor(count * gamma + 0.5), texels) - inside
        assert given.get(region, 0) == max(wanted, 0)


def test_no_more_is_given_than_is_left():
    environment = lamps()
    (layer,) = layers_of(environment, np.array([0.0, 1.0]))
    given = numbers_of_samples(layer, environment.luminous_flux, 3, np.array([0]), 0.01)
    assert sum(number for _, number in given) <= 2
    value = importance(layer.flux, layer.solid_angle, 0.01)
    assert given[0][0] == value.argmax()
