"""The constants of FLIP: colour matrices, filter kernels, and the scale of colour differences.

Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference
Evaluator for Alternating Images", Proc. ACM Computer Graphics and Interactive Techniques 3(2),
2020, sections 4.1 (contrast sensitivity, colour differences) and 4.2 (features); the contrast
sensitivity functions are those of Johnson and Fairchild 2003 as refitted there.

A kernel is given by its half: element k is the weight at distance k from the centre.
"""

import math

import numpy as np
from numpy.typing import NDArray

PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * math.pi / 180.0
"""The customary viewing condition: a display 0.7 m and 3840 pixels wide, seen from 0.7 m."""

XYZ_FROM_RGB = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
"""Linear Rec. 709 to CIE XYZ under D65; the rows' sums are the white point."""
XYZ_FROM_RGB /= XYZ_FROM_RGB.sum(axis=1, keepdims=True)  # relative to white from here on

OPPONENT_FROM_RGB = np.array([[0, 1, 0], [1, -1, 0], [0, 1, -1]]) @ XYZ_FROM_RGB
"""To (y, x − y, y − z): YCxCz but for offset and scale, which normalised filters keep."""
RGB_FROM_OPPONENT = np.linalg.inv(OPPONENT_FROM_RGB)

ACHROMATIC_WIDTH = 0.0047
RED_GREEN_WIDTH = 0.0053
BLUE_YELLOW = ((34.1, 0.04), (13.5, 0.025))
"""(amplitude, width) of each Gaussian of the contrast sensitivity in frequency."""
FEATURE_WIDTH = 0.082
"""Width of the features that the eye sees best, in degrees."""
EXPONENT = 0.7
KNEE, KNEE_ERROR = 0.4, 0.95
"""Colour differences up to KNEE of the largest one fill [0, KNEE_ERROR], linearly."""

LAB_DELTA = 6.0 / 29.0


def _radius(sigma_in_pixels: float) -> int:
    return math.ceil(3.0 * sigma_in_pixels)


SPATIAL_RADIUS = _radius(math.sqrt(BLUE_YELLOW[0][1] / (2.0 * math.pi**2)) * PIXELS_PER_DEGREE)
FEATURE_SIGMA = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE
FEATURE_RADIUS = _radius(FEATURE_SIGMA)


def _gaussian(width: float) -> NDArray[np.float64]:
    """Half of exp(−π² d² / width), d in degrees, not normalised."""
    distance = np.arange(SPATIAL_RADIUS + 1) / PIXELS_PER_DEGREE
    return np.exp(-(math.pi**2) * distance**2 / width)


def _total(half: NDArray[np.float64]) -> float:
    return float(half[0] + 2.0 * half[1:].sum())


def _narrow(width: float) -> NDArray[np.float32]:
    """A normalised Gaussian without the weights that a float32 sum would not show."""
    half = _gaussian(width) / _total(_gaussian(width))
    return half[half > 1e-9].astype(np.float32)


def _blue_yellow() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Both Gaussians of the horizontal pass, and their share in the kernel's sum, (2,)."""
    halves = [_gaussian(width) for _, width in BLUE_YELLOW]
    share = np.array(
        [
            amplitude * math.sqrt(math.pi / width) * _total(half) ** 2
            for (amplitude, width), half in zip(BLUE_YELLOW, halves, strict=True)
        ]
    )
    wide, slim = [(half / _total(half)).astype(np.float32) for half in halves]
    return wide, slim, (share / share.sum()).astype(np.float32)


def _features() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Blur, edge (odd: the weight at −k is the negative) and point detector.

    The detectors are the first and second derivative of the Gaussian; positive weights sum to 1
    and negative ones to −1.
    """
    k = np.arange(FEATURE_RADIUS + 1)
    blur = np.exp(-(k**2) / (2.0 * FEATURE_SIGMA**2))
    edge = k * blur
    point = (k**2 / FEATURE_SIGMA**2 - 1.0) * blur
    both = np.where(k == 0, 1.0, 2.0)
    rising, falling = np.maximum(point, 0.0), np.minimum(point, 0.0)
    point = rising / (both * rising).sum() - falling / (both * falling).sum()
    return (
        (blur / _total(blur)).astype(np.float32),
        (edge / edge.sum()).astype(np.float32),
        point.astype(np.float32),
    )


ACHROMATIC, RED_GREEN = _narrow(ACHROMATIC_WIDTH), _narrow(RED_GREEN_WIDTH)
BLUE_YELLOW_WIDE, BLUE_YELLOW_SLIM, BLUE_YELLOW_SHARE = _blue_yellow()
BLUR, EDGE, POINT = _features()


def _hunt_lab(rgb: tuple[float, float, float]) -> NDArray[np.float64]:
    """L*a*b* of linear RGB, a* and b* scaled by L*/100 after Hunt."""
    white_relative = XYZ_FROM_RGB @ np.array(rgb)
    x, y, z = np.where(
        white_relative > LAB_DELTA**3,
        np.cbrt(white_relative),
        white_relative / (3.0 * LAB_DELTA**2) + 4.0 / 29.0,
    )
    lightness = 116.0 * y - 16.0
    hunt = 0.01 * lightness
    return np.array([lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)])


def _largest_difference() -> float:
    """The colour difference between green and blue, the largest that a display can show."""
    green, blue = _hunt_lab((0.0, 1.0, 0.0)), _hunt_lab((0.0, 0.0, 1.0))
    hyab = abs(green[0] - blue[0]) + math.hypot(*(green[1:] - blue[1:]))
    return hyab**EXPONENT


LARGEST_DIFFERENCE = _largest_difference()
