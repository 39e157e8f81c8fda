"""The law of block numbers: masses, fit and draws, and the alias table it is measured against."""

import math

import numpy as np
import pytest

from samplers.kd_tree.fit import alias_table, densities, fit_alpha, masses
from samplers.kd_tree.sample import DENSITY, RECORD, RUN, sample_law


@pytest.mark.parametrize("n", [1, 2, 16, 6144])
@pytest.mark.parametrize("alpha", [1e-290, 1e-6, 1.0, 50.0, 1e6, 6e15])
def test_masses_are_a_falling_distribution(n, alpha):
    mass = masses(n, alpha)
    # A sum of n rounded logarithms, each to a few ε.
    assert mass.sum() == pytest.approx(1.0, abs=4 * n * 2.0**-52)
    assert (np.diff(mass) <= 0.0).all()
    assert (mass > 0.0).all()


def test_published_densities_are_not_the_masses():
    # ln(1 + 1/α) against 1/(α + 1): 1.39 at α = 1, 1.09 at 5, 1.01 at 50.
    for alpha, ratio in (
        (1.0, 2.0 * math.log(2.0)),
        (5.0, 6.0 * math.log(1.2)),
        (50.0, 51.0 * math.log(1.02)),
    ):
        assert masses(100, alpha)[0] / densities(100, alpha)[0] == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize("alpha", [1e-3, 0.5, 7.0, 200.0, 3e4])
def test_the_fit_recovers_its_own_law(alpha):
    found, distance = fit_alpha(masses(500, alpha), False)
    # The bracket of two grid steps, 0.17 wide, shrinks by 0.618⁴⁰ = 4e-9.
    assert found == pytest.approx(alpha, rel=1e-6)
    assert distance < 1e-6


@pytest.mark.parametrize("at_points", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_no_other_parameter_fits_better(at_points, seed):
    rng = np.random.default_rng(seed)
    probability = np.sort(rng.gamma(0.3, size=300))[::-1]
    probability /= probability.sum()
    _, distance = fit_alpha(probability, at_points)
    model = densities if at_points else masses
    others = [np.abs(probability - model(300, a)).sum() for a in np.geomspace(1e-6, 1e9, 3000)]
    # Steps of 0.5 % in α: the searched minimum may miss a dip narrower than its own grid.
    assert distance <= min(others) * 1.001


def test_flat_and_single_block_maps_lie_within_the_law():
    assert fit_alpha(np.full(64, 1.0 / 64), False)[1] < 1e-9
    assert fit_alpha(np.ones(1), False)[1] == pytest.approx(0.0, abs=1e-12)
    one = np.full(100, 1e-12)
    one[0] = 1.0 - 99e-12
    # What is left at the steepest law: ln 100 of 690 in the other blocks, on both sides.
    assert fit_alpha(one, False)[1] == pytest.approx(2.0 * math.log(100.0) / 690.0, rel=1e-2)


@pytest.mark.parametrize("n", [1, 2, 7, 1000])
def test_the_alias_table_holds_the_probabilities(n):
    probability = np.random.default_rng(n).gamma(0.2, size=n) + 1e-9
    probability /= probability.sum()
    threshold, alias = alias_table(probability)
    held = np.bincount(np.arange(n), threshold, n) + np.bincount(alias, 1.0 - threshold, n)
    # Up to n subtractions from one large entry, each ε of at most n.
    np.testing.assert_allclose(held / n, probability, atol=4 * n * 2.0**-52)


@pytest.mark.parametrize("spread", [1e-12, 1e-6, 0.3, 4.0, 40.0, 690.0])
@pytest.mark.parametrize("blocks", [1, 7, 6144])
def test_blocks_are_those_of_the_inverted_law(spread: float, blocks: int) -> None:
    record = np.zeros((blocks, RECORD))
    record[:, DENSITY] = np.arange(blocks)
    alpha = blocks / math.expm1(spread)
    u = np.random.default_rng(1).random((RUN * 257 + 5, 3), np.float32)
    u[:2, 0] = 0.0, np.float32(1.0 - 2.0**-24)
    direction, drawn = np.empty_like(u), np.empty(len(u), np.float32)
    sample_law(u, alpha, False, record, direction, drawn)
    x = alpha * np.expm1(u[:, 0].astype(np.float64) * np.log1p(blocks / alpha))
    # Exponents up to 690 carry an error of 690 · 2⁻⁵³, and so does x relatively.
    clear = np.abs(x - np.round(x)) > 1e-12 * x
    np.testing.assert_array_equal(drawn[clear], np.minimum(x.astype(int), blocks - 1)[clear])
    assert clear.mean() > 0.9
    assert (np.abs(np.linalg.norm(direction, axis=1) - 1.0) < 4.0 * 2.0**-24).all()
