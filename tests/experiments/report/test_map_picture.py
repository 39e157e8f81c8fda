"""Pictures of maps wider than they: nothing bright is lost, and means are kept."""

import numpy as np
import pytest

from experiments.report.map_picture import EMISSIVE_COLOR, WIDTH, _shown, draw_circles, statistics
from samplers import EnvironmentMap


def sky(height):
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (height, 2 * height, 3))
    radiance[height // 3, height // 2] = 1e4
    return EnvironmentMap.from_array(radiance, "sky")


@pytest.mark.parametrize("factor", [2, 3])
def test_a_wide_map_is_shown_by_the_means_of_its_blocks(factor):
    environment = sky(WIDTH // 2 * factor)
    shown, emissive = _shown(environment)
    blocks = environment.radiance.reshape(WIDTH // 2, factor, WIDTH, factor, 3)
    exact = blocks.mean(axis=(1, 3), dtype=np.float64)
    # Sums in float64 by rows and columns, and a rounding to float32 after either.
    np.testing.assert_allclose(shown, exact, rtol=2e-7)
    assert emissive.sum() == 1


@pytest.mark.parametrize("height", [300, 512, 700])
def test_one_bright_texel_of_any_map_is_marked(height):
    picture = draw_circles(sky(height), [])
    assert picture.shape == (WIDTH // 2, WIDTH, 3)
    row, column = np.nonzero((picture == EMISSIVE_COLOR).all(axis=2))
    # Its middle, in pixels of the picture, which has a pixel or more for it.
    scale = WIDTH / (2 * height)
    assert abs(row.mean() + 0.5 - (height // 3 + 0.5) * scale) <= 1.0
    assert abs(column.mean() + 0.5 - (height // 2 + 0.5) * scale) <= 1.0


def test_statistics_end_with_what_the_file_says():
    environment = EnvironmentMap(sky(8).radiance, "sky", facts={"exposure": "divided by 2"})
    assert list(statistics(environment).items())[-1] == ("exposure", "divided by 2")
