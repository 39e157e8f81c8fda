"""The latitude-longitude convention: round trips, solid angles, distances."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from samplers.sphere import (
    angular_distance,
    cap_solid_angle,
    direction_from_uv,
    normalized,
    pixel_direction,
    pixel_directions,
    pixel_of,
    pixel_of_direction,
    pixels_of,
    row_solid_angle,
    sine_cosine,
    turns,
    uv_from_direction,
)

EPSILON = float(np.finfo(np.float64).eps)


def random_directions(count, seed=0):
    vectors = np.random.default_rng(seed).standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("u", "v", "direction"),
    [
        (0.0, 0.5, (0, 0, -1)),
        (0.25, 0.5, (1, 0, 0)),
        (0.5, 0.5, (0, 0, 1)),
        (0.75, 0.5, (-1, 0, 0)),
        (0.3, 0.0, (0, 1, 0)),
        (0.3, 1.0, (0, -1, 0)),
    ],
)
def test_the_convention(u, v, direction):
    np.testing.assert_allclose(direction_from_uv(u, v), direction, atol=2 * EPSILON)


def test_coordinates_come_back():
    rng = np.random.default_rng(1)
    u, v = rng.random(10_000), rng.uniform(0.001, 0.999, 10_000)
    again_u, again_v = uv_from_direction(direction_from_uv(u, v))
    # An error of ε in a component turns φ by ε / sin θ, and 1 / (2π sin 0.001π) is 51.
    assert np.abs((again_u - u + 0.5) % 1.0 - 0.5).max() < 4 * 51 * EPSILON
    assert np.abs(again_v - v).max() < 4 * EPSILON


def test_coordinates_stay_in_range_at_the_seam_and_the_poles():
    tiny = 1e-300
    direction = [(-tiny, 0, -1), (tiny, 0, -1), (-0.0, 0, -1), (0, 1, 0), (0, -1, 0), (-tiny, 1, 0)]
    u, v = uv_from_direction(np.array(direction))
    assert ((u >= 0.0) & (u < 1.0)).all()
    assert ((v >= 0.0) & (v <= 1.0)).all()
    row, column = pixel_of_direction(np.array(direction), 7)
    assert ((row >= 0) & (row < 7) & (column >= 0) & (column < 14)).all()


@pytest.mark.parametrize("height", [1, 2, 7, 64])
def test_centres_lie_in_their_pixels(height):
    row, column = np.indices((height, 2 * height))
    direction = pixel_direction(row, column, height)
    np.testing.assert_array_equal(direction, pixel_directions(height))
    found_row, found_column = pixel_of_direction(direction, height)
    np.testing.assert_array_equal(found_row, row)
    np.testing.assert_array_equal(found_column, column)


@pytest.mark.parametrize("height", [1, 3, 512, 8192])
def test_the_compiled_twin_finds_the_same_pixels(height):
    direction = random_directions(5_000, seed=height)
    direction[:6] = [(0, 1, 0), (0, -1, 0), (0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0)]
    found = np.array([pixel_of(x, y, z, height) for x, y, z in direction])
    wanted = np.stack(pixel_of_direction(direction, height), axis=1)
    different = (found != wanted).any(axis=1)
    # Where they differ, the direction lies on a border: the coordinates differ by 10⁻¹¹, so that
    # only 5,000 × 2 × H × 10⁻¹¹ ≪ 1 of them should.
    assert different[6:].sum() <= 1
    assert ((found >= 0) & (found < [height, 2 * height])).all()


def sine(x):
    """Taylor's series in 50 digits."""
    term = total = x
    k = 1
    while abs(term) > Decimal(10) ** -48:
        term = -term * x * x / ((k + 1) * (k + 2))
        total += term
        k += 2
    return total


def test_fast_angles_are_exact_to_eleven_digits():
    angle = np.concatenate([np.random.default_rng(5).random(3_000), np.arange(16) / 16])
    for length in (1e-30, 1.0, 1e30):
        y, x = length * np.sin(2 * math.pi * angle), length * np.cos(2 * math.pi * angle)
        found = np.array([turns(*pair) for pair in zip(y, x, strict=True)])
        assert ((found >= 0.0) & (found < 1.0)).all()
        assert np.abs((found - angle + 0.5) % 1.0 - 0.5).max() < 2e-11
    found = np.array([sine_cosine(turn) for turn in angle])
    exact = np.stack([np.sin(2 * math.pi * angle), np.cos(2 * math.pi * angle)], axis=1)
    # The first terms left out, (π/4)¹³ / 13! and (π/4)¹⁴ / 14!, are below 10⁻¹¹.
    assert np.abs(found - exact).max() < 1e-11
    assert turns(0.0, 0.0) == 0.0


PI = Decimal("3.14159265358979323846264338327950288419716939937510582")


@pytest.mark.parametrize("row", [0, 1, 2, 4095, 8189, 8191])
def test_solid_angles_keep_all_digits_at_the_poles_of_a_large_map(row):
    height = 8192
    with localcontext() as context:
        context.prec = 60
        top, bottom = PI * row / height, PI * (row + 1) / height
        difference = 2 * sine((top + bottom) / 2) * sine((bottom - top) / 2)
        exact = float(2 * PI / (2 * height) * difference)
    # θ near π is rounded by ε π / 2, which the last row's sine, π / 2H, magnifies.
    tolerance = 8 * EPSILON + (EPSILON * 2 * height if row > height / 2 else 0.0)
    assert row_solid_angle(height, 2 * height)[row] == pytest.approx(exact, rel=tolerance)


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.3, math.pi / 2, 3.0, math.pi - 1e-6])
def test_angular_distance_is_exact_for_small_and_large_angles(angle):
    a = np.array([0.0, 0.6, 0.8])
    side = np.array([1.0, 0.0, 0.0])
    b = math.cos(angle) * a + math.sin(angle) * side
    assert angular_distance(a, b) == pytest.approx(angle, rel=1e-14, abs=2 * EPSILON)
    assert angular_distance(a, a) == 0.0


def test_normalized_survives_extremes():
    vectors = np.array([[3e-200, 4e-200, 0], [3e200, 0, 4e200], [0, 0, 0], [5e-324, 0, 0]])
    unit = normalized(vectors, [0.0, 1.0, 0.0])
    wanted = [[0.6, 0.8, 0], [0.6, 0, 0.8], [0, 1, 0], [1, 0, 0]]
    np.testing.assert_allclose(unit, wanted, atol=4 * EPSILON)


def test_caps_run_from_nothing_to_the_sphere():
    assert cap_solid_angle(math.pi) == pytest.approx(4.0 * math.pi, rel=4 * EPSILON)
    assert cap_solid_angle(math.pi / 2) == pytest.approx(2.0 * math.pi, rel=4 * EPSILON)
    assert cap_solid_angle(1e-9) == pytest.approx(math.pi * 1e-18, rel=4 * EPSILON)


def test_pixels_of_many_directions_are_those_of_each():
    axes = np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))])
    direction = np.concatenate([random_directions(997), axes]).astype(np.float32)
    row, column = np.empty(len(direction), np.int32), np.empty(len(direction), np.int32)
    for height in (2, 37, 512):
        pixels_of(direction, height, row, column)
        expected = [pixel_of(*map(float, way), height) for way in direction]
        np.testing.assert_array_equal(np.stack([row, column], axis=1), expected)
