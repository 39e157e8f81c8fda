"""Distances between an image and its reference: RMSE, relative RMSE, PSNR; and the exposure rule.

Images are linear Rec. 709 RGB, (H, W, 3) float32. Every sum is taken in float64, row by row, so a
value does not depend on the number of threads. A NaN, an infinity or a difference in shape raises
EnvlightError.

RMSE is √(mean of (I − R)²) over all pixels and channels. A few bright pixels decide it, which
relative RMSE prevents: there each pixel's squared error is divided by the pixel's own squared
reference value, as in Rousselle, Knaus and Zwicker, "Adaptive sampling and reconstruction using
greedy error minimization" (ACM TOG 30(6), 2011), whose constant in the denominator is tied here to
the reference's mean, so that the metric does not change with the unit of radiance.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.images import checked_image, checked_pair
from metrics.registry import Metric, register
from metrics.truth import Image, Truth
from samplers.compiled import kernel
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.errors import EnvlightError
from samplers.threads import for_blocks

TARGET_LUMINANCE = 0.4
"""Mean luminance of a reference's foreground after `exposure_scale`."""
RELATIVE_FLOOR = 0.1
"""Reference values below this part of the reference's mean count as about this dark."""
ROWS = 32
"""Rows per block."""


@kernel
def _squared_error_rows(image, reference, floor, start, stop, out):
    """Per row: Σ over pixels and channels of squared error over `floor` + squared reference.

    floor : below zero for the plain squared error
    """
    for r in range(start, stop):
        total = 0.0
        for c in range(image.shape[1]):
            error = square = 0.0
            for k in range(3):
                truth = np.float64(reference[r, c, k])
                error += (np.float64(image[r, c, k]) - truth) ** 2
                square += truth * truth
            total += error if floor < 0.0 else error / (floor + square / 3.0)
        out[r] = total


def _mean_squared_error(
    image: NDArray[np.float32], reference: NDArray[np.float32], floor: float = -1.0
) -> float:
    rows = np.empty(len(image))
    for_blocks(
        lambda a, b: _squared_error_rows(image, reference, floor, a, b, rows), len(rows), ROWS
    )
    return math.fsum(rows) / image.size


def rmse(image: ArrayLike, reference: ArrayLike) -> float:
    """√(mean over pixels and channels of (I − R)²)."""
    return math.sqrt(_mean_squared_error(*checked_pair(image, reference)))


def relative_rmse(image: ArrayLike, reference: ArrayLike) -> float:
    """√(mean over pixels of mean_c (I − R)² / (mean_c R² + (0.1 m)²)).

    mean_c runs over a pixel's three channels and m is the mean of R over all pixels and channels:
    a pixel at a tenth of the mean is regularised as strongly as it is bright, one at the mean by
    one percent. Against a reference whose mean is zero it is 0 for an equal image, else infinite.
    """
    test, truth = checked_pair(image, reference)
    floor = (RELATIVE_FLOOR * float(truth.mean(dtype=np.float64))) ** 2
    if floor == 0.0:
        return 0.0 if np.array_equal(test, truth) else math.inf
    return math.sqrt(_mean_squared_error(test, truth, floor))


@kernel
def _encode_rows(image, start, stop, out):
    for r in range(start, stop):
        for c in range(image.shape[1]):
            for k in range(3):
                x = min(max(np.float64(image[r, c, k]), 0.0), 1.0)
                y = 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1.0 / 2.4) - 0.055
                out[r, c, k] = np.uint8(255.0 * y + 0.5)


def srgb_8bit(image: ArrayLike) -> NDArray[np.uint8]:
    """Linear RGB clipped to [0, 1], encoded by the sRGB curve and rounded to 0…255, (H, W, 3)."""
    linear = checked_image(image, "image")
    out = np.empty(linear.shape, np.uint8)
    for_blocks(lambda a, b: _encode_rows(linear, a, b, out), len(out), ROWS)
    return out


def psnr(image: ArrayLike, reference: ArrayLike) -> float:
    """Peak signal-to-noise ratio in dB as a viewer of 8-bit images measures it.

    Both images are clipped to [0, 1], sRGB-encoded and rounded to 0…255; then
    10 log₁₀(255² / mean squared error) over pixels and channels. Infinite where they agree.
    """
    test, truth = checked_pair(image, reference)
    difference = srgb_8bit(test).astype(np.int32) - srgb_8bit(truth)
    total = int(np.einsum("ijk,ijk->", difference, difference, dtype=np.int64))
    return 10.0 * math.log10(255.0**2 * truth.size / total) if total else math.inf


def exposure_scale(reference: ArrayLike, foreground_mask: ArrayLike | None = None) -> float:
    """The factor that brings the mean luminance of the reference's foreground to 0.4.

    foreground_mask : (H, W) bool; every pixel where it is None

    Without it a mean of errors over several maps is decided by the brightest map. The factor is 1
    where no mean can be scaled: a black foreground, or none.
    """
    truth = checked_image(reference, "reference")
    if foreground_mask is None:
        mask = np.ones(truth.shape[:2], np.bool_)
    else:
        mask = np.asarray(foreground_mask, np.bool_)
    if mask.shape != truth.shape[:2]:
        raise EnvlightError(
            f"a foreground mask of shape {mask.shape} for a reference of {truth.shape[:2]} pixels"
        )
    count = int(mask.sum())
    mean = np.sum(truth[mask], axis=0, dtype=np.float64) / max(count, 1)
    luminance = float(mean @ LUMINANCE_WEIGHTS)
    return TARGET_LUMINANCE / luminance if luminance > 0.0 else 1.0


def corrected_square(image: ArrayLike, reference: ArrayLike, noise_floor: float) -> float:
    """Mean squared error without the reference's own share: E[measured²] = error² + floor².

    noise_floor : the reference's RMSE by its own noise, independent of the image's

    Unbiased, hence negative at times where the error is about the floor.
    """
    return _mean_squared_error(*checked_pair(image, reference)) - noise_floor**2


def _corrected_rmse(image: Image, truth: Truth) -> float:
    return math.sqrt(max(0.0, corrected_square(image, truth.image, truth.noise_floor)))


def _measured_rmse(image: Image, truth: Truth) -> float:
    return rmse(image, truth.image)


def _unscaled_rmse(image: Image, truth: Truth) -> float:
    return rmse(image, truth.image) / truth.exposure


def _relative_rmse(image: Image, truth: Truth) -> float:
    return relative_rmse(image, truth.image)


def _psnr(image: Image, truth: Truth) -> float:
    return psnr(image, truth.image)


register(
    Metric(
        "rmse",
        "RMSE",
        _corrected_rmse,
        ranked=True,
        floor=lambda truth: truth.noise_floor,
        facts=lambda truth: {"exposure": truth.exposure},
    )
)
register(Metric("rmse_measured", "RMSE with the reference's noise", _measured_rmse))
register(Metric("rmse_unscaled", "RMSE before exposure", _unscaled_rmse))
register(Metric("relative_rmse", "relative RMSE", _relative_rmse))
register(Metric("psnr", "PSNR", _psnr, better="more", digits=2))
