"""False edges: how much steeper an image is than its reference, where few lights cast hard shadows.

A global set of few lights draws shadow boundaries that the true, smooth illumination does not have.
Both luminances are first averaged over the cells of the interleaving pattern, 4 × 2 pixels: noise
of interleaved sets, which has that period, goes, boundaries stay. What is measured is the excess of
the image's gradient magnitude over the reference's, where positive, as a mean over the foreground
in units of the reference's mean luminance per pixel.

The measure is this project's own. It is blind to boundaries that are missing, and to those that are
in the wrong place where the reference has one as steep; other metrics see them.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.images import checked_pair
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.errors import EnvlightError

PATTERN = (2, 4)
"""Rows and columns of the interleaving pattern."""


def false_edges(
    image: ArrayLike, reference: ArrayLike, foreground_mask: ArrayLike | None = None
) -> float:
    """Mean positive excess of |∇Y| over the reference's, over the reference's mean luminance.

    foreground_mask : (H, W) bool, the pixels that count; all where it is None

    0 where the image is nowhere steeper, or where no pixel counts; infinite for an uneven image
    against a black reference. Raises EnvlightError for images smaller than the pattern's 5 × 3.
    """
    test, truth = checked_pair(image, reference)
    mask = np.ones(truth.shape[:2], np.bool_)
    if foreground_mask is not None:
        mask = np.asarray(foreground_mask, np.bool_)
    rows, columns = PATTERN
    if mask.shape != truth.shape[:2]:
        raise EnvlightError(f"false edges: a mask of shape {mask.shape} for {truth.shape[:2]}")
    if len(truth) <= rows or truth.shape[1] <= columns:
        raise EnvlightError(
            f"false edges: an image of {truth.shape[:2]}; it needs more than {PATTERN} pixels"
        )
    if not mask.any():
        return 0.0
    excess = np.maximum(_slope(test) - _slope(truth), 0.0)
    # A gradient belongs to the pixels that it is taken from.
    counted = mask[: excess.shape[0], : excess.shape[1]]
    luminance = (truth @ LUMINANCE_WEIGHTS)[mask]
    steep = float(excess[counted].mean(dtype=np.float64)) if counted.any() else 0.0
    mean = float(luminance.mean(dtype=np.float64))
    if mean > 0.0:
        return steep / mean
    return math.inf if steep > 0.0 else 0.0


def _slope(image: NDArray[np.float32]) -> NDArray[np.float64]:
    """|∇Y| (H − 2, W − 4) by forward differences of the luminance's means over the pattern."""
    smooth = _window_mean(image.astype(np.float64) @ LUMINANCE_WEIGHTS)
    across = smooth[:-1, 1:] - smooth[:-1, :-1]
    down = smooth[1:, :-1] - smooth[:-1, :-1]
    return np.hypot(across, down)


def _window_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means over all whole windows of the pattern's size, (H − 1, W − 3)."""
    windows = np.lib.stride_tricks.sliding_window_view(values, PATTERN)
    mean: NDArray[np.float64] = windows.mean(axis=(2, 3))
    return mean
