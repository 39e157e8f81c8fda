"""Compiled passes over whole maps. Sums are float64, their order does not depend on threads."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import inner, kernel
from samplers.threads import for_blocks

ROWS = 64
"""Rows per block: small enough to share out, large enough to amortise a call."""
COLUMNS = 512
"""Columns per block of a vertical pass."""
SMALLEST = np.finfo(np.float32).smallest_subnormal


@inner
def texel_luminance(red, green, blue):
    """Rec. 709 luminance of float32 radiance; 0 only where the radiance is."""
    value = np.float32(0.2126) * red + np.float32(0.7152) * green + np.float32(0.0722) * blue
    lost = (value == 0.0) & ((red > 0.0) | (green > 0.0) | (blue > 0.0))
    return SMALLEST if lost else value


@kernel
def _luminance_rows(radiance, start, stop, out):
    for r in range(start, stop):
        for c in range(radiance.shape[1]):
            out[r, c] = texel_luminance(radiance[r, c, 0], radiance[r, c, 1], radiance[r, c, 2])


def luminance_of(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rec. 709 luminance (H, W) of radiance (H, W, 3).

    It is 0 only where the radiance is: what rounds to 0 at the low end of float32's range takes the
    smallest value that is left, so that a map with light in it always has texels to choose from.
    """
    out = np.empty(radiance.shape[:2], np.float32)
    for_blocks(lambda a, b: _luminance_rows(radiance, a, b, out), len(out), ROWS)
    return out


@kernel
def _rgb_row_sums(radiance, start, stop, out):
    for r in range(start, stop):
        red = green = blue = 0.0
        for c in range(radiance.shape[1]):
            red += radiance[r, c, 0]
            green += radiance[r, c, 1]
            blue += radiance[r, c, 2]
        out[r, 0], out[r, 1], out[r, 2] = red, green, blue


def total_rgb_flux(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Σ radiance × solid angle, (3,)."""
    sums = np.empty((len(radiance), 3))
    for_blocks(lambda a, b: _rgb_row_sums(radiance, a, b, sums), len(sums), ROWS)
    return solid_angle @ sums


def flux_of(
    luminance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Luminance × solid angle, (H, W)."""
    out = np.empty(luminance.shape)

    def rows(start: int, stop: int) -> None:
        np.multiply(luminance[start:stop], solid_angle[start:stop, None], out=out[start:stop])

    for_blocks(rows, len(out), ROWS)
    return out


@inner
def texel(radiance, r, c):
    """Luminance of a texel: summed-area tables need no table of it, which would lie beside them."""
    return np.float64(texel_luminance(radiance[r, c, 0], radiance[r, c, 1], radiance[r, c, 2]))


@kernel
def _flux_row_prefix(radiance, solid_angle, start, stop, out):
    for r in range(start, stop):
        total = 0.0
        out[r + 1, 0] = 0.0
        for c in range(radiance.shape[1]):
            total += texel(radiance, r, c) * solid_angle[r]
            out[r + 1, c + 1] = total


@kernel
def _square_row_prefix(radiance, solid_angle, start, stop, out):
    for r in range(start, stop):
        total = 0.0
        out[r + 1, 0] = 0.0
        for c in range(radiance.shape[1]):
            value = texel(radiance, r, c)
            total += value * value * solid_angle[r]
            out[r + 1, c + 1] = total


@kernel
def _moment_row_prefix(radiance, solid_angle, sine, cosine, start, stop, out):
    height = radiance.shape[0]
    for r in range(start, stop):
        theta = (r + 0.5) * math.pi / height
        sin_theta, cos_theta = math.sin(theta), math.cos(theta)
        x = y = z = 0.0
        out[r + 1, 0, :] = 0.0
        for c in range(radiance.shape[1]):
            flux = texel(radiance, r, c) * solid_angle[r]
            x += flux * (sine[c] * sin_theta)
            y += flux * cos_theta
            z -= flux * (cosine[c] * sin_theta)
            out[r + 1, c + 1, 0] = x
            out[r + 1, c + 1, 1] = y
            out[r + 1, c + 1, 2] = z


@kernel
def _pixel_moment_row_prefix(radiance, solid_angle, start, stop, out):
    height, width = radiance.shape[:2]
    for r in range(start, stop):
        row = r + 0.5 - 0.5 * height
        total = along = square = 0.0
        out[r + 1, 0, :] = 0.0
        for c in range(width):
            column = c + 0.5 - 0.5 * width
            flux = texel(radiance, r, c) * solid_angle[r]
            total += flux
            along += flux * column
            square += flux * (column * column + row * row)
            out[r + 1, c + 1, 0] = along
            out[r + 1, c + 1, 1] = total * row
            out[r + 1, c + 1, 2] = square


@kernel
def _accumulate_down(table, start, stop):
    for r in range(1, table.shape[0]):
        for c in range(start, stop):
            table[r, c] += table[r - 1, c]


def _summed(
    rows: Callable[..., None], columns: tuple[int, ...], radiance: NDArray[np.float32], *given: Any
) -> NDArray[np.float64]:
    """Summed-area table (H+1, W+1, *columns) of what `rows` sums along each row."""
    height, width = radiance.shape[:2]
    table = np.empty((height + 1, width + 1, *columns))
    table[0] = 0.0
    for_blocks(lambda a, b: rows(radiance, *given, a, b, table), height, ROWS)
    flat = table.reshape(len(table), -1)
    for_blocks(lambda a, b: _accumulate_down(flat, a, b), flat.shape[1], COLUMNS)
    return table


def summed_flux(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Summed-area table (H+1, W+1) of luminance × solid angle; row 0 and column 0 are zero."""
    return _summed(_flux_row_prefix, (), radiance, solid_angle)


def summed_squares(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Summed-area table (H+1, W+1) of luminance² × solid angle; row 0 and column 0 are zero."""
    return _summed(_square_row_prefix, (), radiance, solid_angle)


def summed_moments(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Summed-area table (H+1, W+1, 3) of luminance × solid angle × unit direction."""
    phi = (np.arange(radiance.shape[1]) + 0.5) * (2.0 * math.pi / radiance.shape[1])
    return _summed(_moment_row_prefix, (3,), radiance, solid_angle, np.sin(phi), np.cos(phi))


def summed_pixel_moments(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Summed-area table (H+1, W+1, 3) of luminance × solid angle × (x, y, x² + y²).

    x and y are the column and the row of a pixel's centre, counted from the middle of the map.
    """
    return _summed(_pixel_moment_row_prefix, (3,), radiance, solid_angle)


@kernel
def box_sum(table, top, left, bottom, right):
    """Sum over rows [top, bottom) and columns [left, right) from a summed-area table (H+1, W+1)."""
    return (table[bottom, right] - table[top, right]) - (table[bottom, left] - table[top, left])


BAND = 16
"""Rows per band of `band_sums`: a sixteenth of a full table's memory, at the cost of adding up to
thirty rows of pixels per region."""


@kernel
def _band_prefix(radiance, solid_angle, sine, cosine, start, stop, out):
    height, width = radiance.shape[:2]
    for band in range(start, stop):
        out[band] = 0.0
        for r in range(band * BAND, min((band + 1) * BAND, height)):
            theta = (r + 0.5) * math.pi / height
            horizontal = solid_angle[r] * math.sin(theta)
            upward = solid_angle[r] * math.cos(theta)
            for c in range(width):
                y = texel(radiance, r, c)
                cell = out[band, c + 1]
                cell[0] += solid_angle[r] * radiance[r, c, 0]
                cell[1] += solid_angle[r] * radiance[r, c, 1]
                cell[2] += solid_angle[r] * radiance[r, c, 2]
                cell[3] += horizontal * y * sine[c]
                cell[4] += upward * y
                cell[5] -= horizontal * y * cosine[c]
        for c in range(width):
            for k in range(6):
                out[band, c + 1, k] += out[band, c, k]


def band_sums(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Per band of 16 rows, running sums along the columns, (bands, W+1, 6), column 0 being zero.

    Columns of the last axis: radiance × solid angle (3), luminance × solid angle × direction (3).
    """
    height, width = radiance.shape[:2]
    phi = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
    sine, cosine = np.sin(phi), np.cos(phi)
    out = np.empty((-(-height // BAND), width + 1, 6))
    for_blocks(
        lambda a, b: _band_prefix(radiance, solid_angle, sine, cosine, a, b, out),
        len(out),
        4,
    )
    return out
