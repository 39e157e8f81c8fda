"""Split regions that matter too much, merge those that matter too little, until there are `count`.

A region's importance is Γ = L ΔΩ^¼ of its luminous flux L and solid angle ΔΩ, of which a limit may
count no more than some useful part. Regions far above the average are cut by 2-means on
directions. Then, as in Huffman's code, the region of least importance is merged with the neighbour
that gives the least important union, bottom-up.

Source: Feng, Yang, Wan and Yu, "Tone-mapped mean-shift based environment map sampling", IEEE
Transactions on Visualization and Computer Graphics 22(9), 2016, for the scheme; Γ is from Agarwal,
Ramamoorthi, Belongie and Jensen, "Structured importance sampling of environment maps", SIGGRAPH
2003.
"""

import heapq

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.grids.reduced_map import ReducedMap
from samplers.grids.sphere_grid import pieces, touching

ROUNDS = 50
"""Limit to the rounds of 2-means; it starts at the two ends and settles in a few."""


def importance(flux: float, solid_angle: float, useful: float | None) -> float:
    """Γ of a region; `useful` is the largest solid angle that counts, None for no limit."""
    return flux * (solid_angle if useful is None else min(solid_angle, useful)) ** 0.25


@kernel
def _ends(cells, direction, weight):
    """The two cells with energy that are farthest along the region's principal axis."""
    mean, total = np.zeros(3), 0.0
    for cell in cells:
        for i in range(3):
            mean[i] += weight[cell] * direction[cell, i]
        total += weight[cell]
    for i in range(3):
        mean[i] /= total
    covariance = np.zeros((3, 3))
    for cell in cells:
        for i in range(3):
            for j in range(3):
                step = (direction[cell, i] - mean[i]) * (direction[cell, j] - mean[j])
                covariance[i, j] += weight[cell] / total * step
    axes = np.linalg.eigh(covariance)[1]
    first = last = -1
    low, high = np.inf, -np.inf
    for cell in cells:
        if weight[cell] > 0.0:
            along = 0.0
            for i in range(3):
                along += direction[cell, i] * axes[i, 2]
            if along < low:
                first, low = cell, along
            if along >= high:
                last, high = cell, along
    return first, last


@kernel
def two_means(cells, direction, weight):
    """The side (n,), 0 or 1, of each cell of a region with energy in at least two cells."""
    side, new = np.zeros(len(cells), np.int64), np.empty(len(cells), np.int64)
    first, last = _ends(cells, direction, weight)
    centre, moment, total = np.empty((2, 3)), np.empty((2, 3)), np.empty(2)
    for k in range(3):
        centre[0, k], centre[1, k] = direction[first, k], direction[last, k]
    for _ in range(ROUNDS):
        moment[:], total[:], moved = 0.0, 0.0, False
        for i in range(len(cells)):
            cell, d0, d1 = cells[i], 0.0, 0.0
            for k in range(3):
                d0 += (direction[cell, k] - centre[0, k]) ** 2
                d1 += (direction[cell, k] - centre[1, k]) ** 2
            new[i] = 0 if d0 <= d1 else 1
            moved |= new[i] != side[i]
            total[new[i]] += weight[cell]
            for k in range(3):
                moment[new[i], k] += weight[cell] * direction[cell, k]
        if not (total[0] > 0.0 and total[1] > 0.0) or not moved:
            break
        for i in range(len(cells)):
            side[i] = new[i]
        for k in range(3):
            centre[0, k], centre[1, k] = moment[0, k] / total[0], moment[1, k] / total[1]
    return side


def split_regions(
    label: NDArray[np.int64],
    grid: ReducedMap,
    flux: NDArray[np.float64],
    count: int,
    ratio: float,
    useful: float | None,
) -> NDArray[np.int64]:
    """Labels (n,) after every region of importance above `ratio` times the average is split.

    The average is the sum of importances over `count`. Regions are split further, the most
    important first, until `count` of them have energy or no such region has two cells with energy.
    label : (n,) from 0; flux : (n,) luminous flux of the cells
    """
    label = label.copy()
    place = np.full(len(label), -1)
    order = np.argsort(label, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(label))[:-1])
    heap: list[tuple[float, int]] = []
    lit, total = 0, 0.0

    def add(region: int) -> float:
        nonlocal lit
        energy = flux[members[region]]
        solid_angle = float(grid.solid_angle[members[region]].sum())
        value = importance(float(energy.sum()), solid_angle, useful)
        lit += value > 0.0
        if np.count_nonzero(energy) > 1:
            heapq.heappush(heap, (-value, region))
        return value

    for region in range(len(members)):
        total += add(region)
    while heap and (-heap[0][0] > ratio * total / count or lit < count):
        region = heapq.heappop(heap)[1]
        cells = members[region]
        lit -= 1
        side = two_means(cells, grid.direction, flux)
        piece, found = pieces(cells, side, grid.height, place)
        for k in range(found):
            part = cells[piece == k]
            target = region if k == 0 else len(members)
            if k == 0:
                members[region] = part
            else:
                members.append(part)
            label[part] = target
            add(target)
    return label


def merge_regions(
    label: NDArray[np.int64],
    grid: ReducedMap,
    flux: NDArray[np.float64],
    count: int,
    useful: float | None,
) -> NDArray[np.int64]:
    """Labels (n,) from 0 of at most `count` regions, merged from the regions of `label`."""
    energy = np.bincount(label, flux).tolist()
    solid_angle = np.bincount(label, grid.solid_angle).tolist()
    beside: list[set[int]] = [set() for _ in energy]
    for a, b in touching(label, grid.height).tolist():
        beside[a].add(b)
        beside[b].add(a)
    value = [importance(*both, useful) for both in zip(energy, solid_angle, strict=True)]
    owner = list(range(len(energy)))
    heap = [(v, region) for region, v in enumerate(value)]
    heapq.heapify(heap)
    regions = len(energy)
    while regions > count:
        least, region = heapq.heappop(heap)
        if owner[region] != region or least != value[region]:
            continue
        union, other = min(
            (
                importance(
                    energy[region] + energy[n], solid_angle[region] + solid_angle[n], useful
                ),
                n,
            )
            for n in beside[region]
        )
        for n in beside[region]:
            beside[n].discard(region)
            if n != other:
                beside[n].add(other)
                beside[other].add(n)
        owner[region], value[other] = other, union
        energy[other] += energy[region]
        solid_angle[other] += solid_angle[region]
        heapq.heappush(heap, (union, other))
        regions -= 1
    for region in range(len(owner)):
        while owner[owner[region]] != owner[region]:
            owner[region] = owner[owner[region]]
    return np.unique(np.array(owner)[label], return_inverse=True)[1]
