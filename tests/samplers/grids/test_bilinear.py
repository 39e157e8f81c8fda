"""Bilinear lookup: exact at texel centres, continuous over the seam and the poles."""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.grids.bilinear import bilinear_at
from samplers.sphere import pixel_directions, uv_from_direction


def look_up(image: NDArray, x: float, y: float, z: float, out: NDArray) -> None:
    u, v = uv_from_direction((x, y, z))
    bilinear_at(image, float(v) * image.shape[0], float(u) * image.shape[1], out)


def test_bilinear_lookup_meets_texel_centres_and_closes_the_seam() -> None:
    rng = np.random.default_rng(0)
    image = rng.uniform(0.5, 2.0, (8, 16, 3)).astype(np.float32)
    out = np.empty(3)
    for y, x in ((0, 0), (3, 15), (7, 8), (4, 4)):
        look_up(image, *pixel_directions(8)[y, x], out)
        np.testing.assert_allclose(out, image[y, x], rtol=1e-12)
    left, right = np.empty(3), np.empty(3)
    look_up(image, -1e-9, 0.1, -1.0, left)
    look_up(image, 1e-9, 0.1, -1.0, right)
    np.testing.assert_allclose(left, right, rtol=1e-7)
    for pole in (1.0, -1.0):  # the same from all sides, and beyond a pole half a turn further
        look_up(image, 1e-9, pole, 0.0, left)
        look_up(image, -1e-9, pole, 0.0, right)
        np.testing.assert_allclose(left, right, rtol=1e-7)
    between = 0.5 * (image[3, 0] + image[3, 15])
    height = math.tan(math.radians(90.0 - 3.5 * 180.0 / 8.0))
    look_up(image, 0.0, height, -1.0, out)
    np.testing.assert_allclose(out, between, rtol=1e-6)
