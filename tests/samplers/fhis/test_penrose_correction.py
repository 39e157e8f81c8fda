"""The correction table: what it does to the points of a constant importance."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from samplers.fhis.penrose import PHI
from samplers.fhis.penrose_correction import INDICES, correction_table, displacement
from samplers.fhis.penrose_relaxation import (
    BORDER,
    inner,
    relaxed_row,
    spacing,
    uniform_points,
    voronoi_cells,
)


def threshold_of(row: int, part: float, level: int) -> float:
    return PHI ** (2.0 * (level + (row + part) / INDICES)) / math.sqrt(5.0)


def quality(correction: np.ndarray, threshold: float) -> tuple[float, float]:
    """Spread of the cells' areas and mean distance to the nearest neighbour, unit density."""
    position, anchor = uniform_points(threshold)
    unit = spacing(threshold)
    moved = position + displacement(anchor, correction)
    area, _ = voronoi_cells(moved)
    used = inner(position, BORDER * unit)
    nearest = cKDTree(moved).query(moved[used], k=2)[0][:, 1]
    return float(np.std(area[used])) / unit**2, float(nearest.mean()) / unit


def mean_quality(correction: np.ndarray) -> np.ndarray:
    """Over all rows, at a level and at places within the rows that the relaxation did not see."""
    return np.mean(
        [
            quality(correction, threshold_of(row, part, 8))
            for row in range(INDICES)
            for part in (0.25, 0.5)
        ],
        axis=0,
    )


def test_corrected_points_are_evenly_spaced():
    spread, nearest = mean_quality(correction_table())
    # For scale: a hexagonal lattice has 0 and 1.075, random points .53 and .5, and the raw tiling
    # .20 and .86.
    assert spread <= 0.11
    assert nearest >= 0.94


def test_correction_halves_the_spread_of_the_raw_tiling():
    raw, _ = mean_quality(np.zeros_like(correction_table()))
    corrected, _ = mean_quality(correction_table())
    assert corrected < 0.5 * raw


@pytest.mark.parametrize("row", [0, 7, 20])
def test_every_structural_index_that_occurs_has_a_correction(row):
    occurring = set()
    for part in (0.01, 0.5, 0.99):
        _, anchor = uniform_points(threshold_of(row, part, 9))
        assert (anchor.row == row).all()
        occurring |= set(anchor.structure.tolist())
    corrected = set(np.flatnonzero(correction_table()[row].any(axis=1)).tolist())
    assert occurring == corrected


def test_table_is_what_the_relaxation_makes():
    # The same additions in the same order; the Voronoi library may differ in the last digits,
    # which twenty steps of a contraction do not amplify past 1e-6. The first row has the fewest
    # points.
    assert np.abs(relaxed_row(0) - correction_table()[0]).max() < 1e-6


def test_voronoi_cells_of_a_lattice_are_unit_squares():
    grid = np.stack(np.meshgrid(np.arange(7.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    grid += np.random.default_rng(0).normal(0.0, 1e-9, grid.shape)
    area, centroid = voronoi_cells(grid)
    middle = ((grid > 0.5) & (grid < [5.5, 3.5])).all(axis=1)
    # Moving the points by 1e-9 moves areas and centroids by a few times as much.
    assert np.abs(area[middle] - 1.0).max() < 1e-7
    assert np.abs(centroid[middle] - grid[middle]).max() < 1e-7
    assert np.isnan(area[~middle]).any()
