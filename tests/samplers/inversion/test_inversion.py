"""Sampling by tabulated inversion: unbiased, exact in its density; compensation."""

import math

import numpy as np
import pytest

from samplers import make_sampler
from samplers.conformance.stress_maps import stress_map
from samplers.sphere import direction_from_uv

SAMPLES = 1 << 14
UNIFORM = 1.0 / (4.0 * math.pi)


def distribution(environment, sampler="mis", **parameters):
    return make_sampler(sampler, **parameters).prepare(environment, 16, np.random.default_rng(0))


def numbers(count=SAMPLES, seed=3):
    return np.random.default_rng(seed).random((count, 3), np.float32)


def irradiance(environment, normal, parts=16):
    """∫ Y max(0, n·ω) dω, each texel cut into 16 × 16 parts of equal solid angle."""
    height, width = environment.height, environment.width
    fraction = (np.arange(parts) + 0.5) / parts
    edge = np.cos(np.arange(height + 1) * (math.pi / height))
    y = edge[:-1, None] + fraction * (edge[1:, None] - edge[:-1, None])
    v = np.arccos(y).reshape(-1) / math.pi
    u = ((np.arange(width)[:, None] + fraction) / width).reshape(-1)
    cosine = np.maximum(direction_from_uv(u[None, :], v[:, None]) @ normal, 0.0)
    mean = cosine.reshape(height, parts, width, parts).mean(axis=(1, 3))
    return float((mean * environment.flux).sum())


@pytest.mark.parametrize(
    "name",
    ["noise", "sun-and-sky", "constant", "two-texels-over-the-seam", "one-texel-at-the-top",
     "smallest", "odd-height", "contrast-1e9"],
)  # fmt: skip
@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (0.6, -0.64, 0.48), (-1.0, 0.0, 0.0)])
@pytest.mark.parametrize("guided", [True, False])
def test_the_estimator_is_unbiased(name, normal, guided):
    environment = stress_map(name)
    normal = np.array(normal)
    direction, pdf = distribution(environment, guided=guided).sample(numbers())
    luminance = environment.lookup(direction).astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    value = luminance * np.maximum(direction @ normal, 0.0) / pdf
    exact = irradiance(environment, normal)
    error = value.std() / math.sqrt(SAMPLES)
    # 4.5 standard errors: one in 150,000, 48 cases. What 16² parts and float32 directions leave is
    # below 10⁻³ of the map's flux where the surface's horizon cuts a texel in two.
    assert abs(value.mean() - exact) <= 4.5 * error + 1e-3 * environment.luminous_flux / 16


@pytest.mark.parametrize("name", ["noise", "sun-and-sky", "constant", "contrast-1e9", "smallest"])
@pytest.mark.parametrize("sampler", ["mis", "mis-compensated"])
def test_the_density_of_a_sample_is_the_density_there(name, sampler):
    found = distribution(stress_map(name), sampler)
    direction, pdf = found.sample(numbers())
    np.testing.assert_array_equal(found.pdf(direction), pdf)
    assert (pdf > 0.0).all()


@pytest.mark.parametrize("name", ["noise", "sun-and-sky", "contrast-1e9"])
@pytest.mark.parametrize("sampler", ["mis", "mis-compensated"])
def test_the_density_integrates_to_one(name, sampler):
    environment = stress_map(name)
    found = distribution(environment, sampler)
    height = environment.height
    u, v = (np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height
    direction = direction_from_uv(u[None, :], v[:, None]).reshape(-1, 3).astype(np.float32)
    pdf = found.pdf(direction).reshape(height, -1).astype(np.float64)
    # Each value is rounded to float32.
    assert (pdf.sum(axis=1) @ environment.row_solid_angle) == pytest.approx(1.0, rel=6e-8)


def test_guides_only_save_time():
    environment = stress_map("contrast-1e9")
    guided = distribution(environment, guided=True).sample(numbers())
    plain = distribution(environment, guided=False).sample(numbers())
    np.testing.assert_array_equal(guided[0], plain[0])
    np.testing.assert_array_equal(guided[1], plain[1])


def test_extreme_random_numbers_stay_inside():
    edge = np.array([0.0, np.nextafter(np.float32(1.0), np.float32(0.0))], np.float32)
    u = np.array(np.meshgrid(edge, edge, edge), np.float32).reshape(3, -1).T
    for name in ("noise", "two-texels-over-the-seam", "one-texel-at-the-bottom", "constant"):
        environment = stress_map(name)
        direction, pdf = distribution(environment).sample(np.ascontiguousarray(u))
        assert np.abs(np.linalg.norm(direction, axis=1) - 1.0).max() < 1e-6
        assert (pdf > 0.0).all()
        assert environment.lookup(direction).any(axis=1).all()


def test_compensation_is_off_on_a_constant_map():
    direction, pdf = distribution(stress_map("constant"), "mis-compensated").sample(numbers())
    np.testing.assert_allclose(pdf, UNIFORM, rtol=1e-6)
    assert abs(direction.mean(axis=0)).max() < 4.5 / math.sqrt(3 * SAMPLES)


def test_compensation_takes_the_mean_off_the_density():
    environment = stress_map("sun-and-sky")
    plain, compensated = distribution(environment), distribution(environment, "mis-compensated")
    direction, _ = distribution(stress_map("black")).sample(numbers())
    before, after = plain.pdf(direction).astype(np.float64), compensated.pdf(direction)
    dim = before < 0.99 * UNIFORM  # luminance over flux, so the mean stands for 1 / 4π
    assert dim.any()
    assert not after[dim].any()
    sun, _ = plain.sample(numbers(64))
    ratio = compensated.pdf(sun) / plain.pdf(sun)
    assert (ratio[plain.pdf(sun) > 1.0] > 1.0).all()


def test_full_compensation_is_none():
    environment = stress_map("noise")
    none = distribution(environment)
    one = distribution(environment, "mis-compensated", share=1.0)
    direction, pdf = none.sample(numbers())
    np.testing.assert_array_equal(one.pdf(direction), pdf)
