"""Where quads lie, against an independent HEALPix and each other."""

import itertools

import healpix
import numpy as np
import pytest

from samplers import EnvironmentMap
from samplers.grids.healpix_grid import nested_index
from samplers.grids.healpix_quads import interval, quad_extent, quad_points
from samplers.grids.quad_map import QuadMap
from samplers.sphere import angular_distance


def quads_of(level):
    side = np.arange(1 << level)
    grid = np.meshgrid([level], np.arange(12), side, side, indexing="ij")
    return np.stack(grid, axis=-1).reshape(-1, 4)


@pytest.mark.parametrize("level", [0, 1, 3])
def test_middles_are_the_centres_of_the_pixels(level):
    quad = quads_of(level)
    side = 1 << level
    number = np.array([nested_index(f, i, j, side) for _, f, i, j in quad])
    x, y, z = healpix.pix2vec(side, number, nest=True)
    # Their pole is +z and their longitude starts at +x; ours are +y and −z.
    ours = quad_points(quad, np.zeros((len(quad), 2)))
    np.testing.assert_allclose(ours, np.stack([y, z, -x], axis=1), atol=1e-14)


@pytest.mark.parametrize("height", [1, 2, 5, 64, 300])
def test_each_parallel_is_covered_once(height):
    source = QuadMap.of(EnvironmentMap.from_array(np.ones((height, 2 * height, 3), np.float32)))
    for line in range(0, len(source.sigma), 17):
        y, sigma = source.level_cosine[line], source.sigma[line]
        ends = []
        for _, face, i, j in quads_of(1):
            low, high = interval(face, i / 2, (i + 1) / 2, j / 2, (j + 1) / 2, y, sigma)
            if low < high:
                ends.append((low, high))
        ends.sort()
        # From wherever the first begins once around; ends are shared to rounding.
        assert ends[-1][1] - ends[0][0] == pytest.approx(4.0, abs=1e-14)
        for before, after in itertools.pairwise(ends):
            assert after[0] == pytest.approx(before[1], abs=1e-14)


def test_the_extent_is_the_mean_angle():
    quad = quads_of(1)
    middle = quad_points(quad, np.zeros((len(quad), 2)))
    extent = quad_extent(quad, middle, "mean")
    rng = np.random.default_rng(1)
    n = 20_000
    for k in range(len(quad)):
        points = quad_points(quad[[k] * n], rng.uniform(-0.5, 0.5, (n, 2)))
        angle = angular_distance(points, middle[k])
        assert extent[k] == pytest.approx(angle.mean(), abs=5.0 * angle.std() / np.sqrt(n) + 1e-4)


def test_the_largest_extent_is_reached_and_not_exceeded():
    quad = quads_of(1)
    middle = quad_points(quad, np.zeros((len(quad), 2)))
    extent = quad_extent(quad, middle, "largest")
    offset = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 129), np.linspace(-0.5, 0.5, 129)), -1)
    offset = offset.reshape(-1, 2)
    for k in range(len(quad)):
        angle = angular_distance(quad_points(quad[[k] * len(offset)], offset), middle[k])
        # Between two of nine points on an edge of 0.7 rad the distance bends by about Δ²/8.
        assert angle.max() - 0.09**2 / 8.0 < extent[k] <= angle.max() + 1e-12
