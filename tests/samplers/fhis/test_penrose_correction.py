"""The correction table: what it does to the points of a constant importance."""

import math

import numpy as np
import pytest

from samplers.fhis.penrose import PHI
from samplers.fhis.penrose_correction import INDICES, correction_table, displacement
from tests.samplers.fhis.penrose_relaxation import (
    BORDER,
    inner,
    relaxed_row,
    spacing,
    uniform_points,
    voronoi_cells,
)


def threshold_of(row: int, part: float, level: int) -> float:
    return PHI ** (2.0 * (level + (row + part) / INDICES)) / math.sqrt(5.0)


def spread(correction: np.ndarray, threshold: float) -> float:
    """That of the cells' areas, at unit density."""
    position, anchor = uniform_points(threshold)
    unit = spacing(threshold)
    area, _ = voronoi_cells(position + displacement(anchor, correction))
    return float(np.std(area[inner(position, BORDER * unit)])) / unit**2


def test_correction_halves_the_spread_of_the_raw_tiling():
    """At a level that the relaxation did not see, and between its places within a row."""
    places = [threshold_of(row, 0.25, 8) for row in range(0, INDICES, 4)]
    table = correction_table()
    raw, corrected = (
        np.mean([spread(one, place) for place in places]) for one in (0.0 * table, table)
    )
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
