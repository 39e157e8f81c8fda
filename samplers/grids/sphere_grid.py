"""Which cells of a latitude-longitude grid touch: across the seam, and over the poles too.

Cells are numbered row by row. All cells of the first and of the last row meet in a pole; of these
only opposite ones are called neighbours, which is enough to join a cap around a pole.
"""

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel

NEIGHBOURS = 4
RIGHT, LEFT, ABOVE, BELOW = range(NEIGHBOURS)


@kernel
def neighbour(cell, which, height):
    """The cell to the right, to the left, above or below (0, 1, 2, 3) of a cell of h × 2h."""
    width = 2 * height
    row, column = cell // width, cell % width
    if which == RIGHT:
        return row * width + (column + 1) % width
    if which == LEFT:
        return row * width + (column + width - 1) % width
    beside = row - 1 if which == ABOVE else row + 1
    if beside < 0 or beside == height:
        return row * width + (column + height) % width
    return beside * width + column


@kernel
def _root(parent, cell):
    while parent[cell] != cell:
        parent[cell] = parent[parent[cell]]
        cell = parent[cell]
    return cell


@kernel
def linked(feature, reach, height):
    """Labels (n,) of the sets of cells joined by steps to neighbours no longer than `reach`.

    feature : (n, d), in which steps are measured. Labels count from 0 in the order of the cells.
    """
    parent = np.arange(len(feature))
    for cell in range(len(feature)):
        for which in range(NEIGHBOURS):
            other = neighbour(cell, which, height)
            distance = 0.0
            for i in range(feature.shape[1]):
                distance += (feature[cell, i] - feature[other, i]) ** 2
            if distance <= reach * reach:
                a, b = _root(parent, cell), _root(parent, other)
                parent[max(a, b)] = min(a, b)
    label, found = np.empty(len(feature), np.int64), 0
    for cell in range(len(feature)):  # the root of a set is its first cell
        if parent[cell] == cell:
            label[cell] = found
            found += 1
        else:
            label[cell] = label[_root(parent, cell)]
    return label


@kernel
def components(inside, height):
    """Labels (n,) int32 of the connected sets of the cells that are inside, −1 for all others.

    inside : (n,) bool. Labels count from 0 in the order of the cells.
    """
    label = np.empty(len(inside), np.int32)  # first the parent of each cell
    for cell in range(len(inside)):
        label[cell] = cell
        if inside[cell]:
            for which in range(NEIGHBOURS):
                other = neighbour(cell, which, height)
                if other < cell and inside[other]:
                    a, b = _root(label, cell), _root(label, other)
                    label[max(a, b)] = min(a, b)
    found = 0
    for cell in range(len(inside)):  # the root of a set is its first cell, a parent comes before
        if not inside[cell]:
            label[cell] = -1
        elif label[cell] == cell:
            label[cell] = found
            found += 1
        else:
            label[cell] = label[label[cell]]
    return label


@kernel
def by_label(label, count):
    """The cells with labels from 0 to count − 1, those of one after those of another.

    Returns their numbers (n,) int32, ascending under each label, and where each label's begin
    (count + 1,). Cells of other labels are left out.
    """
    start = np.zeros(count + 1, np.int64)
    for cell in range(len(label)):
        if label[cell] >= 0:
            start[label[cell] + 1] += 1
    for k in range(count):
        start[k + 1] += start[k]
    order, end = np.empty(start[-1], np.int32), start[:-1].copy()
    for cell in range(len(label)):
        if label[cell] >= 0:
            order[end[label[cell]]] = cell
            end[label[cell]] += 1
    return order, start


@kernel
def pieces(cells, side, height, place):
    """Connected pieces (n,) of a list of cells, each piece of one side; and their number.

    place : (h · 2h,) scratch, −1 throughout before and after
    """
    for i in range(len(cells)):
        place[cells[i]] = i
    piece, stack, found = np.full(len(cells), -1), np.empty(len(cells), np.int64), 0
    for seed in range(len(cells)):
        if piece[seed] >= 0:
            continue
        piece[seed] = found
        stack[0], depth = seed, 1
        while depth > 0:
            depth -= 1
            i = stack[depth]
            for which in range(NEIGHBOURS):
                k = place[neighbour(cells[i], which, height)]
                if k >= 0 and piece[k] < 0 and side[k] == side[i]:
                    piece[k] = found
                    stack[depth] = k
                    depth += 1
        found += 1
    for i in range(len(cells)):
        place[cells[i]] = -1
    return piece, found


def touching(label: NDArray[np.int64], height: int) -> NDArray[np.int64]:
    """The pairs (n, 2) of labels that touch, smaller first, each once."""
    grid = label.reshape(height, 2 * height)
    ends = grid[[0, -1]]
    pair = np.concatenate(
        [
            np.stack([grid, np.roll(grid, -1, axis=1)], axis=-1).reshape(-1, 2),
            np.stack([grid[:-1], grid[1:]], axis=-1).reshape(-1, 2),
            np.stack([ends, np.roll(ends, height, axis=1)], axis=-1).reshape(-1, 2),
        ]
    )
    pair = np.sort(pair[pair[:, 0] != pair[:, 1]], axis=1)
    return np.unique(pair, axis=0)
