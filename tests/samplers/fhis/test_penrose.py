"""The hierarchy of Penrose tiles, its codes, and the points that a threshold accepts."""

import math

import numpy as np
import pytest

from samplers.fhis.max_pyramid import MaxPyramid, max_pyramid
from samplers.fhis.penrose import FIBONACCI, PHI, POINTS_PER_INTEGRAL, Births, births
from samplers.fhis.penrose_correction import required_level
from tests.samplers.fhis.penrose_relaxation import CORNER, SIDE, inner

CONSTANT = max_pyramid(np.ones((1, 1), np.float32), np.ones(1))


def all_births(level: int) -> Births:
    """Every sampling tile of a whole root triangle up to a level: F(2L + 2) bounds their codes."""
    return births(CONSTANT, float(FIBONACCI[2 * level + 2] - 1), CORNER, SIDE)


def zeckendorf(value: int, length: int) -> int:
    """The greedy Fibonacci code of `value` as bits for F(length + 1) … F(2)."""
    bits = 0
    for j in range(length + 1, 1, -1):
        if value >= FIBONACCI[j]:
            value -= int(FIBONACCI[j])
            bits |= 1 << (j - 2)
    assert value == 0
    return bits


@pytest.mark.parametrize("level", range(1, 13))
def test_a_root_has_half_as_many_sampling_tiles_as_codes(level):
    born = all_births(level)
    assert born.level.max() == level
    assert abs(len(born.code) - 0.5 * FIBONACCI[2 * level + 2]) <= 2
    assert born.code.max() < FIBONACCI[2 * level + 2]


def test_codes_are_unique_and_fill_their_range_evenly():
    code = np.sort(all_births(12).code)
    assert len(np.unique(code)) == len(code)
    rank = np.arange(1, len(code) + 1)
    # Counts below a code follow from a two-letter substitution whose discrepancy grows at most
    # with the logarithm of the count, so a handful; a wrong bit anywhere makes it thousands.
    assert np.abs(rank - 0.5 * code).max() <= math.log(len(code))


def test_newest_bits_are_those_of_the_zeckendorf_code():
    born = all_births(8)
    for code, level, newest in zip(born.code, born.level, born.newest, strict=True):
        length = 2 * int(level)
        bits = zeckendorf(int(code), length)
        assert bits & (bits >> 1) == 0
        assert newest == (bits << 6 >> length)


def test_sampling_tiles_lie_within_the_root():
    # Twelve levels of additions of numbers below one: rounding is far below 1e-12.
    assert inner(all_births(10).position, -1e-12).all()


@pytest.mark.parametrize("threshold", [1.0, 2.0, 3.0, 7.9, 8.0, 20.0, 21.0, 1e5, 1e15])
def test_required_level_is_the_least_that_holds_every_code(threshold):
    level = int(required_level(np.array([threshold]))[0])
    assert FIBONACCI[2 * level + 2] > threshold >= FIBONACCI[2 * level]


def test_accepted_points_match_the_integral_of_importance():
    rng = np.random.default_rng(3)
    importance = rng.random((24, 48)).astype(np.float32) ** 3
    pyramid = max_pyramid(importance, np.ones(24))
    side = 96.0
    corner = (-side * (0.5 * PHI**2 - 0.25), -side / 8.0)
    scale = 4000.0 * side**2 / (POINTS_PER_INTEGRAL * importance.sum(dtype=np.float64))
    born = births(pyramid, scale, corner, side)
    # Random points would stray by √4000 = 63; even ones stray by less.
    assert abs(len(born.code) - 4000) < 63
    per_row = np.bincount(born.position[:, 1].astype(int), minlength=24)
    expected = 4000 * importance.sum(axis=1) / importance.sum()
    assert (np.abs(per_row - expected) < 4.0 * np.sqrt(expected)).all()


def brute_births(pyramid: MaxPyramid, scale: float, corner, side) -> np.ndarray:
    """Codes from the whole hierarchy under the largest importance, filtered afterwards."""
    height, width = pyramid.luminance.shape
    flat = max_pyramid(np.full((height, width), pyramid.largest, np.float32), np.ones(height))
    born = births(flat, scale, corner, side)
    column, row = np.floor(born.position).astype(int).T
    keep = scale * pyramid.luminance[row, column] >= born.code
    return np.sort(born.code[keep])


def test_pruning_loses_no_point_of_a_lone_bright_pixel():
    importance = np.full((13, 29), 1e-3, np.float32)
    importance[6, 17] = 1.0
    pyramid = max_pyramid(importance, np.ones(13))
    corner, side = (-60.0, -8.0), 60.0
    pruned = np.sort(births(pyramid, 3e6, corner, side).code)
    assert len(pruned) > 100
    assert np.array_equal(pruned, brute_births(pyramid, 3e6, corner, side))
