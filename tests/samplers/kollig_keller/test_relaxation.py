"""Relaxation with bounds against the plain method."""

import numpy as np
import pytest

from samplers.kollig_keller.relaxation import Relaxation
from samplers.sphere import normalized


def points(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    direction = normalized(rng.normal(size=(count, 3)), [0.0, 1.0, 0.0])
    return direction, rng.random(count) ** 4 + 1e-6


def nearest(direction: np.ndarray, centre: np.ndarray) -> np.ndarray:
    return ((direction[:, None] - centre) ** 2).sum(axis=2).argmin(axis=1)


def plain_step(direction, weight, centre):
    """Centroids of the nearest points, then the nearest centres again."""
    label = nearest(direction, centre)
    moment = np.stack([np.bincount(label, weight * x, len(centre)) for x in direction.T], axis=1)
    length = np.linalg.norm(moment, axis=1, keepdims=True)
    return np.where(length > 0.0, moment / np.where(length > 0.0, length, 1.0), centre)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_steps_are_those_of_the_plain_method(seed):
    direction, weight = points(800, seed)
    cells, centre = Relaxation(direction, weight, 40), np.empty((0, 3))
    for k in range(40):
        cells.add(direction[k])
        centre = np.concatenate([centre, direction[[k]]])
        np.testing.assert_array_equal(cells.label, nearest(direction, centre))
        for _ in range(3):
            cells.relax(0.0, 1)
            centre = plain_step(direction, weight, centre)
            # Sums of 800 terms in another order.
            np.testing.assert_allclose(cells.centre, centre, atol=1e-13)
            np.testing.assert_array_equal(cells.label, nearest(direction, centre))
            centre = cells.centre.copy()


def test_a_tolerance_ends_early():
    direction, weight = points(800)
    ends = []
    for tolerance in (0.0, 0.2):
        cells = Relaxation(direction, weight, 8)
        for k in range(8):
            cells.add(direction[k])
        cells.relax(tolerance, 200)
        once = cells.centre.copy()
        cells.relax(0.0, 1)
        ends.append(np.abs(cells.centre - once).max())
    assert ends[0] < 1e-14 < ends[1]
