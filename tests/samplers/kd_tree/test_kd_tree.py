"""Densities of the kd-tree distribution against what it draws, in all its forms."""

import math

import numpy as np
import pytest
from scipy import stats

from samplers import EnvironmentMap, LightDistribution, make_sampler
from samplers.sphere import pixel_directions, pixel_of_direction

RNG = np.random.default_rng(0)


def noisy_map(height=24, seed=0, sun=300.0):
    rng = np.random.default_rng(seed)
    radiance = np.exp(rng.normal(size=(height, 2 * height, 3)))
    radiance[height // 4, 5] *= sun
    radiance[-3:, :] = 0.0
    return EnvironmentMap.from_array(radiance.astype(np.float32))


def distribution(environment, **parameters):
    return make_sampler("kd-tree", **{"blocks": 40, **parameters}).prepare(environment, 8, RNG)


def integral(environment, found):
    directions = pixel_directions(environment.height).reshape(-1, 3).astype(np.float32)
    density = found.pdf(directions).reshape(environment.luminance.shape).astype(np.float64)
    return (density * environment.row_solid_angle[:, None]).sum()


FORMS = ["exact-mass", "exact", "walk"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("weighting", ["solid-angle", "pixels"])
def test_the_density_integrates_to_one(form, weighting):
    environment = noisy_map()
    found = distribution(environment, pdf_form=form, weighting=weighting)
    assert isinstance(found, LightDistribution)
    # float32 densities, each rounded by half of 2⁻²³.
    assert integral(environment, found) == pytest.approx(1.0, abs=2.0**-24)


@pytest.mark.parametrize("form", [*FORMS, "paper-integer"])
@pytest.mark.parametrize("placement", ["solid-angle", "angles"])
def test_a_sample_has_the_density_of_its_direction(form, placement):
    found = distribution(noisy_map(), pdf_form=form, placement=placement)
    direction, pdf = found.sample(RNG.random((20_000, 3), np.float32))
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=3e-7)
    # Same block, so the same density; "angles" divides by a sine of a float32 direction.
    np.testing.assert_allclose(found.pdf(direction), pdf, rtol=1e-6)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(3))
def test_samples_follow_the_density(form, seed):
    environment = noisy_map(12, seed)
    found = distribution(environment, pdf_form=form, blocks=30)
    n = 200_000
    direction, _ = found.sample(np.random.default_rng(seed).random((n, 3), np.float32))
    seen = np.zeros(environment.luminance.shape)
    np.add.at(seen, pixel_of_direction(direction, 12), 1.0)
    centre = found.pdf(pixel_directions(12).reshape(-1, 3).astype(np.float32)).reshape(seen.shape)
    expected = n * centre.astype(np.float64) * environment.row_solid_angle[:, None]
    assert (seen[expected == 0.0] == 0.0).all()
    drawn = expected > 0.0
    assert expected[drawn].min() > 5.0
    square = ((seen - expected)[drawn] ** 2 / expected[drawn]).sum()
    # Nine such tests in all: each at 1 % / 9.
    assert stats.chi2.sf(square, drawn.sum() - 1) > 0.01 / 9


def test_angles_are_as_unbiased_as_solid_angle():
    environment = noisy_map()
    truth = environment.luminous_flux
    for placement in ("solid-angle", "angles"):
        found = distribution(environment, placement=placement)
        direction, pdf = found.sample(RNG.random((200_000, 3), np.float32))
        value = environment.luminance[pixel_of_direction(direction, 24)] / pdf
        error = value.std() / math.sqrt(len(value))
        assert abs(value.mean() - truth) < 4.0 * error


def test_of_the_published_densities_one_is_unbiased_and_one_is_not():
    environment = noisy_map(seed=5, sun=3000.0)
    truth = environment.luminous_flux
    mean, error = {}, {}
    for form in ("exact-mass", "paper-continuous", "paper-integer"):
        found = distribution(environment, pdf_form=form)
        direction, pdf = found.sample(np.random.default_rng(1).random((400_000, 3), np.float32))
        value = environment.luminance[pixel_of_direction(direction, 24)] / pdf
        mean[form], error[form] = value.mean() / truth, value.std() / math.sqrt(4e5) / truth
    assert abs(mean["exact-mass"] - 1.0) < 4.0 * error["exact-mass"]
    assert abs(mean["paper-continuous"] - 1.0) < 4.0 * error["paper-continuous"]
    assert error["paper-continuous"] > error["exact-mass"]
    # The density at a block's number is below its mass: the estimate is too bright.
    assert mean["paper-integer"] - 1.0 > 10.0 * error["paper-integer"]


def test_a_walk_keeps_strata_that_sorting_breaks():
    """Numbers of samples in the larger nodes of the tree, of 256 points of (0, 2)-nets."""
    environment = noisy_map()
    nets = [stats.qmc.Sobol(3, rng=seed).random(256).astype(np.float32) for seed in range(16)]
    found = {}
    for form in ("walk", "exact"):
        made = distribution(environment, pdf_form=form)
        top, left, bottom, right = made.tree.bounds.T[:, :, None]
        expected = 256 * made.tree.node_total / made.tree.node_total[0]
        large = (expected > 20.0) & (made.tree.child >= 0)
        error = []
        for net in nets:
            row, column = pixel_of_direction(made.sample(net)[0], 24)
            inside = (top <= row) & (row < bottom) & (left <= column) & (column < right)
            error.append(np.mean((inside.sum(axis=1) - expected)[large] ** 2 / expected[large]))
        found[form] = np.mean(error)
    # A binomial count would have about 1 here. A node is a rectangle of the unit square for the
    # walk, whose share of a net errs by the elementary intervals at its edges; for sorted blocks it
    # is a union of scattered intervals, whose errors add up.
    assert found["walk"] < 0.05
    assert found["walk"] < 0.5 * found["exact"]


def test_a_walk_over_single_pixels_is_as_even_as_inversion():
    environment = noisy_map(8)
    net = stats.qmc.Sobol(3, rng=5).random(4096).astype(np.float32)
    walk = distribution(environment, pdf_form="walk", blocks=128)
    inversion = make_sampler("mis").prepare(environment, 8, RNG)
    expected = 4096 * environment.flux / environment.flux.sum()
    error = []
    for made in (walk, inversion):
        seen = np.zeros(expected.shape)
        np.add.at(seen, pixel_of_direction(made.sample(net)[0], 8), 1.0)
        error.append(((seen - expected)[expected > 1.0] ** 2).sum())
        np.testing.assert_array_equal(seen[expected == 0.0], 0.0)
    # Binomial counts of 4096 have a sum of squared errors of about that.
    assert max(error) < 0.25 * 4096


@pytest.mark.parametrize("numbers", ["low-discrepancy", "independent"])
def test_the_renderer_is_told_which_numbers_are_wanted(numbers):
    assert distribution(noisy_map(), numbers=numbers).independent == (numbers == "independent")


@pytest.mark.parametrize("parameters", [{"pdf_form": f} for f in FORMS] + [{"placement": "angles"}])
@pytest.mark.parametrize("height", [1, 2, 9])
def test_the_ends_of_the_unit_interval_stay_in_range(parameters, height):
    rng = np.random.default_rng(height)
    radiance = rng.random((height, 2 * height, 3), np.float32)
    found = distribution(EnvironmentMap.from_array(radiance), **parameters)
    ends = np.array([0.0, 1.0 - 2.0**-24], np.float32)
    u = np.stack(np.meshgrid(ends, ends, ends), axis=-1).reshape(-1, 3)
    direction, pdf = found.sample(u)
    assert np.isfinite(direction).all()
    assert (pdf > 0.0).all()
    np.testing.assert_allclose(found.pdf(direction), pdf, rtol=1e-5)


def test_compression_is_that_of_the_paper():
    rng = np.random.default_rng(1)
    radiance = rng.random((64, 128, 3), np.float32)
    # 4 bytes a pixel against 8 bytes a block.
    found = distribution(EnvironmentMap.from_array(radiance), blocks=24)
    assert found.compression_ratio == pytest.approx(4 * 64 * 128 / (24 * 8))
    constant = EnvironmentMap.from_array(np.ones((1024, 2048, 3), np.float32))
    assert distribution(constant, blocks=16).compression_ratio == 65536.0
