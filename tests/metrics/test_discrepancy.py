"""The discrepancy of known patterns, its formula in plain NumPy, and its errors."""

import math

import numpy as np
import pytest

from metrics.discrepancy import generalized_discrepancy
from samplers import EnvlightError, threads


def random_points(count):
    point = np.random.default_rng(count).normal(size=(count, 3))
    return point / np.linalg.norm(point, axis=1, keepdims=True)


@pytest.mark.parametrize("count", [1, 2, 129, 300])
def test_the_formula_in_plain_numpy(count):
    point = random_points(count)
    chord = np.linalg.norm(point[:, None] - point, axis=2)
    square = (1.0 - 2.0 * np.log1p(0.5 * chord)).sum()
    expected = math.sqrt(square) / (2.0 * math.sqrt(math.pi) * count)
    # count² terms of order one that cancel to about `count`: at most 300 ε.
    assert generalized_discrepancy(point) == pytest.approx(expected, rel=1e-12)


def test_random_points_have_the_expected_square():
    rng = np.random.default_rng(0)
    count, rounds = 200, 400
    squares = []
    for _ in range(rounds):
        point = rng.normal(size=(count, 3))
        point /= np.linalg.norm(point, axis=1, keepdims=True)
        squares.append(generalized_discrepancy(point) ** 2)
    error = np.std(squares) / math.sqrt(rounds)
    assert abs(np.mean(squares) - 1.0 / (4.0 * math.pi * count)) < 4.0 * error


def test_coincident_points_are_the_worst():
    point = np.tile([0.0, 0.0, 1.0], (500, 1))
    assert generalized_discrepancy(point) == pytest.approx(0.5 / math.sqrt(math.pi), rel=1e-14)


def test_a_rotation_changes_nothing():
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    point = random_points(400)
    # 1.6e5 terms, each off by a few ε, in a sum of about 8.
    assert generalized_discrepancy(point @ turn) == pytest.approx(
        generalized_discrepancy(point), rel=1e-9
    )


def test_the_thread_count_changes_no_bit(monkeypatch):
    found = []
    for count in (1, 3):
        monkeypatch.setattr(threads, "_thread_count", count)
        found.append(generalized_discrepancy(random_points(500)))
    assert found[0] == found[1]


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.ones((4, 2)), np.ones((4, 3)), [[math.nan] * 3]]
)
def test_bad_points_are_errors(points):
    with pytest.raises(EnvlightError, match="discrepancy"):
        generalized_discrepancy(points)
