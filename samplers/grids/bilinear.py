"""Bilinear lookup of a latitude-longitude image, closed over the seam and the poles."""

import math

from samplers.compiled import kernel


@kernel
def _wrapped(column, width):
    """A column from less than a turn outside, brought into the map."""
    if column < 0:
        return column + width
    return column - width if column >= width else column


@kernel
def bilinear_at(image, row, column, out):
    """The image (H, 2H, 3) at a row and a column, which count from the edges of pixel (0, 0).

    Into out (3,).
    """
    height, width = image.shape[0], image.shape[1]
    row, column = row - 0.5, column - 0.5
    left, top = math.floor(column), math.floor(row)
    a, b = column - left, row - top
    # Beyond a pole lies the same row again, half a turn further.
    upper, upper_turn = (0, height) if top < 0 else (top, 0)
    lower, lower_turn = (height - 1, height) if top >= height - 1 else (top + 1, 0)
    first, second = _wrapped(left + upper_turn, width), _wrapped(left + upper_turn + 1, width)
    third, fourth = _wrapped(left + lower_turn, width), _wrapped(left + lower_turn + 1, width)
    for k in range(3):
        above = (1.0 - a) * image[upper, first, k] + a * image[upper, second, k]
        below = (1.0 - a) * image[lower, third, k] + a * image[lower, fourth, k]
        out[k] = (1.0 - b) * above + b * below
