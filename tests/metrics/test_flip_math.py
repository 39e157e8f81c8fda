"""The float32 functions against NumPy's float64 ones, over the range that FLIP uses and beyond."""

import numpy as np
import pytest
from numba import njit

from metrics.flip_math import cube_root, exp2, log2


@njit
def _apply(function, values):
    out = np.empty_like(values)
    for i in range(len(values)):
        out[i] = function(values[i])
    return out


def values(low, high, count=200_000):
    exponent = np.random.default_rng(0).uniform(low, high, count)
    return np.exp2(exponent).astype(np.float32)


def test_cube_root_is_right_to_the_last_bit():
    x = values(-120, 120)
    # One unit in the last place is at most 2⁻²³ of the value.
    np.testing.assert_allclose(_apply(cube_root, x), np.cbrt(x.astype(np.float64)), rtol=2**-23)


def test_cube_root_of_zero_is_finite():
    assert np.isfinite(_apply(cube_root, np.zeros(20, np.float32))).all()


@pytest.mark.parametrize(("low", "high"), [(-125, 125), (-1, 1), (-0.01, 0.01)])
def test_log2_keeps_float32_precision(low, high):
    x = values(low, high)
    # Three roundings of the result's size and as many of the part below one half: 3 × 2⁻²⁴ each.
    tolerance = 3 * 2**-24
    np.testing.assert_allclose(
        _apply(log2, x), np.log2(x.astype(np.float64)), rtol=tolerance, atol=tolerance
    )


def test_exp2_keeps_float32_precision():
    x = np.random.default_rng(1).uniform(-126, 127, 200_000).astype(np.float32)
    # Rounding of the last product and sum; the eighth term of the series is below 6e-9.
    np.testing.assert_allclose(_apply(exp2, x), np.exp2(x.astype(np.float64)), rtol=2**-23)


def test_exp2_of_very_negative_values_is_tiny():
    x = np.array([-126.0, -127.0, -1e9, -np.inf], np.float32)
    assert (_apply(exp2, x) == np.float32(2.0**-126)).all()


def test_powers_of_two_are_exact():
    n = np.arange(-126, 127)
    assert (_apply(log2, np.exp2(n).astype(np.float32)) == n).all()
    assert (_apply(exp2, n.astype(np.float32)) == np.exp2(n)).all()
