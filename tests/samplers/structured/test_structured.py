"""Structured importance sampling as a whole."""

import math

import numpy as np
import pytest

from samplers.conformance.stress_maps import sun_over_sky
from samplers.environment import EnvironmentMap
from samplers.registry import make_sampler
from samplers.sphere import angular_distance, pixel_direction, pixel_directions


def lights_of(environment, count, **parameters):
    sampler = make_sampler("structured", **parameters)
    return sampler.prepare(environment, count, np.random.default_rng(0))


def noise(height=16, decades=3.0):
    rng = np.random.default_rng(height)
    level = 10.0 ** rng.uniform(-decades / 2, decades / 2, (height, 2 * height, 1))
    return EnvironmentMap.from_array(level * rng.uniform(0.5, 1.0, (height, 2 * height, 3)))


def test_lights_are_the_energy_and_the_centroid_of_the_nearest_texels():
    environment = noise()
    at_sample = lights_of(environment, 20, position="sample")
    at_centroid = lights_of(environment, 20)
    np.testing.assert_array_equal(at_sample.irradiance, at_centroid.irradiance)
    texel = pixel_directions(environment.height)
    apart = angular_distance(texel[:, :, None], at_sample.direction)
    solid_angle = environment.row_solid_angle[:, None, None]
    near = apart <= apart.min(axis=-1, keepdims=True) + 1e-7
    clear = near.sum(axis=-1) == 1  # of a texel amid two samples, either may be the owner
    for k in range(20):
        sure, most = near[..., k] & clear, near[..., k]
        low, high = ((environment.radiance * solid_angle)[mask].sum(0) for mask in (sure, most))
        assert (low * (1 - 1e-6) <= at_sample.irradiance[k]).all()
        assert (at_sample.irradiance[k] <= high * (1 + 1e-6)).all()
    whole = np.flatnonzero([(near[..., k] <= clear).all() for k in range(20)])
    assert len(whole)
    for k in whole:
        mask = near[..., k]
        moment = (environment.luminance[..., None] * solid_angle * texel)[mask].sum(axis=0)
        assert angular_distance(moment, at_centroid.direction[k]) < 1e-6


def test_a_sun_gets_its_share_of_the_samples():
    """Γ of a disc of solid angle ω < Δω₀ with flux share p is p (ω/Δω₀)^¼ of the sphere's."""
    height, count = 256, 300
    inside = angular_distance(pixel_directions(height), pixel_direction(80, 160, height)) < 0.04
    radiance = np.where(inside[..., None], [20.0] * 3, [0.1] * 3)
    environment = EnvironmentMap.from_array(radiance)
    share = environment.flux[inside].sum() / environment.luminous_flux
    solid_angle = (environment.row_solid_angle[:, None] * inside).sum()
    assert solid_angle < 0.01
    sampler = make_sampler("structured")
    found = inside.reshape(-1)[sampler.samples(environment, count)].sum()
    wanted = count * share * (solid_angle / 0.01) ** 0.25
    assert 10 < found == math.floor(wanted + 0.5) < inside.sum()


def test_thresholds_are_multiples_of_the_deviation():
    environment = EnvironmentMap(sun_over_sky(16, 1e3))
    luminance = environment.luminance.astype(np.float64)
    expected = np.arange(6) * luminance.std()
    assert make_sampler("structured").thresholds(environment) == pytest.approx(expected, rel=1e-9)
    weight = np.broadcast_to(environment.row_solid_angle[:, None], luminance.shape)
    mean = np.average(luminance, weights=weight)
    expected = np.arange(6) * math.sqrt(np.average((luminance - mean) ** 2, weights=weight))
    sampler = make_sampler("structured", deviation="solid angle")
    assert sampler.thresholds(environment) == pytest.approx(expected, rel=1e-9)


def test_without_a_centre_of_energy_the_first_sample_is_the_brightest():
    """A constant map's centroid is rounding; of two equal poles too."""
    sampler = make_sampler("structured", useful_solid_angle=None)
    constant = EnvironmentMap(np.ones((32, 64, 3), np.float32))
    assert sampler.samples(constant, 3)[0] == 0
    poles = np.ones((32, 64, 3), np.float32)
    poles[[0, -1]] = 1.5
    assert sampler.samples(EnvironmentMap(poles), 3)[0] == 0
