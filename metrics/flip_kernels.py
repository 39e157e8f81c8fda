"""The compiled inside of FLIP: one tile of an image at a time, all in the processor's cache.

What an observer sees of a tile at one exposure is its *view*, five planes: L*, a*, b* after the
contrast sensitivity filters, and the strengths of edges and of points. The error compares two
views pixel by pixel. Tiles have a fixed size and carry a margin as wide as the filters, in which
the image's border is replicated; every pixel of a view depends on its neighbourhood alone, so the
same pixels give the same bits wherever they are computed.

The filters are separable, with a blue-yellow kernel that is the sum of two Gaussians, so a tile
has seven planes after the horizontal pass. Errors are kept as logarithms until all exposures are
seen: the maximum is that of the logarithms, and one exponential ends it.

Every inner loop runs along a row without a branch, so that it is vectorised; NumPy's error model
is part of that, since Python's tests each divisor. No divisor here can be zero.
"""

import math

import numpy as np

from metrics import flip_filters as filters
from metrics.flip_math import cube_root, exp2, f32, log2
from samplers.compiled import kernel

MARGIN = max(filters.SPATIAL_RADIUS, filters.FEATURE_RADIUS)
ROWS, COLUMNS = 64, 128
"""Size of a tile: its planes fill about half of a second-level cache."""
WIDE_ROWS, WIDE_COLUMNS = ROWS + 2 * MARGIN, COLUMNS + 2 * MARGIN
VIEW_PLANES = 5

OPPONENT = filters.OPPONENT_FROM_RGB.astype(np.float32)
RGB = filters.RGB_FROM_OPPONENT.astype(np.float32)
XYZ = filters.XYZ_FROM_RGB.astype(np.float32)
ACHROMATIC, RED_GREEN = filters.ACHROMATIC, filters.RED_GREEN
WIDE, SLIM = filters.BLUE_YELLOW_WIDE, filters.BLUE_YELLOW_SLIM
WIDE_SHARE, SLIM_SHARE = filters.BLUE_YELLOW_SHARE
BLUR, EDGE, POINT = filters.BLUR, filters.EDGE, filters.POINT

ZERO, ONE = f32(0.0), f32(1.0)
LAB_CUBE = f32(filters.LAB_DELTA**3)
LAB_SLOPE, LAB_OFFSET = f32(1.0 / (3.0 * filters.LAB_DELTA**2)), f32(4.0 / 29.0)
EXPONENT = f32(filters.EXPONENT)
KNEE = f32(filters.KNEE * filters.LARGEST_DIFFERENCE)
KNEE_ERROR = f32(filters.KNEE_ERROR)
BELOW_KNEE = f32(filters.KNEE_ERROR / (filters.KNEE * filters.LARGEST_DIFFERENCE))
ABOVE_KNEE = f32((1.0 - filters.KNEE_ERROR) / ((1.0 - filters.KNEE) * filters.LARGEST_DIFFERENCE))
TINY = f32(1e-30)
SQRT_HALF = f32(math.sqrt(0.5))
NO_ERROR = f32(-1e9)
"""Logarithm that stands for an error of 0."""
NEGLIGIBLE = f32(-120.0)

ACES = tuple(f32(k) for k in (0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14))
"""Tone curve y = (k₀x² + k₁x) / (k₂x² + k₃x + k₄) of Narkowicz with the exposure of UE4."""
ACES_WHITE = f32(12.5)
"""From 12.1 on the tone curve is clipped to 1, so larger values cannot be told apart."""
ACES_LARGE = f32(1e4)
"""Values are cut here, long after white, so that their squares stay finite."""


@kernel
def load_tile(image, top, left, out):
    """Copy the tile at (top, left) and its margin into `out`, three planes; negatives become 0."""
    height, width = image.shape[:2]
    for r in range(WIDE_ROWS):
        y = min(max(top + r - MARGIN, 0), height - 1)
        for c in range(WIDE_COLUMNS):
            x = min(max(left + c - MARGIN, 0), width - 1)
            for k in range(3):
                out[k, r, c] = max(image[y, x, k], ZERO)


@kernel
def smallest_difference(a, b):
    """The smallest value at which the tiles differ, infinity where they agree.

    An exposure that brings it to white shows no difference at all.
    """
    smallest = f32(math.inf)
    for k in range(3):
        for r in range(WIDE_ROWS):
            for c in range(WIDE_COLUMNS):
                here = a[k, r, c]
                there = b[k, r, c]
                value = min(here, there) if here != there else f32(math.inf)
                smallest = min(smallest, value)
    return smallest


@kernel
def _expose_row(tile, r, scale, out):
    """Scaled and tone-mapped RGB of a row."""
    for k in range(3):
        source, target = tile[k, r], out[k]
        for c in range(WIDE_COLUMNS):
            x = min(source[c] * scale, ACES_LARGE)
            y = x * (ACES[0] * x + ACES[1]) / (x * (ACES[2] * x + ACES[3]) + ACES[4])
            target[c] = min(y, ONE)


@kernel
def _copy_row(tile, r, out):
    for k in range(3):
        for c in range(WIDE_COLUMNS):
            out[k, c] = tile[k, r, c]


@kernel
def _opponent_row(rgb, out):
    """From RGB to the three opponent channels."""
    red, green, blue = rgb[0], rgb[1], rgb[2]
    for k in range(3):
        wr, wg, wb, target = OPPONENT[k, 0], OPPONENT[k, 1], OPPONENT[k, 2], out[k]
        for c in range(WIDE_COLUMNS):
            target[c] = wr * red[c] + wg * green[c] + wb * blue[c]


@kernel
def _filter_along(row, half, sign, out):
    """Horizontal filter; sign −1 for an odd kernel."""
    middle, weight = row[MARGIN : MARGIN + COLUMNS], half[0]
    for c in range(COLUMNS):
        out[c] = weight * middle[c]
    for k in range(1, len(half)):
        before, after = row[MARGIN - k : MARGIN - k + COLUMNS], row[MARGIN + k :]
        weight = half[k]
        for c in range(COLUMNS):
            out[c] += weight * (after[c] + sign * before[c])


@kernel
def _filter_across(plane, r, half, sign, out):
    """Vertical filter of the tile's row r; sign −1 for an odd kernel."""
    middle, weight = plane[r + MARGIN], half[0]
    for c in range(COLUMNS):
        out[c] = weight * middle[c]
    for k in range(1, len(half)):
        above, below = plane[r + MARGIN - k], plane[r + MARGIN + k]
        weight = half[k]
        for c in range(COLUMNS):
            out[c] += weight * (below[c] + sign * above[c])


@kernel
def _lab(t):
    """The non-linearity of L*a*b*."""
    return cube_root(t) if t > LAB_CUBE else t * LAB_SLOPE + LAB_OFFSET


@kernel
def _colour_row(luminance, red_green, wide, slim, view, r):
    """L*a*b* with Hunt's scaling from the filtered opponent channels."""
    lightness, a, b = view[0, r], view[1, r], view[2, r]
    for c in range(COLUMNS):
        y, rg = luminance[c], red_green[c]
        by = WIDE_SHARE * wide[c] + SLIM_SHARE * slim[c]
        red = min(max(RGB[0, 0] * y + RGB[0, 1] * rg + RGB[0, 2] * by, ZERO), ONE)
        green = min(max(RGB[1, 0] * y + RGB[1, 1] * rg + RGB[1, 2] * by, ZERO), ONE)
        blue = min(max(RGB[2, 0] * y + RGB[2, 1] * rg + RGB[2, 2] * by, ZERO), ONE)
        fx = _lab(XYZ[0, 0] * red + XYZ[0, 1] * green + XYZ[0, 2] * blue)
        fy = _lab(XYZ[1, 0] * red + XYZ[1, 1] * green + XYZ[1, 2] * blue)
        fz = _lab(XYZ[2, 0] * red + XYZ[2, 1] * green + XYZ[2, 2] * blue)
        light = f32(116.0) * fy - f32(16.0)
        lightness[c] = light
        a[c] = f32(5.0) * light * (fx - fy)
        b[c] = f32(2.0) * light * (fy - fz)


@kernel
def _magnitude_row(x, y, out):
    for c in range(COLUMNS):
        out[c] = math.sqrt(x[c] * x[c] + y[c] * y[c])


@kernel
def _horizontal_pass(tile, scale, tone_mapped, planes):
    rgb = np.empty((3, WIDE_COLUMNS), np.float32)
    opponent = np.empty((3, WIDE_COLUMNS), np.float32)
    for r in range(WIDE_ROWS):
        if tone_mapped:
            _expose_row(tile, r, scale, rgb)
        else:
            _copy_row(tile, r, rgb)
        _opponent_row(rgb, opponent)
        _filter_along(opponent[0], ACHROMATIC, ONE, planes[0, r])
        _filter_along(opponent[1], RED_GREEN, ONE, planes[1, r])
        _filter_along(opponent[2], WIDE, ONE, planes[2, r])
        _filter_along(opponent[2], SLIM, ONE, planes[3, r])
        _filter_along(opponent[0], BLUR, ONE, planes[4, r])
        _filter_along(opponent[0], EDGE, -ONE, planes[5, r])
        _filter_along(opponent[0], POINT, ONE, planes[6, r])


@kernel
def view_of_tile(tile, scale, tone_mapped, planes, view):
    """Fill `view` (5, ROWS, COLUMNS) from a loaded tile at one exposure.

    planes : (7, WIDE_ROWS, COLUMNS), scratch
    """
    _horizontal_pass(tile, scale, tone_mapped, planes)
    row = np.empty((4, COLUMNS), np.float32)
    for r in range(ROWS):
        _filter_across(planes[0], r, ACHROMATIC, ONE, row[0])
        _filter_across(planes[1], r, RED_GREEN, ONE, row[1])
        _filter_across(planes[2], r, WIDE, ONE, row[2])
        _filter_across(planes[3], r, SLIM, ONE, row[3])
        _colour_row(row[0], row[1], row[2], row[3], view, r)
        _filter_across(planes[5], r, BLUR, ONE, row[0])
        _filter_across(planes[4], r, EDGE, -ONE, row[1])
        _magnitude_row(row[0], row[1], view[3, r])
        _filter_across(planes[6], r, BLUR, ONE, row[2])
        _filter_across(planes[4], r, POINT, ONE, row[3])
        _magnitude_row(row[2], row[3], view[4, r])


@kernel
def compare_views(reference, test, best):
    """Raise `best` (ROWS, COLUMNS), log₂ of the error, to that between two views."""
    for r in range(ROWS):
        for c in range(COLUMNS):
            da = reference[1, r, c] - test[1, r, c]
            db = reference[2, r, c] - test[2, r, c]
            difference = abs(reference[0, r, c] - test[0, r, c]) + math.sqrt(da * da + db * db)
            edge = abs(reference[3, r, c] - test[3, r, c])
            point = abs(reference[4, r, c] - test[4, r, c])
            feature = math.sqrt(max(edge, point) * SQRT_HALF)
            e = exp2(EXPONENT * log2(max(difference, TINY)))
            colour = BELOW_KNEE * e if e < KNEE else KNEE_ERROR + (e - KNEE) * ABOVE_KNEE
            logarithm = (ONE - feature) * log2(colour)
            best[r, c] = max(best[r, c], logarithm if difference > ZERO else NO_ERROR)


@kernel
def views_of_tile(image, top, left, scales, tone_mapped, views):
    """The views of a tile at the exposures `scales`, into `views` (exposures, 5, ROWS, COLUMNS)."""
    tile = np.empty((3, WIDE_ROWS, WIDE_COLUMNS), np.float32)
    planes = np.empty((7, WIDE_ROWS, COLUMNS), np.float32)
    load_tile(image, top, left, tile)
    for e in range(len(views)):
        view_of_tile(tile, scales[e], tone_mapped, planes, views[e])


@kernel
def compare_tile(reference, test, top, left, scales, tone_mapped, views, out):
    """FLIP's error over the tile at (top, left), into `out` (H, W).

    views : those of the reference at the first exposures; the others are computed here
    """
    truth = np.empty((3, WIDE_ROWS, WIDE_COLUMNS), np.float32)
    tile = np.empty((3, WIDE_ROWS, WIDE_COLUMNS), np.float32)
    planes = np.empty((7, WIDE_ROWS, COLUMNS), np.float32)
    seen = np.empty((2, VIEW_PLANES, ROWS, COLUMNS), np.float32)
    best = np.full((ROWS, COLUMNS), NO_ERROR, np.float32)
    load_tile(reference, top, left, truth)
    load_tile(test, top, left, tile)
    smallest = smallest_difference(truth, tile)
    for e in range(len(scales)):
        if smallest * scales[e] >= ACES_WHITE:
            continue
        view_of_tile(tile, scales[e], tone_mapped, planes, seen[0])
        if e < len(views):
            compare_views(views[e], seen[0], best)
        else:
            view_of_tile(truth, scales[e], tone_mapped, planes, seen[1])
            compare_views(seen[1], seen[0], best)
    for r in range(min(ROWS, len(out) - top)):
        for c in range(min(COLUMNS, out.shape[1] - left)):
            error = min(exp2(best[r, c]), ONE)  # rounding may exceed the largest error
            out[top + r, left + c] = error if best[r, c] > NEGLIGIBLE else ZERO
