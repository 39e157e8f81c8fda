"""Each metric against its formula in plain NumPy, and its behaviour on images without an answer."""

import math

import numpy as np
import pytest

from metrics.errors import exposure_scale, psnr, relative_rmse, rmse, srgb_8bit
from samplers.errors import EnvlightError

METRICS = [rmse, relative_rmse, psnr]


def pair(seed=0, shape=(37, 53, 3)):
    rng = np.random.default_rng(seed)
    reference = np.exp(rng.normal(size=shape)).astype(np.float32)
    return (reference * np.exp(0.2 * rng.normal(size=shape))).astype(np.float32), reference


def test_rmse_is_the_root_of_the_mean_square():
    image, reference = pair()
    expected = np.sqrt(np.mean((image.astype(np.float64) - reference) ** 2))
    assert rmse(image, reference) == pytest.approx(expected, rel=1e-12)


def test_rmse_keeps_small_errors_beside_a_sun():
    # A float32 sum would lose 1e5 × 1e-6 beside 1e10; float64 keeps 16 digits.
    reference = np.ones((200, 200, 3), np.float32)
    image = reference + np.float32(2.0**-10)
    image[0, 0, 0] = 1e5
    expected = math.sqrt(((1e5 - 1.0) ** 2 + (200 * 200 * 3 - 1) * 2.0**-20) / (200 * 200 * 3))
    assert rmse(image, reference) == pytest.approx(expected, rel=1e-14)


def test_relative_rmse_follows_its_formula():
    image, reference = (x.astype(np.float64) for x in pair(1))
    floor = (0.1 * reference.mean()) ** 2
    per_pixel = ((image - reference) ** 2).mean(2) / ((reference**2).mean(2) + floor)
    expected = np.sqrt(per_pixel.mean())
    assert relative_rmse(image, reference) == pytest.approx(expected, rel=1e-12)


def test_relative_rmse_does_not_depend_on_the_unit():
    image, reference = pair(2)
    # A power of two scales every float exactly, and so the squares and their sums.
    scale = np.float32(2.0**20)
    assert relative_rmse(scale * image, scale * reference) == relative_rmse(image, reference)


def test_relative_rmse_of_a_constant_factor_is_about_that_factor():
    reference = np.full((8, 9, 3), 5.0, np.float32)
    # One percent of regularisation at the mean: 0.25 / √1.01, exact up to rounding.
    assert relative_rmse(1.25 * reference, reference) == pytest.approx(0.25 / math.sqrt(1.01))


def test_relative_rmse_against_black():
    black = np.zeros((4, 5, 3), np.float32)
    assert relative_rmse(black, black) == 0.0
    assert relative_rmse(black + 1, black) == math.inf


def test_psnr_counts_eight_bit_steps():
    steps = np.arange(255, dtype=np.float64).reshape(15, 17, 1) / 255.0
    encoded = np.repeat(steps, 3, axis=2)

    def decode(y):
        return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)

    image, reference = decode(encoded + 1.0 / 255.0), decode(encoded)
    assert (srgb_8bit(image).astype(int) - srgb_8bit(reference) == 1).all()
    assert psnr(image, reference) == pytest.approx(20.0 * math.log10(255.0), rel=1e-14)


def test_psnr_clips_what_a_screen_cannot_show():
    reference = np.full((3, 4, 3), 2.0, np.float32)
    assert psnr(50.0 * reference, reference) == math.inf
    assert psnr(-reference, 0.0 * reference) == math.inf


def test_equal_images_have_no_error():
    image, _ = pair(4)
    assert rmse(image, image) == 0.0 == relative_rmse(image, image)
    assert psnr(image, image) == math.inf


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e39])
@pytest.mark.parametrize("where", [0, 1])
def test_a_value_that_is_not_finite_is_an_error(metric, bad, where):
    images = [image.astype(np.float64) for image in pair(6)]
    images[where][30, 20, 1] = bad
    with pytest.raises(EnvlightError, match="row 30, column 20, channel G"):
        metric(*images)


@pytest.mark.parametrize("metric", METRICS)
def test_other_shapes_are_an_error(metric):
    image, reference = pair(7)
    for a, b in [(image[1:], reference), (image[..., 0], reference), (image[:0], reference[:0])]:
        with pytest.raises(EnvlightError, match="shape"):
            metric(a, b)


def test_exposure_brings_the_foreground_to_its_target():
    _, reference = pair(8)
    mask = np.zeros(reference.shape[:2], bool)
    mask[5:20, 10:30] = True
    scale = exposure_scale(reference, mask)
    luminance = (scale * reference.astype(np.float64)) @ [0.2126, 0.7152, 0.0722]
    assert luminance[mask].mean() == pytest.approx(0.4, rel=1e-12)
    assert exposure_scale(reference) == exposure_scale(reference, np.ones_like(mask))


def test_exposure_of_black_or_of_nothing_is_one():
    _, reference = pair(9)
    mask = np.zeros(reference.shape[:2], bool)
    assert exposure_scale(reference, mask) == 1.0
    assert exposure_scale(np.zeros_like(reference)) == 1.0


def test_a_mask_of_another_shape_is_an_error():
    _, reference = pair(10)
    with pytest.raises(EnvlightError, match="mask"):
        exposure_scale(reference, np.ones((3, 3), bool))
