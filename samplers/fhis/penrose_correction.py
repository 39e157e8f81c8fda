"""Where a point of the Penrose tiling comes to lie: its level, its two indices, its displacement.

A point is corrected by a table with two indices. The importance index tells where the threshold
lies between two levels of the tiling; the structural index, the six newest bits of the point's code
read as a small code, tells which of 21 kinds of neighbourhood the point has. The table holds the
displacement in the tile's own frame.

Source: Ostromoukhov, Donohue, Jodoin, "Fast hierarchical importance sampling with blue noise
properties", ACM Transactions on Graphics 23(3), 2004. A tile that was subdivided further for the
sake of a neighbour is looked up at the level that its own threshold asks for.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.fhis.penrose import DIRECTIONS, FIBONACCI, PHI, UNIT, Births

INDICES = 21
"""Structural indices and importance indices both run from 0 to 20."""

TABLE_FILE = Path(__file__).parent / "data" / "penrose_corrections.npy"


@cache
def correction_table() -> NDArray[np.float64]:
    """The displacements (21, 21, 2): importance index, structural index, component in the frame."""
    table = np.load(TABLE_FILE)
    table.flags.writeable = False
    return table


def required_level(threshold: NDArray[np.float64]) -> NDArray[np.int64]:
    """The first level at which every code up to the threshold exists: F(2L + 2) > threshold."""
    return np.searchsorted(FIBONACCI[2::2], threshold, side="right")


def importance_index(threshold: NDArray[np.float64], level: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where the threshold lies between two levels, 0 to 20: ⌊21·frac(log_φ²(√5·threshold))⌋."""
    within = np.log(math.sqrt(5.0) * threshold) / (2.0 * math.log(PHI)) - level
    return np.clip(np.floor(INDICES * within), 0, INDICES - 1).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Anchors:
    """Sampling tiles at the level that their threshold asks for.

    along, across : (n, 2) the tile's axes u(d) and u(d + 5), times its side
    structure : (n,) structural index, 0 to 20
    row : (n,) importance index, 0 to 20
    """

    along: NDArray[np.float64]
    across: NDArray[np.float64]
    structure: NDArray[np.int64]
    row: NDArray[np.int64]


def anchors(born: Births, threshold: NDArray[np.float64], side: float) -> Anchors:
    """The tiles' frames and indices at the level of the thresholds (n,), in a root of side s₀.

    A sampling tile keeps its place and its code, turns by half a circle every second level and
    shrinks by φ every level, so none is ever subdivided.
    """
    # Rounding may put a threshold that equals the code just below it, hence one level too early.
    level = np.maximum(born.level, required_level(threshold))
    older = level - born.level
    direction = (born.direction + 10 * (older // 2)) % DIRECTIONS
    size = side * PHI ** -level.astype(np.float64)
    bits = np.right_shift(born.newest, np.minimum(2 * older, 6))
    weight = FIBONACCI[2:8]
    structure = ((bits[:, None] >> np.arange(6)) & 1) @ weight
    return Anchors(
        size[:, None] * UNIT[direction],
        size[:, None] * UNIT[(direction + 5) % DIRECTIONS],
        structure,
        importance_index(threshold, level),
    )


def displacement(anchor: Anchors, correction: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the correction table (21, 21, 2) adds to the positions, (n, 2).

    The table's axes: importance index, structural index, component along u(d) and u(d + 5) in units
    of the tile's side.
    """
    shift = correction[anchor.row, anchor.structure]
    return shift[:, :1] * anchor.along + shift[:, 1:] * anchor.across
