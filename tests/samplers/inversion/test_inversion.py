"""Tabulated inversion: guides only save time, and compensation does what it says."""

import math

import numpy as np
import pytest

from samplers import make_sampler
from samplers.conformance.stress_maps import stress_map
from samplers.sphere import pixel_directions

SAMPLES = 1 << 14
UNIFORM = 1.0 / (4.0 * math.pi)


def distribution(environment, sampler="mis", **parameters):
    return make_sampler(sampler, **parameters).prepare(environment, 16, np.random.default_rng(0))


def numbers(count=SAMPLES, seed=3):
    return np.random.default_rng(seed).random((count, 3), np.float32)


def test_guides_only_save_time():
    environment = stress_map("contrast-1e9")
    guided = distribution(environment, guided=True).sample(numbers())
    plain = distribution(environment, guided=False).sample(numbers())
    np.testing.assert_array_equal(guided[0], plain[0])
    np.testing.assert_array_equal(guided[1], plain[1])


def test_compensation_is_off_on_a_constant_map():
    direction, pdf = distribution(stress_map("constant"), "mis-compensated").sample(numbers())
    np.testing.assert_allclose(pdf, UNIFORM, rtol=1e-6)
    assert abs(direction.mean(axis=0)).max() < 4.5 / math.sqrt(3 * SAMPLES)


@pytest.mark.parametrize("share", [0.5, 0.8, 1.0])
def test_compensation_takes_the_mean_off_the_density(share):
    """2 (1 − c) of it, and what is left is as a density again."""
    environment = stress_map("noise")
    direction = pixel_directions(environment.height).reshape(-1, 3).astype(np.float32)
    solid_angle = np.repeat(environment.row_solid_angle, environment.width)
    before = distribution(environment).pdf(direction).astype(np.float64)
    left = np.maximum(before - 2.0 * (1.0 - share) * UNIFORM, 0.0)
    found = distribution(environment, "mis-compensated", share=share).pdf(direction)
    # Densities are float32 on both sides of the difference.
    rounding = 4.0 * 2.0**-24 * before.max() / (left @ solid_angle)
    np.testing.assert_allclose(found, left / (left @ solid_angle), rtol=2.0**-22, atol=rounding)
