"""The latitude-longitude convention, and nothing else: pixel ↔ direction, solid angle, distance.

Frame: right-handed, +Y up. Row 0 of a map is +Y. With φ = 2π·u and θ = π·v a direction is
d = (sin φ sin θ, cos θ, −cos φ sin θ), which points towards the light. Pixel (row, column) has its
centre at v = (row + ½)/H, u = (column + ½)/W, and a map is constant over each pixel.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.compiled import inner, kernel

TWO_PI = 2.0 * math.pi


def row_solid_angle(height: int, width: int) -> NDArray[np.float64]:
    """Solid angle of one pixel in each row, in sr: (2π/W)(cos θ_top − cos θ_bottom), shape (H,).

    The difference of cosines is written as a product of sines, which loses no digits at the poles.
    """
    middle = (np.arange(height) + 0.5) * (math.pi / height)
    return (TWO_PI / width) * 2.0 * np.sin(middle) * math.sin(0.5 * math.pi / height)


def direction_from_uv(u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
    """Unit directions (..., 3) of the map coordinates u, v in [0, 1]."""
    phi = np.asarray(u, np.float64) * TWO_PI
    theta = np.asarray(v, np.float64) * math.pi
    sin_theta = np.sin(theta)
    x, y, z = np.broadcast_arrays(np.sin(phi) * sin_theta, np.cos(theta), -np.cos(phi) * sin_theta)
    return np.stack([x, y, z], axis=-1)


def uv_from_direction(direction: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Map coordinates u in [0, 1), v in [0, 1] of directions (..., 3) of any positive length."""
    d = np.asarray(direction, np.float64)
    u = np.arctan2(d[..., 0], -d[..., 2]) / TWO_PI
    u = np.where(u < 0.0, u + 1.0, u)
    v = np.arctan2(np.hypot(d[..., 0], d[..., 2]), d[..., 1]) / math.pi
    return np.where(u >= 1.0, 0.0, u), v


def pixel_direction(row: ArrayLike, column: ArrayLike, height: int) -> NDArray[np.float64]:
    """Unit directions (..., 3) of the centres of pixels of a map of H × 2H pixels."""
    return direction_from_uv(
        (np.asarray(column) + 0.5) / (2 * height), (np.asarray(row) + 0.5) / height
    )


def pixel_directions(height: int) -> NDArray[np.float64]:
    """Unit directions (H, 2H, 3) of all pixel centres."""
    return pixel_direction(np.arange(height)[:, None], np.arange(2 * height)[None, :], height)


def pixel_of_direction(
    direction: ArrayLike, height: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the pixels that hold the directions (..., 3)."""
    u, v = uv_from_direction(direction)
    width = 2 * height
    row = np.minimum((v * height).astype(np.int64), height - 1)
    column = np.minimum((u * width).astype(np.int64), width - 1)
    return row, column


def angular_distance(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Angle in radians between directions (..., 3), exact for small angles too."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.arctan2(cross, np.sum(a * b, axis=-1))


def normalized(vector: ArrayLike, fallback: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors along `vector` (..., 3); `fallback` where the length is zero.

    Scaled by the largest component first, so that neither overflow nor underflow can occur.
    """
    v = np.asarray(vector, np.float64)
    largest = np.abs(v).max(axis=-1, keepdims=True)
    safe = v / np.where(largest > 0.0, largest, 1.0)
    length = np.linalg.norm(safe, axis=-1, keepdims=True)
    return np.where(length > 0.0, safe / np.where(length > 0.0, length, 1.0), fallback)


CANCELLED = 1e-9
"""A mean of directions shorter than this, relative to their weight, has no direction."""
DISC_MEAN = 2.0 / (3.0 * math.sqrt(math.pi))
"""Mean distance from the middle of a disc of unit area."""
DISC_RIM = 1.0 / math.sqrt(math.pi)
"""Its radius."""


def centroid(moment: ArrayLike, weight: ArrayLike, fallback: ArrayLike) -> NDArray[np.float64]:
    """Unit directions (n, 3) of the moments Σ w ω (n, 3) of members that weigh Σ w (n,) in all.

    fallback : (n, 3) or (3,), where the members cancel each other
    """
    moment, weight = np.asarray(moment, np.float64), np.asarray(weight, np.float64)
    clear = np.abs(moment).max(axis=-1, keepdims=True) > CANCELLED * weight[..., None]
    return np.where(clear, normalized(moment, fallback), fallback)


def cap_solid_angle(half_angle: ArrayLike) -> NDArray[np.float64]:
    """Solid angle in sr of a spherical cap: 2π(1 − cos α), written as 4π sin²(α/2)."""
    return 4.0 * math.pi * np.sin(0.5 * np.asarray(half_angle, np.float64)) ** 2


_ATAN_REACH = math.tan(math.pi / 8.0)
_LEAST = 1e-300


def _odd_polynomial(function: Callable, reach: float, terms: int) -> tuple[float, ...]:
    """Coefficients of x, x³, x⁵ … that follow an odd function on [−reach, reach] (Chebyshev)."""
    from numpy.polynomial import Chebyshev, Polynomial

    def ratio(square: NDArray[np.float64]) -> NDArray[np.float64]:
        x = np.sqrt(np.maximum(square, 1e-12))
        return function(x) / x

    fit = Chebyshev.interpolate(ratio, terms - 1, domain=[0.0, reach * reach])
    return tuple(float(c) for c in fit.convert(kind=Polynomial).coef)


_A = _odd_polynomial(np.arctan, _ATAN_REACH, 8)
"""atan to 2·10⁻¹¹ on [0, tan π/8]."""


@inner
def turns(y, x):
    """atan2(y, x) / 2π in [0, 1), to about 10⁻¹¹; several times as fast as atan2.

    Written without jumps, so that loops over it become vector instructions.
    """
    ax, ay = abs(x), abs(y)
    large, small = max(ax, ay), min(ax, ay)
    # tan(α − π/8 …): the upper half of [0, π/4] is brought below tan π/8 by a rotation of π/4.
    steep = small > _ATAN_REACH * large
    numerator = small - large if steep else small
    denominator = small + large if steep else large
    offset = 0.125 if steep else 0.0
    t = numerator / max(denominator, _LEAST)
    s = t * t
    p = _A[7]
    p = p * s + _A[6]
    p = p * s + _A[5]
    p = p * s + _A[4]
    p = p * s + _A[3]
    p = p * s + _A[2]
    p = p * s + _A[1]
    p = p * s + _A[0]
    result = offset + p * t / TWO_PI
    result = 0.25 - result if ay > ax else result
    result = 0.5 - result if x < 0.0 else result
    result = 1.0 - result if y < 0.0 else result
    return result if result < 1.0 else 0.0


@inner
def sine_cosine(turn):
    """sin and cos of 2π · turn for turn in [0, 1], to about 10⁻¹²."""
    quarter = math.floor(4.0 * turn + 0.5)
    r = (4.0 * turn - quarter) * (0.25 * TWO_PI)
    s = r * r
    sine = r * (
        1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0
        + s * (1.0 / 362880.0 + s * (-1.0 / 39916800.0)))))
    )  # fmt: skip
    cosine = 1.0 + s * (
        -0.5 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40320.0
        + s * (-1.0 / 3628800.0 + s * (1.0 / 479001600.0)))))
    )  # fmt: skip
    index = int(quarter)
    first = cosine if index & 1 else sine
    second = sine if index & 1 else cosine
    return -first if index & 2 else first, -second if (index + 1) & 2 else second


@kernel
def pixel_of(x, y, z, height):
    """Compiled twin of `pixel_of_direction` for one direction: (row, column)."""
    width = 2 * height
    v = 2.0 * turns(math.sqrt(x * x + z * z), y)
    return min(int(v * height), height - 1), min(int(turns(x, -z) * width), width - 1)


RUN = 16
"""Directions that are placed on a map side by side."""


@kernel
def _map_positions(way, rows, columns, place):
    """Row and column, not yet rounded down, (32,), of sixteen directions way (48,) x, y, z."""
    for k in range(RUN):
        x, y, z = way[k], way[RUN + k], way[2 * RUN + k]
        place[k] = 2.0 * turns(math.sqrt(x * x + z * z), y) * rows
        place[RUN + k] = turns(x, -z) * columns


@kernel
def map_positions(direction, first, used, height, way, place):
    """Rows, then columns, as real numbers, place (32,), of `used` ≤ 16 directions from `first` on.

    direction : (n, 3), those of pixel (0, 0) lie in [0, 1); way : (48,) scratch
    """
    for k in range(used):
        way[k] = direction[first + k, 0]
        way[RUN + k] = direction[first + k, 1]
        way[2 * RUN + k] = direction[first + k, 2]
    _map_positions(way, np.float64(height), np.float64(2 * height), place)


@kernel
def pixels_of(direction, height, row, column):
    """`pixel_of` directions (n, 3), sixteen at a time, into row and column (n,) int32."""
    way, place, count = np.zeros(3 * RUN), np.empty(2 * RUN), len(direction)
    last_row, last_column = np.int32(height - 1), np.int32(2 * height - 1)
    for first in range(0, count, RUN):
        used = min(RUN, count - first)
        map_positions(direction, first, used, height, way, place)
        for k in range(used):
            row[first + k] = min(np.int32(place[k]), last_row)
            column[first + k] = min(np.int32(place[RUN + k]), last_column)
