"""False edges: zero where there are none, exact for a step, blind to interleaving noise."""

import numpy as np
import pytest

from metrics.false_edges import false_edges
from samplers.errors import EnvlightError

FLAT = np.full((40, 60, 3), 0.5, np.float32)


def test_equal_images_and_missing_edges_have_none():
    step = FLAT.copy()
    step[:, 30:] = 1.0
    assert false_edges(step, step) == 0.0
    assert false_edges(FLAT, step) == 0.0


def test_a_step_is_counted_with_its_height_and_length():
    step = FLAT.copy()
    step[:, 30:] += 0.25
    # Averaging over four columns makes a ramp whose slopes sum up to the height, in each of the
    # 38 rows of gradients; there are 38 × 56 of them, and the reference's mean is 0.5.
    assert false_edges(step, FLAT) == pytest.approx(0.25 / 56 / 0.5, rel=1e-5)
    assert false_edges(7.0 * step, 7.0 * FLAT) == pytest.approx(0.25 / 56 / 0.5, rel=1e-5)


def test_a_pattern_of_the_interleavings_period_has_none():
    cells = np.random.default_rng(1).uniform(0.2, 0.8, (2, 4, 1)).astype(np.float32)
    noise = np.tile(cells, (20, 15, 3))
    # All windows hold the same eight values: what is left is rounding of sums in float64.
    assert false_edges(noise, FLAT) < 1e-12


def test_only_the_foreground_counts():
    step = FLAT.copy()
    step[:, 30:] += 0.25
    left = np.zeros(FLAT.shape[:2], bool)
    left[:, :20] = True
    assert false_edges(step, FLAT, left) == 0.0
    assert false_edges(step, FLAT, np.zeros_like(left)) == 0.0


def test_against_black_it_is_infinite_but_for_an_even_image():
    black = np.zeros_like(FLAT)
    step = FLAT.copy()
    step[:, 30:] += 0.25
    assert false_edges(step, black) == np.inf
    assert false_edges(FLAT, black) == 0.0


def test_bad_input_is_refused():
    with pytest.raises(EnvlightError, match="mask of shape"):
        false_edges(FLAT, FLAT, np.ones((3, 3), bool))
    with pytest.raises(EnvlightError, match="needs more"):
        false_edges(FLAT[:2], FLAT[:2])
    with pytest.raises(EnvlightError, match="NaN"):
        false_edges(FLAT * np.nan, FLAT)
