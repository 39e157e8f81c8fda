"""Coarse grids that keep energy."""

import numpy as np
import pytest

from samplers.environment import EnvironmentMap
from samplers.grids.reduced_map import reduce_map
from samplers.sphere import pixel_directions


@pytest.mark.parametrize(("height", "rows"), [(1, 128), (3, 2), (60, 16), (64, 16), (50, 128)])
def test_cells_are_sums_of_their_pixels(height, rows):
    radiance = np.random.default_rng(height).random((height, 2 * height, 3))
    environment = EnvironmentMap.from_array(radiance)
    grid = reduce_map(environment, rows)
    coarse = min(rows, height)
    row = np.arange(height) * coarse // height
    column = np.arange(2 * height) * coarse // height
    cell = (row[:, None] * 2 * coarse + column).ravel()
    solid_angle = np.repeat(environment.row_solid_angle, 2 * height)
    flux = environment.radiance.reshape(-1, 3).astype(float) * solid_angle[:, None]
    moment = (flux @ [0.2126, 0.7152, 0.0722])[:, None] * pixel_directions(height).reshape(-1, 3)
    size = 2 * coarse * coarse

    def sums(values):
        return np.stack([np.bincount(cell, v, size) for v in values.T], axis=1)

    # Sums of up to 32 numbers in another order.
    assert grid.solid_angle == pytest.approx(np.bincount(cell, solid_angle, size), rel=1e-13)
    assert grid.flux == pytest.approx(sums(flux), rel=1e-13)
    assert np.abs(grid.moment - sums(moment)).max() < 1e-13 * solid_angle.max() * 32


def test_cells_without_energy_are_no_leaves():
    radiance = np.zeros((8, 16, 3))
    radiance[2, 3, 2] = 1e-30
    leaves, lit = reduce_map(EnvironmentMap.from_array(radiance), 128).leaves()
    assert len(leaves) == 1
    assert np.flatnonzero(lit).tolist() == [2 * 16 + 3]
