"""The compiled HEALPix grid against the reference implementation."""

import itertools
import math

import numpy as np
import pytest

from samplers.compiled import kernel
from samplers.grids.healpix_grid import (
    cell_count,
    face_cell,
    nested_index,
    next_edge,
    quarter_turns,
)
from tests.samplers.maps import healpix_cells


@kernel
def cells_of(direction, side):
    """NESTED numbers of the cells that hold directions (n, 3), as the samplers find them."""
    out = np.empty(len(direction), np.int64)
    for k in range(len(direction)):
        x, y, z = direction[k]
        face, i, j = face_cell(y, math.sqrt(x * x + z * z), quarter_turns(x, z), side)
        out[k] = nested_index(face, i, j, side)
    return out


@pytest.mark.parametrize("side", [1, 2, 32, 1024, 1 << 16])
def test_cells_agree_with_the_reference(side):
    direction = np.random.default_rng(3).normal(size=(200_000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    direction[:1000, [0, 2]] *= 1e-4  # close to both poles
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    # A direction within rounding of a cell's edge may fall on either side of it: coordinates in a
    # face carry ~4 ulp at `side` cells, so that a share of side × 1e-15 of the directions differs.
    allowed = 1 + int(200_000 * side * 1e-14)
    assert np.count_nonzero(cells_of(direction, side) != healpix_cells(direction, side)) <= allowed


def test_poles_and_seam_have_cells():
    direction = np.array([[0, 1, 0], [0, -1, 0], [0, 0, -1], [-1e-300, 0, -1], [-0.0, 1.0, -0.0]])
    cell = cells_of(direction, 8)
    assert ((cell >= 0) & (cell < cell_count(8))).all()


@pytest.mark.parametrize("side", [1, 3, 16])
def test_a_walk_along_a_parallel_changes_cell_at_the_edges_alone(side):
    for theta in (np.arange(40) + 0.5) * (math.pi / 40):
        y, sin_theta = math.cos(theta), math.sin(theta)
        quarter, edges = 0.0, [0.0]
        while edges[-1] < 4.0:
            quarter = edges[-1] + 1e-9
            edges.append(next_edge(y, sin_theta, quarter, side))
            assert edges[-1] > quarter
        cells = [face_cell(y, sin_theta, a + 1e-9, side) for a in edges[:-1]]
        ends = [face_cell(y, sin_theta, b - 1e-9, side) for b in edges[1:]]
        assert cells == ends
        assert all(a != b for a, b in itertools.pairwise(cells))
