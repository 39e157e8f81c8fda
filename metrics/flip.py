"""FLIP: the difference that a person sees when an image and its reference alternate on a screen.

Both images are filtered by the eye's contrast sensitivity and compared in a perceptual colour
space, and the difference is amplified where edges and points differ, which gives an error in
[0, 1] per pixel; the one number is its mean. HDR-FLIP shows both images at a series of exposures,
from the one at which the reference's brightest pixel is just not white to the one that does the
same to its median, and keeps each pixel's largest error. The exposures come from the reference
alone, so HDR-FLIP is not symmetric, and all methods measured against one reference share them.

Sources: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference
Evaluator for Alternating Images", Proc. ACM CGIT 3(2), 2020; Andersson, Nilsson, Shirley and
Akenine-Möller, "Visualizing Errors in Rendered High Dynamic Range Images", Eurographics 2021 short
papers, section 3 (exposures, tone mapping, maximum).

The cost is proportional to pixels × exposures. The reference's half of the work is done once in a
`FlipReference` and reused for every image compared with it; tiles without a visible difference
(equal pixels, or all that differs is white) are left out, which changes no bit.

Parameters, the authors' defaults: 67 pixels per degree, the ACES tone curve.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics import flip_kernels as kernels
from metrics.flip_math import exp2, f32, log2
from metrics.images import check_same_shape, checked_image
from metrics.registry import Metric, register
from metrics.truth import Image, Truth
from samplers.compiled import kernel
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.errors import EnvlightError
from samplers.threads import for_blocks

WHITE = 0.85
"""The tone-mapped value to which the first and last exposure bring maximum and median."""
DARKEST = float(np.finfo(np.float32).eps)
"""Maximum and median luminance are taken as at least this, so that black gives an exposure."""
CACHE_BYTES = 1 << 30
"""Memory that the views of one reference may take; what does not fit is computed each time."""
LARGEST_EXPOSURE = 127
"""In powers of two, either way: what float32 can scale by."""
ROUNDING = 1e-6
"""A whole number of stops between start and stop stays whole although logarithms are rounded."""
ROWS = 32
"""Rows per block of the passes over whole images."""


@dataclass(frozen=True)
class Exposures:
    """`count` exposures from `start` to `stop`, both included, in powers of two."""

    start: float
    stop: float
    count: int

    @property
    def scales(self) -> NDArray[np.float32]:
        """The factors 2^exposure, (count,)."""
        return np.exp2(np.linspace(self.start, self.stop, self.count)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class FlipResult:
    """mean : of the error map; error_map : (H, W) float32 in [0, 1]; exposures : None for LDR."""

    mean: float
    error_map: NDArray[np.float32]
    exposures: Exposures | None


def _white_point() -> float:
    """The larger x at which the tone curve reaches `WHITE`."""
    k0, k1, k2, k3, k4 = (float(k) for k in kernels.ACES)
    a, b, c = k0 - WHITE * k2, k1 - WHITE * k3, -WHITE * k4
    return (-b + math.copysign(math.sqrt(b * b - 4.0 * a * c), a)) / (2.0 * a)


def exposures_of(
    reference: ArrayLike,
    start: float | None = None,
    stop: float | None = None,
    count: int | None = None,
) -> Exposures:
    """The exposures at which HDR-FLIP looks at a reference; given values replace computed ones.

    start and stop bring the largest and the (upper) median luminance to the tone-mapped value
    0.85; count is one per stop of difference and at least 2.
    """
    image = np.maximum(checked_image(reference, "reference"), 0.0)
    weights = LUMINANCE_WEIGHTS.astype(np.float32)
    luminance = (image[..., 0] * weights[0] + image[..., 1] * weights[1]) + (
        image[..., 2] * weights[2]
    )
    flat = luminance.ravel()
    median = np.partition(flat, flat.size // 2)[flat.size // 2]
    white = _white_point()
    if start is None:
        start = math.log2(white / max(float(flat.max()), DARKEST))
    if stop is None:
        stop = math.log2(white / max(float(median), DARKEST))
    if not -LARGEST_EXPOSURE <= start <= stop <= LARGEST_EXPOSURE:
        raise EnvlightError(
            f"FLIP: exposures from {start} to {stop}; give a start that does not exceed the stop, "
            f"both within ±{LARGEST_EXPOSURE}"
        )
    if count is None:
        count = max(2, math.ceil(stop - start - ROUNDING))
    if count < 1:
        raise EnvlightError(f"FLIP: {count} exposures; at least 1 is needed")
    return Exposures(float(start), float(stop), int(count))


@kernel
def _decode_rows(image, encoded, start, stop, out):
    """Clip, and undo the sRGB curve where the image is encoded; a row is W × 3 values."""
    for r in range(start, stop):
        for c in range(image.shape[1]):
            x = min(max(image[r, c], f32(0.0)), f32(1.0))
            base = (max(x, f32(0.04045)) + f32(0.055)) / f32(1.055)
            power = exp2(f32(2.4) * log2(base))
            curved = power if x > f32(0.04045) else x / f32(12.92)
            out[r, c] = curved if encoded else x


def _displayed(image: NDArray[np.float32], encoded: bool) -> NDArray[np.float32]:
    """Linear values in [0, 1] of an image clipped to that range."""
    out = np.empty_like(image)
    source, target = image.reshape(len(image), -1), out.reshape(len(image), -1)
    for_blocks(lambda a, b: _decode_rows(source, encoded, a, b, target), len(image), ROWS)
    return out


@dataclass(frozen=True, eq=False)
class FlipReference:
    """A reference with its half of the work done; made by `hdr` or `ldr`.

    image : (H, W, 3) float32, linear
    exposures : None for LDR
    encoded : whether LDR images are sRGB-encoded
    views : (tiles, exposures kept, 5, ROWS, COLUMNS) float32
    """

    image: NDArray[np.float32]
    exposures: Exposures | None
    encoded: bool
    views: NDArray[np.float32]

    @classmethod
    def hdr(
        cls,
        image: ArrayLike,
        start: float | None = None,
        stop: float | None = None,
        count: int | None = None,
        cache_bytes: int = CACHE_BYTES,
    ) -> "FlipReference":
        """Reference of HDR-FLIP: linear RGB (H, W, 3); negative values are taken as 0.

        start, stop, count : see `exposures_of`
        cache_bytes : memory for what is kept; 0 where only one image will be compared
        """
        reference = checked_image(image, "reference")
        exposures = exposures_of(reference, start, stop, count)
        views = _views(reference, exposures.scales, True, cache_bytes)
        return cls(reference, exposures, False, views)

    @classmethod
    def ldr(
        cls, image: ArrayLike, encoded: bool = True, cache_bytes: int = CACHE_BYTES
    ) -> "FlipReference":
        """Reference of LDR-FLIP: RGB (H, W, 3), clipped to [0, 1].

        encoded : by the sRGB curve (default), otherwise linear
        cache_bytes : memory for what is kept; 0 where only one image will be compared
        """
        linear = _displayed(checked_image(image, "reference"), encoded)
        return cls(linear, None, encoded, _views(linear, _scales(None), False, cache_bytes))

    def compare(self, image: ArrayLike) -> FlipResult:
        """FLIP between the reference and an image of the same shape and encoding."""
        test = checked_image(image, "image")
        check_same_shape(test, self.image.shape)
        hdr = self.exposures is not None
        if not hdr:
            test = _displayed(test, self.encoded)
        error = np.empty(test.shape[:2], np.float32)
        scales, corners = _scales(self.exposures), _corners(test)

        def tile(start: int, stop: int) -> None:
            for i in range(start, stop):
                kernels.compare_tile(
                    self.image, test, *corners[i], scales, hdr, self.views[i], error
                )

        for_blocks(tile, len(corners), 1)
        return FlipResult(float(error.mean(dtype=np.float64)), error, self.exposures)


def _scales(exposures: Exposures | None) -> NDArray[np.float32]:
    return np.ones(1, np.float32) if exposures is None else exposures.scales


def _corners(image: NDArray[np.float32]) -> list[tuple[int, int]]:
    """Top and left of every tile."""
    return [
        (top, left)
        for top in range(0, image.shape[0], kernels.ROWS)
        for left in range(0, image.shape[1], kernels.COLUMNS)
    ]


def _views(
    image: NDArray[np.float32], scales: NDArray[np.float32], tone_mapped: bool, limit: int
) -> NDArray[np.float32]:
    """The views of all tiles, at as many of the exposures as `limit` bytes can hold."""
    corners = _corners(image)
    shape = kernels.VIEW_PLANES, kernels.ROWS, kernels.COLUMNS
    kept = min(len(scales), limit // (4 * len(corners) * math.prod(shape)))
    views = np.empty((len(corners), kept, *shape), np.float32)

    def tile(start: int, stop: int) -> None:
        for i in range(start, stop):
            kernels.views_of_tile(image, *corners[i], scales, tone_mapped, views[i])

    if kept:
        for_blocks(tile, len(corners), 1)
    return views


def hdr_flip(reference: ArrayLike, test: ArrayLike) -> FlipResult:
    """HDR-FLIP of two linear RGB images (H, W, 3), at the exposures that the reference asks for."""
    return FlipReference.hdr(reference, cache_bytes=0).compare(test)


def ldr_flip(reference: ArrayLike, test: ArrayLike, encoded: bool = True) -> FlipResult:
    """LDR-FLIP of two RGB images (H, W, 3) clipped to [0, 1]; see `FlipReference.ldr`."""
    return FlipReference.ldr(reference, encoded, cache_bytes=0).compare(test)


def _hdr_reference(truth: Truth) -> FlipReference:
    return FlipReference.hdr(truth.image)


def _ldr_reference(truth: Truth) -> FlipReference:
    return FlipReference.ldr(truth.image, encoded=False)


def _hdr(image: Image, truth: Truth, reference: FlipReference) -> float:
    return reference.compare(image).mean


def _hdr_map(image: Image, truth: Truth, reference: FlipReference) -> NDArray[np.float32]:
    return reference.compare(image).error_map


def _ldr(image: Image, truth: Truth, reference: FlipReference) -> float:
    return reference.compare(image).mean


def _hdr_floor(truth: Truth) -> float:
    """HDR-FLIP of the reference by its own noise: of one half against the other, over √2."""
    if truth.halves is None:
        return math.nan
    exposures = truth.made(_hdr_reference).exposures
    assert exposures is not None
    half = FlipReference.hdr(
        truth.halves[0], exposures.start, exposures.stop, exposures.count, cache_bytes=0
    )
    return half.compare(truth.halves[1]).mean / math.sqrt(2.0)


def _exposures(truth: Truth) -> dict[str, list[float]]:
    found = truth.made(_hdr_reference).exposures
    return {"flip_exposures": [found.start, found.stop, found.count]}


register(
    Metric(
        "flip", "FLIP", _hdr, needs=(_hdr_reference,), ranked=True, leads=True, floor=_hdr_floor,
        facts=_exposures, error_map=_hdr_map,
    )
)  # fmt: skip
register(Metric("flip_ldr", "LDR-FLIP", _ldr, needs=(_ldr_reference,)))
