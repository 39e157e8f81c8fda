"""The discrepancy of known patterns, its formula in plain NumPy, and its errors."""

import math

import healpix
import numpy as np
import pytest

from metrics.discrepancy import generalized_discrepancy
from samplers import EnvlightError, threads


def on_sphere(z, phi):
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=-1).reshape(-1, 3)


def healpix_points(count):
    side = math.isqrt(count // 12)
    return np.stack(healpix.pix2vec(side, np.arange(count)), axis=1)


def hammersley(count):
    number, digit, phi = np.arange(count), 0.5, np.zeros(count)
    while number.any():
        phi += digit * (number & 1)
        number, digit = number >> 1, 0.5 * digit
    return on_sphere(1.0 - (2.0 * np.arange(count) + 1.0) / count, 2.0 * np.pi * phi)


def lattice(rows):
    theta, phi = (np.arange(rows) + 0.5) / rows, (np.arange(2 * rows) + 0.5) / (2 * rows)
    z, phi = np.broadcast_arrays(np.cos(np.pi * theta)[:, None], 2.0 * np.pi * phi)
    return on_sphere(z, phi)


def cube_map(side):
    a, b = np.meshgrid(*[(np.arange(side) + 0.5) / side * 2.0 - 1.0] * 2)
    one = np.ones_like(a)
    faces = [
        np.roll(np.stack([s * one, a, b], axis=-1), k, axis=-1) for s in (1, -1) for k in range(3)
    ]
    points = np.array(faces).reshape(-1, 3)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


# Worked out apart from this code, by the formula in double precision; rounded to five places.
KNOWN = {
    healpix_points: {12: 0.04032, 48: 0.01414, 192: 0.00497, 768: 0.00175, 3072: 0.00062},
    hammersley: {12: 0.04192, 48: 0.01497, 192: 0.00527, 768: 0.00187, 3072: 0.00066},
    lattice: {2: 0.05963, 5: 0.03361, 10: 0.03107, 20: 0.03069, 39: 0.03064},
    cube_map: {1: 0.06669, 3: 0.01496, 6: 0.00865, 11: 0.00755, 23: 0.00734},
}


@pytest.mark.parametrize("pattern", KNOWN, ids=lambda pattern: pattern.__name__)
def test_known_patterns(pattern):
    for size, expected in KNOWN[pattern].items():
        assert generalized_discrepancy(pattern(size)) == pytest.approx(expected, abs=0.5001e-5)


@pytest.mark.parametrize("count", [1, 2, 129, 300])
def test_the_formula_in_plain_numpy(count):
    point = np.random.default_rng(count).normal(size=(count, 3))
    point /= np.linalg.norm(point, axis=1, keepdims=True)
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
    point = hammersley(400)
    # 1.6e5 terms, each off by a few ε, in a sum of about 8.
    assert generalized_discrepancy(point @ turn) == pytest.approx(
        generalized_discrepancy(point), rel=1e-9
    )


def test_the_thread_count_changes_no_bit(monkeypatch):
    found = []
    for count in (1, 3):
        monkeypatch.setattr(threads, "_thread_count", count)
        found.append(generalized_discrepancy(hammersley(500)))
    assert found[0] == found[1]


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.ones((4, 2)), np.ones((4, 3)), [[math.nan] * 3]]
)
def test_bad_points_are_errors(points):
    with pytest.raises(EnvlightError, match="discrepancy"):
        generalized_discrepancy(points)
