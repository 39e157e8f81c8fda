"""Split regions that matter too much, merge those that matter too little, until there are `count`.

A region's importance is Γ = L ΔΩ^¼ of its luminous flux L and solid angle ΔΩ, of which a limit may
count no more than some useful part. Regions far above the average are cut by 2-means on
directions, and so are those that are too wide for their size. Then, as in Huffman's code, the
region of least importance is merged with the neighbour that gives the least important union, unless
it would be too wide, bottom-up.

Source: Feng, Yang, Wan and Yu, "Tone-mapped mean-shift based environment map sampling", IEEE
Transactions on Visualization and Computer Graphics 22(9), 2016, for the scheme; Γ is from Agarwal,
Ramamoorthi, Belongie and Jensen, "Structured importance sampling of environment maps", SIGGRAPH
2003.
"""

import heapq
import math

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


def width(flux: float, moment: NDArray[np.float64], solid_angle: float) -> float:
    """How far a region reaches for its size: 1 for an even cap, more for what is drawn out.

    A light of its flux F at its centroid gives a plane that faces it F, the region |Σ w ω|. What is
    too much, as a share of F, is ΔΩ / 4π for an even cap.
    """
    if not flux > 0.0:
        return 0.0
    return 4.0 * math.pi * (1.0 - math.sqrt(float(moment @ moment)) / flux) / solid_angle


def split_regions(
    label: NDArray[np.int64],
    grid: ReducedMap,
    flux: NDArray[np.float64],
    count: int,
    ratio: float,
    useful: float | None,
    widest: float,
) -> NDArray[np.int64]:
    """Labels (n,) after every region too wide, or of importance above `ratio` averages, is split.

    The average is the sum of importances over `count`. Regions are split further, the most
    important first, until `count` of them have energy or no such region has two cells with energy.
    label : (n,) from 0; flux : (n,) luminous flux of the cells; widest : largest `width`
    """
    label = label.copy()
    place = np.full(len(label), -1)
    order = np.argsort(label, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(label))[:-1])
    heap: list[tuple[float, int]] = []
    wide: list[int] = []
    value: list[float] = []
    lit = 0

    def add(region: int, cells: NDArray[np.int64]) -> None:
        nonlocal lit
        if region == len(members):
            members.append(cells)
        if region == len(value):
            value.append(0.0)
        energy = flux[cells]
        total, solid_angle = float(energy.sum()), float(grid.solid_angle[cells].sum())
        members[region] = cells
        value[region] = importance(total, solid_angle, useful)
        lit += value[region] > 0.0
        if np.count_nonzero(energy) > 1:
            heapq.heappush(heap, (-value[region], region))
            if width(total, energy @ grid.direction[cells], solid_angle) > widest:
                wide.append(region)

    for region, cells in enumerate(members):
        add(region, cells)
    limit = ratio * sum(value) / count
    while wide or (heap and (-heap[0][0] > limit or lit < count)):
        region = wide.pop() if wide else heapq.heappop(heap)[1]
        lit -= 1
        cells = members[region]
        piece, found = pieces(cells, two_means(cells, grid.direction, flux), grid.height, place)
        for k in range(found):
            target = region if k == 0 else len(members)
            label[cells[piece == k]] = target
            add(target, cells[piece == k])
        while heap and -heap[0][0] != value[heap[0][1]]:
            heapq.heappop(heap)  # it was wide, and has been split
    return label


def merge_regions(
    label: NDArray[np.int64],
    grid: ReducedMap,
    flux: NDArray[np.float64],
    count: int,
    useful: float | None,
    widest: float | None,
) -> NDArray[np.int64]:
    """Labels (n,) from 0 of at most `count` regions, merged from the regions of `label`.

    widest : largest `width` of what is merged. Dark surroundings make up for that of a ring; so
        where none is left, or a light would give a plane too much by more than the mean flux of a
        light, all is done again with None: a region joins the neighbour with which the sum of what
        is too much grows least.
    """
    most = math.inf if widest in (None, math.inf) else flux.sum() / count
    energy = np.bincount(label, flux).tolist()
    solid_angle = np.bincount(label, grid.solid_angle).tolist()
    moment = np.stack([np.bincount(label, flux * axis) for axis in grid.direction.T], axis=1)
    beside: list[set[int]] = [set() for _ in energy]
    for a, b in touching(label, grid.height).tolist():
        beside[a].add(b)
        beside[b].add(a)
    value = [importance(*both, useful) for both in zip(energy, solid_angle, strict=True)]
    owner = list(range(len(energy)))
    heap = [(v, region) for region, v in enumerate(value)]
    heapq.heapify(heap)
    regions = len(energy)
    while regions > count and heap:
        least, region = heapq.heappop(heap)
        if owner[region] != region or least != value[region]:
            continue
        unions = []
        for n in beside[region]:
            both, size = energy[region] + energy[n], solid_angle[region] + solid_angle[n]
            together = moment[region] + moment[n]
            if widest is None:
                lost = np.linalg.norm(moment[n]) - np.linalg.norm(together)
                unions.append((float(lost), n))
            elif width(both, together, size) <= widest:
                unions.append((importance(both, size, useful), n))
        if not unions:
            continue
        other = min(unions)[1]
        for n in beside[region]:
            beside[n].discard(region)
            if n != other:
                beside[n].add(other)
                beside[other].add(n)
        owner[region] = other
        energy[other] += energy[region]
        solid_angle[other] += solid_angle[region]
        moment[other] += moment[region]
        value[other] = importance(energy[other], solid_angle[other], useful)
        heapq.heappush(heap, (value[other], other))
        if energy[other] - np.linalg.norm(moment[other]) > most:
            break
        regions -= 1
    if regions > count:
        return merge_regions(label, grid, flux, count, useful, None)
    for region in range(len(owner)):
        while owner[owner[region]] != owner[region]:
            owner[region] = owner[owner[region]]
    return np.unique(np.array(owner)[label], return_inverse=True)[1]
