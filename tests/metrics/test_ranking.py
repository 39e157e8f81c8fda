"""Ranks, tests and ratios against printed tables and worked examples."""

import math
from itertools import combinations, product

import numpy as np
import pytest

from metrics.ranking import (
    block_ranks,
    compare_pairs,
    critical_difference,
    friedman_test,
    holm,
    indistinct_groups,
    mean_ranks,
    ratio_to_baseline,
    signed_rank,
)
from samplers.errors import EnvlightError


def test_ties_share_the_best_rank():
    errors = [[0.3, 0.1, 0.1, 0.5], [0.2, 0.2, 0.2, 0.1]]
    assert block_ranks(errors).tolist() == [[3, 1, 1, 4], [2, 2, 2, 1]]
    assert block_ranks(errors, "average").tolist() == [[3, 1.5, 1.5, 4], [3, 3, 3, 1]]
    assert mean_ranks(errors).tolist() == [2.5, 1.5, 1.5, 2.5]


def test_one_tie_lowers_the_sum_of_ranks_by_one():
    # Seven methods on 32 blocks have rank sums of 28 · 32 = 896, 895 with one tied pair.
    errors = np.random.default_rng(0).random((32, 7))
    assert block_ranks(errors).sum() == 896
    errors[5, 2] = errors[5, 4]
    assert block_ranks(errors).sum() == 895
    assert block_ranks(errors, "average").sum() == 896


def test_infinite_errors_rank_last():
    assert block_ranks([[1.0, math.inf, 0.5]]).tolist() == [[2, 3, 1]]


def test_friedman_statistic_follows_its_formula():
    errors = np.random.default_rng(1).random((12, 5)) + np.arange(5) * 0.1
    blocks, methods = errors.shape
    rank = mean_ranks(errors)
    scale = 12.0 * blocks / (methods * (methods + 1))
    expected = scale * (np.sum(rank**2) - methods * (methods + 1) ** 2 / 4)
    result = friedman_test(errors)
    assert result.statistic == pytest.approx(expected, rel=1e-12)
    assert (result.blocks, result.methods) == (12, 5)


def test_friedman_p_value_is_that_of_chi_square():
    # Three methods in the same order in ten blocks: χ² = 20 with 2 degrees of freedom, p = e⁻¹⁰.
    result = friedman_test([[1.0, 2.0, 3.0]] * 10)
    assert result.statistic == pytest.approx(20.0)
    assert result.p_value == pytest.approx(math.exp(-10.0), rel=1e-9)


def test_friedman_of_ties_alone_finds_nothing():
    result = friedman_test([[2.0, 2.0, 2.0], [1.0, 1.0, 1.0]])
    assert (result.statistic, result.p_value) == (0.0, 1.0)


# Demšar 2006, table 5(a): q for α = 0.05 and 0.10, printed with three decimals.
@pytest.mark.parametrize(
    ("methods", "level", "q"),
    [
        (2, 0.05, 1.960), (3, 0.05, 2.343), (4, 0.05, 2.569), (5, 0.05, 2.728),
        (7, 0.05, 2.949), (10, 0.05, 3.164), (2, 0.10, 1.645), (7, 0.10, 2.693),
    ],
)  # fmt: skip
def test_critical_difference_has_the_printed_quantiles(methods, level, q):
    scale = math.sqrt(methods * (methods + 1) / (6.0 * 32))
    assert critical_difference(methods, 32, level) / scale == pytest.approx(q, abs=1.5e-3)


def test_bars_join_what_is_not_distinct():
    ranks = [4.0, 1.0, 2.0, 2.8, 6.0]
    assert indistinct_groups(ranks, 1.0) == [(1, 2), (2, 3)]
    assert indistinct_groups(ranks, 1.9) == [(1, 2, 3), (3, 0)]
    assert indistinct_groups(ranks, 0.5) == []
    assert indistinct_groups(ranks, 9.0) == [(1, 2, 3, 0, 4)]


def test_ratio_is_the_geometric_mean():
    errors = np.array([[1.0, 2.0, 0.5], [2.0, 1.0, 1.0], [3.0, 12.0, 1.5]])
    result = ratio_to_baseline(errors, 0)
    assert result.ratio == pytest.approx([1.0, 4.0 ** (1.0 / 3.0), 0.5])
    assert ((result.low <= result.ratio) & (result.ratio <= result.high)).all()


def test_interval_agrees_with_that_of_a_normal_mean():
    blocks, sigma = 400, 0.5
    difference = np.random.default_rng(3).normal(0.2, sigma, blocks)
    errors = np.exp(np.stack([np.zeros(blocks), difference], axis=1))
    result = ratio_to_baseline(errors, 0)
    half = 1.96 * difference.std() / math.sqrt(blocks)
    found = np.log([result.low[1], result.high[1]]) - difference.mean()
    # A 2.5 % quantile of 10⁴ draws has a standard error of 2.7 % of σ, so 1.4 % of the half-width;
    # skewness of the mean of 400 values adds about as much.
    assert found == pytest.approx([-half, half], rel=0.06)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: block_ranks([[1.0, math.nan]]), "block 0 for method 1"),
        (lambda: block_ranks([1.0, 2.0]), "shape"),
        (lambda: block_ranks([[1.0, 2.0]], "dense"), "dense"),
        (lambda: friedman_test([[1.0, 2.0]]), "3 methods"),
        (lambda: critical_difference(1, 10), "at least 2"),
        (lambda: ratio_to_baseline([[0.0, 1.0]], 0), "no ratio"),
        (lambda: ratio_to_baseline([[1.0, 1.0]], 2), "baseline 2"),
    ],
)
def test_what_cannot_be_ranked_is_refused(call, message):
    with pytest.raises(EnvlightError, match=message):
        call()


def test_pairs_are_counted_and_mirror_each_other():
    errors = np.random.default_rng(8).lognormal(size=(12, 5))
    errors[3, 1], errors[5, :2] = errors[3, 2], errors[4, :2]  # pairs with a zero, and with a tie
    pairs = compare_pairs(errors)
    for a, b in product(range(5), repeat=2):
        assert pairs.wins[a, b] == (errors[:, a] < errors[:, b]).sum() == pairs.losses[b, a]
        assert pairs.ties[a, b] == (errors[:, a] == errors[:, b]).sum()
        assert pairs.low[a, b] * pairs.high[b, a] == pytest.approx(1.0, rel=1e-12)
        assert pairs.p_value[a, b] == pairs.p_value[b, a]
    alone = holm([signed_rank(np.log(a / b)) for a, b in combinations(errors.T, 2)])
    assert pairs.p_value[np.triu_indices(5, 1)] == pytest.approx(alone, rel=1e-12)
    assert (pairs.low <= pairs.ratio * (1 + 1e-12)).all()
    assert (pairs.ratio <= pairs.high * (1 + 1e-12)).all()
    assert np.diag(pairs.ratio).tolist() == [1.0] * 5 == np.diag(pairs.p_value).tolist()


def test_a_column_of_pairs_is_the_ratio_to_that_method():
    errors = np.random.default_rng(9).lognormal(size=(10, 4))
    pairs = compare_pairs(errors)
    for baseline in range(4):
        expected = ratio_to_baseline(errors, baseline)
        for found, values in ((pairs.ratio, expected.ratio), (pairs.low, expected.low),
                              (pairs.high, expected.high)):  # fmt: skip
            np.testing.assert_allclose(found[:, baseline], values, rtol=1e-12)


def test_a_third_method_changes_nothing_about_two_but_the_correction():
    errors = np.random.default_rng(10).lognormal(size=(9, 3))
    two = compare_pairs(errors[:, :2])
    three = compare_pairs(errors)
    assert (two.wins == three.wins[:2, :2]).all()
    np.testing.assert_allclose(two.ratio, three.ratio[:2, :2], rtol=1e-12)
    np.testing.assert_allclose(two.low, three.low[:2, :2], rtol=1e-12)
    assert three.p_value[0, 1] >= two.p_value[0, 1]
    assert two.p_value[0, 1] == signed_rank(np.log(errors[:, 0] / errors[:, 1]))  # alone


def test_pairs_without_a_ratio_are_still_won_and_lost():
    pairs = compare_pairs([[0.0, 1.0], [0.0, 0.0], [1.0, math.inf]])
    assert (pairs.wins[0, 1], pairs.ties[0, 1], pairs.losses[0, 1]) == (2, 1, 0)
    assert np.isnan(pairs.ratio).all()
    # Two signs that agree: 2 / 2².
    assert pairs.p_value[0, 1] == pytest.approx(0.5)


def test_holm_multiplies_the_smallest_most():
    corrected = holm(np.array([0.03, 0.01, 0.02, 0.9]))
    # 0.01 · 4, then 0.02 · 3, then 0.03 · 2 = 0.06, 0.9 · 1.
    assert corrected == pytest.approx([0.06, 0.04, 0.06, 0.9])
    assert holm(np.array([0.5, 0.6])).max() == 1.0


def test_signed_rank_is_the_exact_test_for_few_cases():
    assert signed_rank(np.array([1.0, 2.0, 3.0, 4.0, 5.0])) == pytest.approx(2 / 2**5)
    assert signed_rank(np.zeros(4)) == 1.0
