"""Lloyd's k-means for weighted directions, exact, with whole tiles assigned at once.

Points come in tiles, each inside a ball. A centre that is farther from the ball's middle than the
nearest centre by more than the ball's diameter cannot be nearest to any point in it; where only
one centre is left, the tile moves as one and adds its stored moment, without another look until
the centres have moved so far that this can change. The labels are those of the brute-force method;
only tiles at the borders between clusters are looked into.

Source of the method: Lloyd, "Least squares quantization in PCM", IEEE Transactions on Information
Theory 28(2), 1982; on the sphere the new centre is the normalised centroid. Source of the pruning:
Kanungo, Mount, Netanyahu, Piatko, Silverman and Wu, "An efficient k-means clustering algorithm:
analysis and implementation", IEEE PAMI 24(7), 2002, here with one level in place of a tree; the
bound on movement is Hamerly's, "Making k-means even faster", SIAM Data Mining 2010, for tiles.

Points farther than a reach from every centre can be left out of the assignment, which then lowers
Σ w min(d², reach²) instead of Σ w d², and so ends as surely.

Distances are chords, which order directions as angles do and keep their digits at small angles.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel

MOST_ROUNDS = 1000
"""The search ends by itself long before; rounding could let it go round in a circle."""
SLACK = 1e-12
"""Relative room for rounding in the pruning rule: a centre may be kept for nothing, never lost."""
MIXED = -1
"""Label of a tile whose points belong to several clusters."""
OUTSIDE = -2
"""Label of what is farther than the reach from every centre."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """Points sorted by tile.

    order : (n,) index of the sorted points in the original list
    start : (t + 1,) first sorted point of each tile
    middle : (t, 3), radius : (t,) of a ball that holds the tile's points
    moment : (t, 3) sum of weight × direction
    """

    order: NDArray[np.int64]
    start: NDArray[np.int64]
    middle: NDArray[np.float64]
    radius: NDArray[np.float64]
    moment: NDArray[np.float64]


@kernel
def squared_chord(a, b):
    """Square of the straight distance between the ends of two unit vectors."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z


@kernel
def _sorted_by(key, keys):
    """Stable counting sort: the order of the points, and where each key starts."""
    start = np.zeros(keys + 1, np.int64)
    for p in range(len(key)):
        start[key[p] + 1] += 1
    for k in range(keys):
        start[k + 1] += start[k]
    order, place = np.empty(len(key), np.int64), start[:-1].copy()
    for p in range(len(key)):
        order[place[key[p]]] = p
        place[key[p]] += 1
    return order, start


@kernel
def _balls(direction, weight, order, start, middle, radius, moment):
    middle[:], radius[:], moment[:] = 0.0, 0.0, 0.0
    for t in range(len(start) - 1):
        members = order[start[t] : start[t + 1]]
        for p in members:
            for i in range(3):
                middle[t, i] += direction[p, i] / len(members)
                moment[t, i] += weight[p] * direction[p, i]
        for p in members:
            radius[t] = max(radius[t], squared_chord(direction[p], middle[t]))
        radius[t] = math.sqrt(radius[t])


def tiles_of(
    direction: NDArray[np.float64], weight: NDArray[np.float64], key: NDArray[np.int64]
) -> Tiles:
    """Tiles of the points (n, 3) that share a key (n,); keys are small integers from 0."""
    order, start = _sorted_by(key, int(key.max()) + 1)
    start = np.concatenate([start[:-1][np.diff(start) > 0], start[-1:]])
    count = len(start) - 1
    middle, radius, moment = np.empty((count, 3)), np.empty(count), np.empty((count, 3))
    _balls(direction, weight, order, start, middle, radius, moment)
    return Tiles(order, start, middle, radius, moment)


@kernel
def _near_centres(middle, radius, centre, distance, candidate):
    """Fill `candidate` with the centres that can be nearest to a point of a ball.

    Returns their number; where it is 1, how far every centre may move before it can change; and the
    distance from the ball's middle to the nearest centre.
    """
    least = second = np.inf
    for k in range(len(centre)):
        distance[k] = squared_chord(centre[k], middle)
        if distance[k] < least:
            least, second = distance[k], least
        elif distance[k] < second:
            second = distance[k]
    reach = (math.sqrt(least) + 2.0 * radius) * (1.0 + SLACK) + SLACK * radius
    leeway = 0.5 * (math.sqrt(second) - reach)
    reach *= reach
    found = 0
    for k in range(len(centre)):
        if distance[k] <= reach:
            candidate[found] = k
            found += 1
    return found, leeway, math.sqrt(least)


@kernel
def _label_of_ball(found, leeway, nearest, radius, candidate, reach):
    """The label that a ball's points share, or MIXED, and how far centres may move under it."""
    margin = SLACK * (nearest + radius)
    if nearest - radius > reach + margin:
        return OUTSIDE, nearest - radius - margin - reach
    if found == 1 and nearest + radius + margin < reach:
        return candidate[0], min(leeway, reach - nearest - radius - margin)
    return MIXED, 0.0


@kernel
def _nearest(point, centre, candidate, found, reach):
    """The nearest of the candidates, OUTSIDE where even that is beyond the reach."""
    best, least = candidate[0], np.inf
    for c in range(found):
        d = squared_chord(centre[candidate[c]], point)
        if d < least:
            best, least = candidate[c], d
    return best if least <= reach * reach else OUTSIDE


@kernel
def _assign(direction, weight, order, start, middle, radius, tile_moment, centre, reach, moved,
            label, tile_label, settled, moment):  # fmt: skip
    """Give each point the label of its nearest centre; whether any label changed.

    moved : path that no centre has exceeded so far; settled : (t,) the path up to which a tile is
        known to keep its label
    """
    distance, candidate = np.empty(len(centre)), np.empty(len(centre), np.int64)
    moment[:] = 0.0
    changed = False
    for t in range(len(middle)):
        if moved >= settled[t]:
            found, leeway, nearest = _near_centres(
                middle[t], radius[t], centre, distance, candidate
            )
            new, leeway = _label_of_ball(found, leeway, nearest, radius[t], candidate, reach)
            settled[t] = moved + leeway
            if new != MIXED and new != tile_label[t]:
                for p in order[start[t] : start[t + 1]]:
                    changed |= label[p] != new
                    label[p] = new
            tile_label[t] = new
        if tile_label[t] == OUTSIDE:
            continue
        if tile_label[t] != MIXED:
            for i in range(3):
                moment[tile_label[t], i] += tile_moment[t, i]
            continue
        for p in order[start[t] : start[t + 1]]:
            new = _nearest(direction[p], centre, candidate, found, reach)
            changed |= label[p] != new
            label[p] = new
            if new != OUTSIDE:
                for i in range(3):
                    moment[new, i] += weight[p] * direction[p, i]
    return changed


@kernel
def _move(centre, moment):
    """Set the centres to the centroids; the longest step, as a chord."""
    longest = 0.0
    for k in range(len(centre)):
        length = math.sqrt(moment[k, 0] ** 2 + moment[k, 1] ** 2 + moment[k, 2] ** 2)
        if length > 0.0:
            new = moment[k] / length
            longest = max(longest, squared_chord(new, centre[k]))
            for i in range(3):
                centre[k, i] = new[i]
    return math.sqrt(longest)


@kernel
def _lloyd(
    direction, weight, order, start, middle, radius, tile_moment, centre, reach, label, rounds
):
    """Rounds of assignment and movement until no label changes; the number of movements."""
    tile_label = np.full(len(middle), MIXED, np.int64)
    settled = np.full(len(middle), -np.inf)
    moment = np.empty_like(centre)
    moved = 0.0
    for done in range(rounds + 1):
        changed = _assign(direction, weight, order, start, middle, radius, tile_moment, centre,
                          reach, moved, label, tile_label, settled, moment)  # fmt: skip
        if done == rounds or not changed:
            break
        moved += _move(centre, moment) * (1.0 + SLACK)
    return done


def nearest_centre(
    direction: NDArray[np.float64], tiles: Tiles, centre: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Label (n,) of the centre (k, 3) nearest to each point (n, 3), the first of equals."""
    label = np.full(len(direction), MIXED, np.int64)
    _lloyd(direction, np.zeros(len(direction)), tiles.order, tiles.start, tiles.middle,
           tiles.radius, tiles.moment, centre, np.inf, label, 0)  # fmt: skip
    return label


def kmeans(
    direction: NDArray[np.float64],
    weight: NDArray[np.float64],
    tiles: Tiles,
    centre: NDArray[np.float64],
    reach: float = math.inf,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Centres (k, 3) and labels (n,) once no label changes.

    direction : (n, 3) unit; weight : (n,) positive
    centre : (k, 3) unit, where the search starts. An empty cluster keeps its centre.
    reach : chord beyond which a point belongs to no centre and its label is OUTSIDE
    """
    centre, label = centre.copy(), np.full(len(direction), MIXED, np.int64)
    # Weights of the size of 1 keep squares of the moments clear of underflow.
    scale = weight.max()
    _lloyd(direction, weight / scale, tiles.order, tiles.start, tiles.middle, tiles.radius,
           tiles.moment / scale, centre, reach, label, MOST_ROUNDS)  # fmt: skip
    return centre, label
