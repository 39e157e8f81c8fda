"""Ranks, tests and ratios against printed tables and worked examples."""

import math

import numpy as np
import pytest

from metrics.ranking import (
    block_ranks,
    critical_difference,
    friedman_test,
    indistinct_groups,
    mean_ranks,
    ratio_to_baseline,
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
    expected = (
        12.0
        * blocks
        / (methods * (methods + 1))
        * (np.sum(rank**2) - methods * (methods + 1) ** 2 / 4)
    )
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
    result = ratio_to_baseline(errors, 0, np.random.default_rng(0))
    assert result.ratio == pytest.approx([1.0, 4.0 ** (1.0 / 3.0), 0.5])
    assert (result.low <= result.ratio).all()
    assert (result.ratio <= result.high).all()


def test_interval_has_no_width_where_the_ratio_is_constant():
    errors = np.random.default_rng(2).random((20, 1)) * [1.0, 3.0]
    result = ratio_to_baseline(errors, 0, np.random.default_rng(0))
    for bound in (result.low, result.ratio, result.high):
        assert bound == pytest.approx([1.0, 3.0], rel=1e-12)


def test_interval_agrees_with_that_of_a_normal_mean():
    blocks, sigma = 400, 0.5
    rng = np.random.default_rng(3)
    difference = rng.normal(0.2, sigma, blocks)
    errors = np.exp(np.stack([np.zeros(blocks), difference], axis=1))
    result = ratio_to_baseline(errors, 0, rng)
    half = 1.96 * difference.std() / math.sqrt(blocks)
    found = np.log([result.low[1], result.high[1]]) - difference.mean()
    # A 2.5 % quantile of 10⁴ draws has a standard error of 2.7 % of σ, so 1.4 % of the half-width;
    # skewness of the mean of 400 values adds about as much.
    assert found == pytest.approx([-half, half], rel=0.06)


def test_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(4)
    hits = 0
    for _ in range(300):
        errors = np.exp(rng.normal(size=(40, 2)))
        result = ratio_to_baseline(errors, 1, rng, confidence=0.9, resamples=500)
        hits += bool(result.low[0] <= 1.0 <= result.high[0])
    # Binomial with p = 0.9 has a standard deviation of 1.7 %; the percentile interval of 40 blocks
    # is narrow by about 1.3 % in width, so covers about 1 % less.
    assert abs(hits / 300 - 0.89) < 3 * 0.018


def test_same_seed_gives_the_same_interval():
    errors = np.random.default_rng(5).random((10, 3)) + 0.1
    a, b = (ratio_to_baseline(errors, 2, np.random.default_rng(7)) for _ in range(2))
    assert np.array_equal(a.low, b.low)
    assert np.array_equal(a.high, b.high)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: block_ranks([[1.0, math.nan]]), "block 0 for method 1"),
        (lambda: block_ranks([1.0, 2.0]), "shape"),
        (lambda: block_ranks([[1.0, 2.0]], "dense"), "dense"),
        (lambda: friedman_test([[1.0, 2.0]]), "3 methods"),
        (lambda: critical_difference(1, 10), "at least 2"),
        (lambda: ratio_to_baseline([[0.0, 1.0]], 0, np.random.default_rng(0)), "no ratio"),
        (lambda: ratio_to_baseline([[1.0, 1.0]], 2, np.random.default_rng(0)), "baseline 2"),
    ],
)
def test_what_cannot_be_ranked_is_refused(call, message):
    with pytest.raises(EnvlightError, match=message):
        call()
