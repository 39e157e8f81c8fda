"""Maxima over rectangles of a map."""

import numpy as np
import pytest

from samplers.fhis.max_pyramid import largest_in, max_pyramid


def query(pyramid, top, left, bottom, right) -> float:
    return largest_in(
        pyramid.luminance, pyramid.row_weight, pyramid.start, pyramid.maximum,
        top, left, bottom, right,
    )  # fmt: skip


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (3, 6), (37, 74), (64, 128)])
def test_bound_is_never_below_the_maximum_and_is_reached(shape):
    rng = np.random.default_rng(1)
    luminance = rng.random(shape).astype(np.float32) ** 8
    weight = rng.random(shape[0])
    importance = luminance * weight[:, None]
    pyramid = max_pyramid(luminance, weight)
    assert pyramid.largest == importance.max()
    for _ in range(200):
        (top, bottom), (left, right) = (np.sort(rng.integers(0, n, 2)) for n in shape)
        exact = importance[top : bottom + 1, left : right + 1].max()
        bound = query(pyramid, top, left, bottom, right)
        # Blocks of a level reach past the rectangle by less than its larger side.
        reach = max(bottom - top, right - left)
        around = importance[
            max(0, top - reach) : bottom + reach + 1, max(0, left - reach) : right + reach + 1
        ]
        assert exact <= bound <= around.max()


def test_small_rectangles_are_exact():
    luminance = np.arange(50, dtype=np.float32).reshape(5, 10)
    pyramid = max_pyramid(luminance, np.ones(5))
    assert query(pyramid, 1, 2, 3, 4) == 34.0
