"""Building a kd-tree over an environment map: blocks inside which the map varies little.

The block in which luminance varies most is split, at the row or column that leaves least variation
in its two parts, until there are enough blocks. A map is then about as good as its block means.

Source: Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of environment maps",
Spring Conference on Computer Graphics 2012, section 3.1: algorithms 1–3 and equations 1–3.

Every pixel counts by its solid angle: SSE = ∫ (L − mean)² dω, and a split maximises
S₁²/Ω₁ + S₂²/Ω₂ with S the flux and Ω the solid angle of a part. The paper counts pixels alike and
so spends blocks at the poles; `weighting="pixels"` does that. Cost: two summed-area tables, then
O(width + height) per split; a heap finds the next block.

Where nothing varies, the block of largest solid angle is halved across its longer side. Sums of
squares of a map with a sun lose the dim blocks to rounding, so the variation of a block is summed
afresh from its pixels where it is small or drowns in the rounding of its table.
"""

import heapq
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.map_kernels import ROWS, box_sum, summed_flux, summed_squares
from samplers.threads import for_blocks

Selection = Literal["sse", "variance", "range"]
Weighting = Literal["solid-angle", "pixels"]
SELECTIONS: tuple[Selection, ...] = ("sse", "variance", "range")

SMALL_BLOCK = 2048
"""Pixels up to which the variation of a block is summed afresh: as quick as a split's scan."""
TABLE_ROUNDING = 2.0**-30
"""Share of the table below which differences of its entries are not trusted: ε × 4 MPixel."""
NO_VARIATION = 2.0**-48
"""Share of Σ L² below which SSE is the rounding of float32 luminance, not variation."""


@kernel
def _fresh_sse(luminance, weight, top, left, bottom, right):
    """Σ w (L − mean)² from the pixels, 0 where it is only rounding."""
    flux = measure = 0.0
    for r in range(top, bottom):
        line = 0.0
        for c in range(left, right):
            line += luminance[r, c]
        flux += line * weight[r]
        measure += weight[r] * (right - left)
    mean = flux / measure
    sse = 0.0
    for r in range(top, bottom):
        line = 0.0
        for c in range(left, right):
            difference = luminance[r, c] - mean
            line += difference * difference
        sse += line * weight[r]
    return sse if sse > NO_VARIATION * mean * mean * measure else 0.0


@kernel
def _range(luminance, top, left, bottom, right):
    lowest = highest = luminance[top, left]
    for r in range(top, bottom):
        for c in range(left, right):
            lowest, highest = min(lowest, luminance[r, c]), max(highest, luminance[r, c])
    return np.float64(highest) - np.float64(lowest)


@kernel
def _variation(selection, luminance, weight, edge, flux, square, top, left, bottom, right):
    """The criterion of a block: SSE (0), variance (1) or range (2); 0 where nothing varies."""
    if selection == 2:
        return _range(luminance, top, left, bottom, right)
    measure = (edge[bottom] - edge[top]) * (right - left)
    total = box_sum(flux, top, left, bottom, right)
    sse = box_sum(square, top, left, bottom, right) - total * total / measure
    small = (bottom - top) * (right - left) <= SMALL_BLOCK
    if small or not sse > TABLE_ROUNDING * square[bottom, right]:
        sse = _fresh_sse(luminance, weight, top, left, bottom, right)
    return sse if selection == 0 else sse / measure


@kernel
def _best_split(edge, flux, top, left, bottom, right):
    """The split that explains most of the variation, as (gain, across rows or not, position).

    S₁²/Ω₁ + S₂²/Ω₂ − S²/Ω = Ω₁Ω₂/Ω (S₁/Ω₁ − S₂/Ω₂)², whose right side loses no digits.
    """
    total = box_sum(flux, top, left, bottom, right)
    rows = edge[bottom] - edge[top]
    best, across_rows, position = 0.0, False, left
    for k in range(left + 1, right):
        part = box_sum(flux, top, left, bottom, k)
        first, second = rows * (k - left), rows * (right - k)
        difference = part / first - (total - part) / second
        gain = first * second * difference * difference
        if gain > best:
            best, position = gain, k
    for k in range(top + 1, bottom):
        part = box_sum(flux, top, left, k, right)
        first = (edge[k] - edge[top]) * (right - left)
        second = (edge[bottom] - edge[k]) * (right - left)
        difference = part / first - (total - part) / second
        gain = first * second * difference * difference
        if gain > best:
            best, across_rows, position = gain, True, k
    return best / (total * total) if total > 0.0 else 0.0, across_rows, position


@kernel
def _halve(edge, top, left, bottom, right):
    """Across the longer side, at half of the solid angle: (across rows or not, position)."""
    scale = math.sin(math.pi * 0.5 * (top + bottom) / (len(edge) - 1))
    across_rows = (right - left) * scale <= bottom - top
    if (bottom - top if across_rows else right - left) == 1:
        across_rows = not across_rows
    if not across_rows:
        return False, (left + right) // 2
    half = 0.5 * (edge[top] + edge[bottom])
    row = top + 1
    while row + 1 < bottom and abs(edge[row + 1] - half) <= abs(edge[row] - half):
        row += 1
    return True, row


@kernel
def _side(low, high, position, part):
    return (low, position) if part == 0 else (position, high)


@kernel
def _put(bounds, node, top, left, bottom, right):
    bounds[node, 0], bounds[node, 1], bounds[node, 2], bounds[node, 3] = top, left, bottom, right


@kernel
def _grow(count, selection, luminance, weight, edge, flux, square, bounds, axis, cut, child):
    """Fill the node arrays; returns the number of nodes. Children of a node are neighbours."""
    height, width = luminance.shape
    _put(bounds, 0, 0, 0, height, width)
    child[0] = -1
    nodes = 1
    key = _variation(selection, luminance, weight, edge, flux, square, 0, 0, height, width)
    heap = [(-key, -edge[height] * width, 0)]
    while len(heap) > 0 and nodes < 2 * count - 1:
        key, _, node = heapq.heappop(heap)
        top, left, bottom, right = bounds[node]
        if bottom - top == 1 and right - left == 1:
            continue
        gain, across_rows, position = 0.0, False, left
        if key < 0.0:
            gain, across_rows, position = _best_split(edge, flux, top, left, bottom, right)
        if not gain > NO_VARIATION:
            across_rows, position = _halve(edge, top, left, bottom, right)
        axis[node], cut[node], child[node] = across_rows, position, nodes
        for part in range(2):
            t, b = _side(top, bottom, position, part) if across_rows else (top, bottom)
            a, z = (left, right) if across_rows else _side(left, right, position, part)
            _put(bounds, nodes, t, a, b, z)
            child[nodes] = -1
            variation = _variation(selection, luminance, weight, edge, flux, square, t, a, b, z)
            heapq.heappush(heap, (-variation, -(edge[b] - edge[t]) * (z - a), nodes))
            nodes += 1
    return nodes


@kernel
def _block_sums(luminance, weight, block, start, stop, out):
    for i in range(start, stop):
        top, left, bottom, right = block[i]
        total = 0.0
        for r in range(top, bottom):
            line = 0.0
            for c in range(left, right):
                line += luminance[r, c]
            total += line * weight[r]
        out[i] = total


@kernel
def _paint(block, value, out):
    for i in range(len(block)):
        top, left, bottom, right = block[i]
        out[top:bottom, left:right] = value[i]


@dataclass(frozen=True, eq=False)
class KdTree:
    """Blocks of a map and the splits that made them.

    bounds : (m, 4) int32, (top, left, bottom, right) of each node, the last two exclusive
    axis, cut : (m,) whether a node is split across rows, and at which row or column
    child : (m,) int32, the first of two neighbouring children, −1 at a leaf
    leaf : (n,) int64, the nodes that are blocks
    total : (n,) float64, Σ luminance × weight over each block, summed from its pixels
    """

    bounds: NDArray[np.int32]
    axis: NDArray[np.bool_]
    cut: NDArray[np.int32]
    child: NDArray[np.int32]
    leaf: NDArray[np.int64]
    total: NDArray[np.float64]

    @property
    def block(self) -> NDArray[np.int32]:
        """Bounds (n, 4) of the blocks."""
        return self.bounds[self.leaf]

    def painted(self, value: NDArray) -> NDArray:
        """A map (H, W) with `value` (n,) of each block in all of its pixels."""
        height, width = self.bounds[0, 2:].tolist()
        out = np.empty((height, width), value.dtype)
        _paint(self.block, value, out)
        return out

    @property
    def node_total(self) -> NDArray[np.float64]:
        """Sum (m,) of `total` over the leaves below each node."""
        total = np.zeros(len(self.child))
        total[self.leaf] = self.total
        for node in np.flatnonzero(self.child >= 0)[::-1]:  # children stand after their parents
            first = self.child[node]
            total[node] = total[first] + total[first + 1]
        return total


def build_kd_tree(
    environment: EnvironmentMap, blocks: int, selection: Selection, weighting: Weighting
) -> KdTree:
    """The tree with at most `blocks` blocks, fewer where the map has fewer pixels."""
    luminance = environment.luminance
    if weighting == "solid-angle":
        weight = environment.row_solid_angle
        flux, square = environment.flux_table, environment.square_table
    else:
        weight = np.ones(environment.height)
        flux = summed_flux(environment.radiance, weight)
        square = summed_squares(environment.radiance, weight)
    most = 2 * min(blocks, luminance.size) - 1
    bounds, axis = np.zeros((most, 4), np.int32), np.zeros(most, np.bool_)
    cut, child = np.zeros(most, np.int32), np.zeros(most, np.int32)
    edge = np.concatenate([[0.0], np.cumsum(weight)])
    nodes = _grow(
        min(blocks, luminance.size), SELECTIONS.index(selection), luminance, weight, edge,
        flux, square, bounds, axis, cut, child,
    )  # fmt: skip
    leaf = np.flatnonzero(child[:nodes] < 0)
    block, total = bounds[leaf], np.empty(len(leaf))
    for_blocks(lambda a, b: _block_sums(luminance, weight, block, a, b, total), len(leaf), ROWS)
    return KdTree(bounds[:nodes], axis[:nodes], cut[:nodes], child[:nodes], leaf, total)
