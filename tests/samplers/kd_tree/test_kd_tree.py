"""Densities of the kd-tree distribution against what it draws, in all its forms."""

import math

import numpy as np
import pytest
from scipy import stats

from samplers import EnvironmentMap, make_sampler
from samplers.sphere import pixel_of_direction

RNG = np.random.default_rng(0)


def noisy_map(height=24, seed=0, sun=300.0):
    rng = np.random.default_rng(seed)
    radiance = np.exp(rng.normal(size=(height, 2 * height, 3)))
    radiance[height // 4, 5] *= sun
    radiance[-3:, :] = 0.0
    return EnvironmentMap.from_array(radiance.astype(np.float32))


def distribution(environment, **parameters):
    return make_sampler("kd-tree", **{"blocks": 40, **parameters}).prepare(environment, 8, RNG)


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


def test_compression_is_that_of_the_paper():
    rng = np.random.default_rng(1)
    radiance = rng.random((64, 128, 3), np.float32)
    # 4 bytes a pixel against 8 bytes a block.
    found = distribution(EnvironmentMap.from_array(radiance), blocks=24)
    assert found.compression_ratio == pytest.approx(4 * 64 * 128 / (24 * 8))
    constant = EnvironmentMap.from_array(np.ones((1024, 2048, 3), np.float32))
    assert distribution(constant, blocks=16).compression_ratio == 65536.0
