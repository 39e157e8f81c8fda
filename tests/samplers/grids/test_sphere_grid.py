"""Neighbours, connected pieces and touching labels on a latitude-longitude grid."""

import numpy as np
import pytest

from samplers.grids.sphere_grid import NEIGHBOURS, components, linked, neighbour, pieces, touching


def canonical(label):
    """The same partition with labels in the order of first appearance."""
    first = {}
    return [first.setdefault(value, len(first)) for value in label]


@pytest.mark.parametrize("height", [1, 2, 3, 8])
def test_neighbours_are_mutual(height):
    cells = range(2 * height * height)
    beside = [{neighbour(cell, k, height) for k in range(NEIGHBOURS)} for cell in cells]
    assert all(cell in beside[other] for cell in cells for other in beside[cell])


def test_seam_and_poles_join():
    assert {neighbour(16, k, 4) for k in range(NEIGHBOURS)} == {17, 23, 8, 24}
    assert neighbour(2, 2, 4) == 6  # over the upper pole, half way round
    assert neighbour(24 + 7, 3, 4) == 24 + 3


def flood(height, joined):
    """Sets of cells reachable from one another, by brute force."""
    label = [-1] * (2 * height * height)
    for seed in range(len(label)):
        stack = [seed] if label[seed] < 0 else []
        while stack:
            cell = stack.pop()
            label[cell] = seed
            for k in range(NEIGHBOURS):
                other = neighbour(cell, k, height)
                if label[other] < 0 and joined(cell, other):
                    stack.append(other)
    return canonical(label)


@pytest.mark.parametrize("height", [1, 3, 16])
@pytest.mark.parametrize("reach", [0.0, 0.3, 2.0])
def test_linked_cells_are_those_a_flood_reaches(height, reach):
    feature = np.random.default_rng(height).random((2 * height * height, 2))
    wanted = flood(height, lambda a, b: np.linalg.norm(feature[a] - feature[b]) <= reach)
    assert linked(feature, reach, height).tolist() == wanted


@pytest.mark.parametrize("height", [1, 2, 16])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.8, 1.0])
def test_components_are_what_a_flood_reaches_inside(height, share):
    inside = np.random.default_rng(height).random(2 * height * height) < share
    label = components(inside, height)
    assert (label[~inside] == -1).all()
    wanted = np.array(flood(height, lambda a, b: inside[a] and inside[b]))[inside]
    assert label[inside].tolist() == canonical(wanted.tolist())


def test_pieces_are_connected_parts_of_one_side():
    height = 12
    rng = np.random.default_rng(0)
    region, side = rng.random(288) < 0.7, rng.integers(2, size=288)
    cells = np.flatnonzero(region)
    place = np.full(288, -1)
    piece, found = pieces(cells, side[cells], height, place)
    wanted = flood(height, lambda a, b: region[a] and region[b] and side[a] == side[b])
    assert canonical(piece.tolist()) == canonical([wanted[cell] for cell in cells])
    assert found == piece.max() + 1
    assert (place == -1).all()


def test_touching_labels_are_those_of_neighbours():
    height = 5
    label = np.random.default_rng(1).integers(7, size=50)
    wanted = {
        tuple(sorted((label[cell], label[neighbour(cell, k, height)])))
        for cell in range(50)
        for k in range(NEIGHBOURS)
    }
    assert set(map(tuple, touching(label, height))) == {
        pair for pair in wanted if len(set(pair)) > 1
    }
