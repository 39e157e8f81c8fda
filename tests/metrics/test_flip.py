"""FLIP against the authors' implementation and against properties that it must have.

Where a colour difference is all but zero beside a strong feature difference, the error is that
difference to a power near zero, and float32 rounding shows in both implementations alike.
"""

import math

import flip_evaluator
import numpy as np
import OpenImageIO as oiio
import pytest

from metrics import flip_kernels
from metrics.flip import FlipReference, exposures_of, hdr_flip, ldr_flip
from samplers.errors import EnvlightError

PER_PIXEL = 5e-5
GREY_PER_PIXEL = 1e-3
"""For grey patterns. Their a* and b* are rounding alone, four times 500 × 2⁻²⁴ = 1.2e-4 at most,
and where lightness happens to agree that is the whole difference: 0.0576 × 1.2e-4^0.7 = 1.0e-4 of
colour error, which a feature difference of 0.25 raises to 1.0e-4^0.75 = 1.0e-3."""
MEAN = 1e-6
SHAPE = (34, 66, 3)


def lognormal(seed, shape=SHAPE, spread=1.0):
    return np.exp(spread * np.random.default_rng(seed).normal(size=shape)).astype(np.float32)


def smooth(seed, shape=SHAPE):
    """A few broad coloured waves: what shading without texture looks like."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: shape[0], : shape[1]]
    total = np.zeros(shape)
    for _ in range(6):
        fy, fx, phase = rng.normal(size=3) * (0.08, 0.08, 3.0)
        total += np.sin(fy * y + fx * x + phase)[..., None] * rng.normal(size=3) * 0.6
    return np.exp(total).astype(np.float32)


def noisy(image, seed, strength=0.1):
    noise = np.random.default_rng(seed).normal(size=image.shape)
    return (image * np.exp(strength * noise)).astype(np.float32)


def with_sun(image):
    image = image.copy()
    image[20:24, 30:34] *= 1e4
    return image


def with_black_half(image):
    image = image.copy()
    image[:, : image.shape[1] // 2 + 1] = 0.0
    return image


def checkers(size, shape=SHAPE):
    y, x = np.mgrid[: shape[0], : shape[1]]
    board = np.where((y // size + x // size) % 2 == 0, 0.1, 2.0)
    return np.repeat(board[..., None], 3, axis=2).astype(np.float32)


def primaries(seed, shape=SHAPE):
    """Blocks of fully saturated colours, which leave the display's range when filtered."""
    blocks = np.random.default_rng(seed).integers(0, 2, (shape[0] // 7 + 1, shape[1] // 7 + 1, 3))
    return np.kron(blocks, np.ones((7, 7, 1)))[: shape[0], : shape[1]].astype(np.float32)


def swapped(image):
    return np.ascontiguousarray(image[..., ::-1])


PAIRS = {
    "log-normal": (lognormal(0), noisy(lognormal(0), 1)),
    "wide log-normal": (lognormal(2, spread=2.5), noisy(lognormal(2, spread=2.5), 3, 0.5)),
    "smooth": (smooth(4), noisy(smooth(4), 5)),
    "smooth, faint noise": (smooth(6), noisy(smooth(6), 7, 0.02)),
    "smooth, brighter": (smooth(8), 1.3 * smooth(8)),
    "sun": (with_sun(smooth(9)), noisy(with_sun(smooth(9)), 10)),
    "missing sun": (with_sun(smooth(11)), smooth(11)),
    "black half": (with_black_half(smooth(12)), with_black_half(noisy(smooth(12), 13))),
    "lit black half": (with_black_half(smooth(14)), noisy(smooth(14), 15)),
    "black half with sun": (
        with_sun(with_black_half(smooth(16))[:, ::-1]),
        with_black_half(noisy(smooth(16), 17))[:, ::-1],
    ),
    "checkers": (checkers(5), checkers(6)),
    "fine checkers": (checkers(1), checkers(2)),
    "primaries": (primaries(18), primaries(19)),
    "other hues": (smooth(20), swapped(smooth(20))),
    "two patterns": (lognormal(21), lognormal(22)),
    "one row": (lognormal(23, (1, 300, 3)), lognormal(24, (1, 300, 3))),
    "one column": (lognormal(25, (200, 1, 3)), lognormal(26, (200, 1, 3))),
    "two pixels": (lognormal(27, (1, 2, 3)), lognormal(28, (1, 2, 3))),
    "exactly a tile": (lognormal(29, (64, 128, 3)), lognormal(30, (64, 128, 3))),
    "just over a tile": (lognormal(31, (65, 129, 3)), lognormal(32, (65, 129, 3))),
    "negative values": (lognormal(33), noisy(lognormal(33), 34) - np.float32(0.3)),
}
"""(reference, image), linear"""


def oracle(reference, image, kind):
    """Error map and parameters of the authors' implementation; arrays only, never a path."""
    reference, image = (np.ascontiguousarray(np.maximum(x, 0.0)) for x in (reference, image))
    error, _, parameters = flip_evaluator.evaluate(reference, image, kind, applyMagma=False)
    return error[..., 0], parameters


def assert_agree(result, expected, tolerance=PER_PIXEL):
    assert np.abs(result.error_map - expected).max() < tolerance
    assert result.mean == pytest.approx(expected.mean(dtype=np.float64), abs=MEAN)


def tolerance_of(name):
    return GREY_PER_PIXEL if "checkers" in name else PER_PIXEL


@pytest.mark.parametrize("name", PAIRS)
def test_hdr_flip_agrees_with_the_authors(name):
    reference, image = PAIRS[name]
    result = hdr_flip(reference, image)
    expected, parameters = oracle(reference, image, "HDR")
    # Exposures are below 32 here, where a float32 has steps of 2⁻¹⁹ = 1.9e-6.
    assert result.exposures.start == pytest.approx(parameters["startExposure"], abs=2e-6)
    assert result.exposures.stop == pytest.approx(parameters["stopExposure"], abs=2e-6)
    assert result.exposures.count == parameters["numExposures"]
    assert_agree(result, expected, tolerance_of(name))


@pytest.mark.parametrize("name", PAIRS)
def test_ldr_flip_agrees_with_the_authors(name):
    reference, image = (np.clip(x / 3.0, 0.0, 1.0) for x in PAIRS[name])
    expected, _ = oracle(reference, image, "LDR")
    assert_agree(ldr_flip(reference, image), expected, tolerance_of(name))


def _buffer(image):
    height, width = image.shape[:2]
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, oiio.FLOAT))
    buffer.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, 3), np.ascontiguousarray(image))
    return buffer


@pytest.mark.parametrize("name", ["log-normal", "smooth", "sun"])
def test_hdr_flip_agrees_with_openimageio(name):
    reference, image = PAIRS[name]
    luminance = np.sort((reference @ np.array([0.2126, 0.7152, 0.0722], np.float32)).ravel())
    difference = oiio.ImageBufAlgo.FLIP_diff(
        _buffer(reference),
        _buffer(image),
        hdr=1,
        maxluminance=float(luminance[-1]),
        medianluminance=float(luminance[luminance.size // 2]),
    )
    assert_agree(hdr_flip(reference, image), difference.get_pixels(oiio.FLOAT)[..., 0])


def test_what_is_kept_of_a_reference_changes_no_bit():
    reference, image = PAIRS["sun"]
    one_exposure = FlipReference.hdr(reference, count=1).views.nbytes
    kept = {}
    for exposures in (0, 3, 100):
        prepared = FlipReference.hdr(reference, cache_bytes=exposures * one_exposure)
        kept[prepared.views.shape[1]] = prepared.compare(image).error_map
    assert sorted(kept) == [0, 3, exposures_of(reference).count]
    first, *others = kept.values()
    assert first.any()
    assert all(np.array_equal(first, other) for other in others)


def test_a_changed_pixel_is_seen_within_the_margin_only():
    reference = lognormal(44, (150, 300, 3))
    image = reference.copy()
    image[70, 140] *= 3.0
    error = hdr_flip(reference, image).error_map
    rows, columns = np.nonzero(error)
    assert (rows.min(), rows.max()) == (70 - flip_kernels.MARGIN, 70 + flip_kernels.MARGIN)
    assert (columns.min(), columns.max()) == (140 - flip_kernels.MARGIN, 140 + flip_kernels.MARGIN)


def test_differences_beyond_white_are_invisible():
    reference = np.full((40, 50, 3), 4.0, np.float32)
    reference[10:20, 10:20] = 100.0
    image = np.where(reference == 100.0, np.float32(200.0), reference)
    assert hdr_flip(reference, image).error_map.any()
    assert not FlipReference.hdr(reference, 0.0, 2.0, 3).compare(image).error_map.any()


def test_ldr_flip_is_symmetric_and_hdr_flip_takes_exposures_from_the_reference():
    a, b = PAIRS["two patterns"]
    assert np.array_equal(ldr_flip(a / 9, b / 9).error_map, ldr_flip(b / 9, a / 9).error_map)
    assert hdr_flip(a, b).exposures != hdr_flip(b, a).exposures


def test_linear_and_encoded_images_are_the_same_to_ldr_flip():
    linear = [np.clip(x / 3.0, 0.0, 1.0) for x in PAIRS["smooth"]]
    encoded = [
        np.where(x <= 0.0031308, 12.92 * x, 1.055 * x.astype(np.float64) ** (1 / 2.4) - 0.055)
        for x in linear
    ]
    a, b = ldr_flip(*linear, encoded=False), ldr_flip(*encoded)
    # The constants of the two curves agree to 1e-7, as does float32.
    assert np.abs(a.error_map - b.error_map).max() < PER_PIXEL


def test_given_exposures_are_used_and_recorded():
    reference, image = PAIRS["smooth"]
    result = FlipReference.hdr(reference, start=-2.0, stop=1.5, count=5).compare(image)
    assert (result.exposures.start, result.exposures.stop, result.exposures.count) == (-2.0, 1.5, 5)
    expected, *_ = flip_evaluator.evaluate(
        reference,
        image,
        "HDR",
        applyMagma=False,
        parameters={"startExposure": -2.0, "stopExposure": 1.5, "numExposures": 5},
    )
    assert_agree(result, expected[..., 0])


@pytest.mark.parametrize("stops", [3, 10, 17])
def test_a_whole_number_of_stops_needs_as_many_exposures(stops):
    for scale in (0.3, 0.7, 11.0):
        reference = np.full((20, 20, 3), scale, np.float32)
        reference[0, 0] *= 2.0**stops
        assert exposures_of(reference).count == stops


def test_a_black_reference_has_exposures():
    black = np.zeros((20, 30, 3), np.float32)
    exposures = exposures_of(black)
    assert exposures.start == exposures.stop
    assert exposures.count == 2
    assert hdr_flip(black, black).mean == 0.0
    # 1e-3 is ten thousand times the smallest luminance and so white at this exposure.
    assert hdr_flip(black, black + np.float32(1e-3)).mean == pytest.approx(
        ldr_flip(black, black + 1).mean, abs=1e-6
    )


def test_extreme_values_give_finite_errors():
    reference = lognormal(45, (30, 40, 3)) * np.float32(1e36)
    image = lognormal(46, (30, 40, 3)) * np.float32(1e-40)
    for a, b in ((reference, image), (image, reference)):
        result = hdr_flip(a, b)
        assert math.isfinite(result.mean)
        assert 0.0 <= result.error_map.min() <= result.error_map.max() <= 1.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_values_that_are_not_finite_are_an_error(bad):
    image = lognormal(47, (20, 30, 3))
    broken = image.copy()
    broken[7, 8, 2] = bad
    for metric in (hdr_flip, ldr_flip):
        for pair in ((image, broken), (broken, image)):
            with pytest.raises(EnvlightError, match="row 7, column 8, channel B"):
                metric(*pair)


def test_bad_shapes_and_exposures_are_an_error():
    image = lognormal(48, (20, 30, 3))
    with pytest.raises(EnvlightError, match="resolution"):
        hdr_flip(image, image[1:])
    with pytest.raises(EnvlightError, match="shape"):
        ldr_flip(image[..., 0], image[..., 0])
    with pytest.raises(EnvlightError, match="start"):
        FlipReference.hdr(image, start=2.0, stop=1.0)
    with pytest.raises(EnvlightError, match="start"):
        FlipReference.hdr(image, start=math.nan)
    with pytest.raises(EnvlightError, match="at least 1"):
        FlipReference.hdr(image, count=0)
