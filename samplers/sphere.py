"""The latitude-longitude convention, and nothing else: pixel ↔ direction, solid angle, distance.

Frame: right-handed, +Y up. Row 0 of a map is +Y. With φ = 2π·u and θ = π·v a direction is
d = (sin φ sin θ, cos θ, −cos φ sin θ), which points towards the light. Pixel (row, column) has its
centre at v = (row + ½)/H, u = (column + ½)/W, and a map is constant over each pixel.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

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
    x, y, z = np.broadcast_arrays(
        np.sin(phi) * sin_theta, np.cos(theta), -np.cos(phi) * sin_theta
    )
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
    """Angle in radians between directions (..., 3); exact for small angles, unlike an arc cosine."""
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


def cap_solid_angle(half_angle: ArrayLike) -> NDArray[np.float64]:
    """Solid angle in sr of a spherical cap: 2π(1 − cos α), written as 4π sin²(α/2)."""
    return 4.0 * math.pi * np.sin(0.5 * np.asarray(half_angle, np.float64)) ** 2


@njit(nogil=True, cache=True)
def pixel_of(x, y, z, height):
    """Compiled twin of `pixel_of_direction` for one direction: (row, column)."""
    width = 2 * height
    u = math.atan2(x, -z) / TWO_PI
    if u < 0.0:
        u += 1.0
    v = math.atan2(math.sqrt(x * x + z * z), y) / math.pi
    return min(int(v * height), height - 1), min(int(u * width), width - 1)
