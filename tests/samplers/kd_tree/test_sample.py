"""Drawing from the law of a kd-tree's blocks, against the formula in NumPy."""

import math

import numpy as np
import pytest

from samplers.kd_tree.sample import DENSITY, RECORD, RUN, sample_law


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
