"""Joint bilateral upsampling: a small image brought to full size along the edges of its guides.

    J(p) = Σ_q w(p, q) S(q) / Σ_q w(p, q)
    w    = exp(−‖p − q‖²/2σ² − ‖G(p) − g(q)‖²/2σ_g²)

A full-size pixel J(p) is the weighted mean of the 5 × 5 low-resolution pixels S(q) around it; a
weight is a Gaussian of the distance in low-resolution pixels times Gaussians of the differences of
the guides: normal, depth and albedo. Source: Kopf et al., "Joint bilateral upsampling", SIGGRAPH
2007; parameters from Wu, "Efficient environment map rendering based on decomposition", 2025, 3.4:
0.005 for each guide, 1.0 in space. With guides that sharp all weights of a pixel can underflow, so
exponents are compared before they are taken. Depth is scaled to [0, 1] over the visible surface.

A pixel on an edge sees several surfaces, and the mean of their guides is that of none. Where a
sub-pixel's guides differ from their pixel's mean by more than their σ, J is therefore found for
each sub-pixel by its own guides, and averaged.

Guides belong to what the eye sees, as the shading points do, and are kept with the view; weights
are found for every image. A window is read once for all pixels that share it, into one array
whose rows are at constant places, so that its pixels are weighed side by side, and the
columns one after another, so that its rows are summed side by side.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from renderer.packet.material_table import DIFFUSE, SPECULAR
from renderer.view import View
from samplers.compiled import kernel
from samplers.threads import for_blocks

GUIDE_SIGMA = 0.005
SPATIAL_SIGMA = 1.0
RADIUS = 2
SIDE = 2 * RADIUS + 1
ROW_BLOCK = 16
GUIDES = 7
WINDOW = 32
"""Places for the window's 25 pixels, which are the first of them."""
LEAST_RANGE = 2.0**-20
"""Of depth, in units of the largest: float32 rounds it to 2⁻²⁴ of that."""
MARGIN = ((RADIUS, RADIUS), (RADIUS, RADIUS))
ROWS = 8
"""Places for sums of the window's five rows, which are the first of them."""
SURFACE, ROW, COLUMN, EXPONENT, POWER, WEIGHT, RED = (WINDOW * (GUIDES + i) for i in range(7))
SUM = RED + 3 * WINDOW
SCRATCH = SUM + 4 * ROWS
"""Rows of places: the window's guides and whether it is surface; the places in the window; the
weights' exponents, their powers of two, and the weights; red, green and blue. Last, of each row,
the sums of weights, red, green and blue."""
LEAST_EXPONENT = -80.0
LOG2_E, LN2 = 1.0 / math.log(2.0), math.log(2.0)
LEAST_POWER = int(LEAST_EXPONENT * LOG2_E)
"""Weights below about e⁻⁸⁰ of the largest are none: a sum does not feel them."""
_C = tuple(1.0 / math.factorial(i) for i in range(10))
"""eʳ to 10⁻¹¹ on |r| ≤ ln 2 / 2."""


def _power_of_two(typing_context, power):
    def generate(context, builder, signature, arguments):
        exponent = builder.add(arguments[0], ir.Constant(ir.IntType(64), 1023))
        bits = builder.shl(exponent, ir.Constant(ir.IntType(64), 52))
        return builder.bitcast(bits, ir.DoubleType())

    return types.float64(types.int64), generate


power_of_two: Callable[..., float] = intrinsic(_power_of_two)
"""power_of_two(k), in kernels: 2ᵏ for −1023 < k < 1024, made from its bits."""


@dataclass(frozen=True, eq=False)
class Guides:
    """Means over each pixel's surface samples.

    feature : (h, w, 7) float32, normal (3), depth, albedo (3)
    coverage : (h, w) float64, share of sub-pixels that see a surface
    """

    feature: NDArray[np.float32]
    coverage: NDArray[np.float64]

    @cached_property
    def planes(self) -> NDArray[np.float32]:
        """The features and, last, the exponent of what is no surface, −∞, or is one, 0.

        (8, h + 4, w + 4), with margins that are no surface.
        """
        covered = self.coverage > 0.0
        nothing = np.pad(np.where(covered, 0.0, -np.inf), MARGIN, constant_values=-np.inf)
        feature = np.where(covered, np.moveaxis(self.feature, 2, 0), 0.0)
        planes = np.concatenate([np.pad(feature, ((0, 0), *MARGIN)), nothing[None]])
        return np.ascontiguousarray(planes, np.float32)


@dataclass(frozen=True, eq=False)
class SplitGuides:
    """The guides of the surfaces that a pixel is found for, one after another.

    feature : (n, 7) float32, normal (3), depth, albedo (3)
    first : (h · w + 1,) int64, those of pixel i are first[i] … first[i + 1]
    coverage : (h, w) float64, share of sub-pixels that see a surface
    """

    feature: NDArray[np.float32]
    first: NDArray[np.int64]
    coverage: NDArray[np.float64]


def unsplit(guides: Guides) -> SplitGuides:
    """One set of guides a pixel: their means."""
    feature = np.ascontiguousarray(guides.feature.reshape(-1, GUIDES))
    return SplitGuides(feature, np.arange(len(feature) + 1), guides.coverage)


def albedo_table(view: View) -> NDArray[np.float64]:
    """Diffuse plus specular colour of each material, (m, 3): the albedo guide."""
    table = view.materials
    return table[:, DIFFUSE : DIFFUSE + 3] + table[:, SPECULAR : SPECULAR + 3]


@kernel
def _add_guides(pixel, normal, depth, near, scale, material, albedo, total, count):
    for i in range(len(pixel)):
        p, m = pixel[i], material[i]
        for k in range(3):
            total[p, k] += normal[i, k]
            total[p, 4 + k] += albedo[m, k]
        total[p, 3] += (depth[i] - near) * scale
        count[p] += 1.0


def guides_of(view: View, depth_range: tuple[float, float]) -> Guides:
    """The guides of a view, found once; depth is scaled by the given range."""

    def find() -> Guides:
        near, far = depth_range
        # A range as small as the rounding of its ends says nothing of the surface.
        scale = 1.0 / (far - near) if far - near > LEAST_RANGE * abs(far) else 0.0
        size = view.width * view.height
        total, count = np.zeros((size, GUIDES)), np.zeros(size)
        _add_guides(
            view.pixel, view.normal, view.depth, near, scale, view.material, albedo_table(view),
            total, count,
        )  # fmt: skip
        feature = (total / np.maximum(count, 1.0)[:, None]).astype(np.float32)
        shape = view.height, view.width
        return Guides(feature.reshape(*shape, GUIDES), (count / view.subpixels).reshape(shape))

    return view.kept(("guides", depth_range), find)


def split_guides_of(
    view: View, depth_range: tuple[float, float], sigma: float = GUIDE_SIGMA
) -> SplitGuides:
    """The guides of a view, those of every sub-pixel where one is further than `sigma` from the
    pixel's mean; found once."""

    means = guides_of(view, depth_range)

    def find() -> SplitGuides:
        mean = means.feature.reshape(-1, GUIDES)
        near, far = depth_range
        scale = 1.0 / (far - near) if far - near > LEAST_RANGE * abs(far) else 0.0
        depth = (view.depth - np.float64(near)) * scale
        own = np.column_stack([view.normal, depth, albedo_table(view)[view.material]])
        own = own.astype(np.float32)
        apart = ((own - mean[view.pixel]) ** 2).sum(axis=1) > sigma**2
        split = np.zeros(len(mean), np.bool_)
        split[view.pixel[apart]] = True
        taken = np.flatnonzero(split[view.pixel])
        count = np.where(split, np.bincount(view.pixel[taken], minlength=len(mean)), 1)
        first = np.concatenate([[0], np.cumsum(count)])
        feature = np.empty((first[-1], GUIDES), np.float32)
        feature[first[:-1][~split]] = mean[~split]
        taken = taken[np.argsort(view.pixel[taken], kind="stable")]
        feature[np.repeat(split, count)] = own[taken]
        return SplitGuides(feature, first, means.coverage)

    return view.kept(("split guides", depth_range, sigma), find)


@kernel
def _read_window(planes, count, size, stride, at, real):
    """The first `count` planes of the 5 × 5 small pixels from `at` on, column by column."""
    for plane in range(count):
        for row in range(SIDE):
            for column in range(SIDE):
                i = np.uint64(at + plane * size + row * stride + column)
                real[plane * WINDOW + column * SIDE + row] = planes[i]


@kernel
def _exponents(feature, guide_scale, spatial_scale, dx, dy, real):
    """Exponents of the window's pixels, the first (dx, dy) away; returns the largest."""
    f0, f1, f2, f3 = feature[0], feature[1], feature[2], feature[3]
    f4, f5, f6 = feature[4], feature[5], feature[6]
    for j in range(WINDOW):
        d0, d1 = real[j] - f0, real[WINDOW + j] - f1
        d2, d3 = real[2 * WINDOW + j] - f2, real[3 * WINDOW + j] - f3
        d4, d5 = real[4 * WINDOW + j] - f4, real[5 * WINDOW + j] - f5
        d6 = real[6 * WINDOW + j] - f6
        square = d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3 + d4 * d4 + d5 * d5 + d6 * d6
        x, y = dx + real[COLUMN + j], dy + real[ROW + j]
        distance = spatial_scale * (x * x + y * y)
        real[EXPONENT + j] = distance + guide_scale * square + real[SURFACE + j]
    # Four at a time: one after another, each would wait for the one before.
    a = b = c = d = -np.inf
    for j in range(0, SIDE * SIDE, 4):
        a, b = max(a, real[EXPONENT + j]), max(b, real[EXPONENT + j + 1])
        c, d = max(c, real[EXPONENT + j + 2]), max(d, real[EXPONENT + j + 3])
    return max(max(a, b), max(c, d))


@kernel
def _weights(largest, real):
    """Exponents to weights, relative to the largest."""
    for j in range(WINDOW):
        t = max(real[EXPONENT + j] - largest, LEAST_EXPONENT)
        whole = math.floor(t * LOG2_E + 0.5)
        real[POWER + j] = power_of_two(whole) if whole > LEAST_POWER else 0.0
        real[EXPONENT + j] = t - whole * LN2
    for j in range(WINDOW):
        r = real[EXPONENT + j]
        p = _C[9]
        p = p * r + _C[8]
        p = p * r + _C[7]
        p = p * r + _C[6]
        p = p * r + _C[5]
        p = p * r + _C[4]
        p = p * r + _C[3]
        p = p * r + _C[2]
        p = p * r + _C[1]
        p = p * r + _C[0]
        real[WEIGHT + j] = p * real[POWER + j]


@kernel
def _weighted_mean(real):
    """Red, green and blue of the window: each row's sums side by side, then those of the rows."""
    for k in range(ROWS):
        w0, w1, w2 = real[WEIGHT + k], real[WEIGHT + SIDE + k], real[WEIGHT + 2 * SIDE + k]
        w3, w4 = real[WEIGHT + 3 * SIDE + k], real[WEIGHT + 4 * SIDE + k]
        real[SUM + k] = w0 + w1 + w2 + w3 + w4
        for c in range(3):
            i = RED + c * WINDOW + k
            sums = w0 * real[i] + w1 * real[i + SIDE] + w2 * real[i + 2 * SIDE]
            sums = sums + w3 * real[i + 3 * SIDE] + w4 * real[i + 4 * SIDE]
            real[SUM + (1 + c) * ROWS + k] = sums
    total = red = green = blue = 0.0
    for k in range(SIDE):
        total += real[SUM + k]
        red += real[SUM + ROWS + k]
        green += real[SUM + 2 * ROWS + k]
        blue += real[SUM + 3 * ROWS + k]
    scale = 1.0 / total
    return red * scale, green * scale, blue * scale


@kernel
def _upsample_rows(
    value_planes, guide_planes, feature, first, coverage, guide_scale, spatial_scale, start, stop,
    out,
):  # fmt: skip
    """J(p) of the module's first lines, times the coverage, for the rows start … stop.

        w = np.exp(spatial_scale * (dx**2 + dy**2) + guide_scale * ((G[p] - g)**2).sum(-1))
        J[p] = coverage[p] * (w[..., None] * S).sum((0, 1)) / w.sum()

    over the 5 × 5 window, where w is 0 beside the surface; the mean of it over the pixel's guides.
    """
    height, width = coverage.shape
    rows, stride = guide_planes.shape[1:]
    small_height, small_width, size = rows - 2 * RADIUS, stride - 2 * RADIUS, rows * stride
    values, planes = value_planes.reshape(-1), guide_planes.reshape(-1)
    real = np.zeros(SCRATCH)
    for j in range(WINDOW):
        real[COLUMN + j], real[ROW + j] = j // SIDE, j % SIDE
        real[SURFACE + j] = -np.inf
    top = start
    while top < stop:
        first_y = round((top + 0.5) * small_height / height - 0.5) - RADIUS
        bottom = top + 1
        while bottom < stop:
            if round((bottom + 0.5) * small_height / height - 0.5) - RADIUS != first_y:
                break
            bottom += 1
        held = -1
        for x in range(width):
            centre_x = (x + 0.5) * small_width / width - 0.5
            first_x = round(centre_x) - RADIUS
            corner = (first_y + RADIUS) * stride + first_x + RADIUS
            for y in range(top, bottom):
                if coverage[y, x] == 0.0:
                    continue
                if corner != held:
                    _read_window(planes, GUIDES + 1, size, stride, corner, real)
                    _read_window(values, 3, size, stride, corner, real[RED:])
                    held = corner
                dx, dy = first_x - centre_x, first_y - ((y + 0.5) * small_height / height - 0.5)
                red = green = blue = 0.0
                begin, end = first[y * width + x], first[y * width + x + 1]
                for f in range(begin, end):
                    largest = _exponents(feature[f], guide_scale, spatial_scale, dx, dy, real)
                    if largest == -np.inf:
                        continue
                    _weights(largest, real)
                    r, g, b = _weighted_mean(real)
                    red, green, blue = red + r, green + g, blue + b
                share = coverage[y, x] / (end - begin)
                out[y, x, 0], out[y, x, 1], out[y, x, 2] = red * share, green * share, blue * share
        top = bottom


def upsample(
    small: NDArray[np.float32],
    small_guides: Guides,
    guides: SplitGuides,
    guide_sigma: float = GUIDE_SIGMA,
    spatial_sigma: float = SPATIAL_SIGMA,
) -> NDArray[np.float32]:
    """The small image (h, w, 3), a mean over surface samples only, at the size of `guides`.

    The result is multiplied by the coverage, so that a background can be added to it. Pixels whose
    5 × 5 neighbours see no surface stay black.
    """
    covered = small_guides.coverage > 0.0
    values = np.where(covered, np.moveaxis(small, 2, 0), np.float32(0.0))
    values = np.ascontiguousarray(np.pad(values, ((0, 0), *MARGIN)))
    out = np.zeros((*guides.coverage.shape, 3), np.float32)
    for_blocks(
        lambda a, b: _upsample_rows(
            values, small_guides.planes, guides.feature, guides.first, guides.coverage,
            -0.5 / guide_sigma**2, -0.5 / spatial_sigma**2, a, b, out,
        ),
        len(out),
        ROW_BLOCK,
    )  # fmt: skip
    return out
