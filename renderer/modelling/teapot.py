"""The Utah teapot.

Martin Newell, "The Utilization of Procedure Models in Digital Image Synthesis", PhD thesis,
University of Utah, 1975: bicubic Bézier patches; the bottom was added later by Frank Crow. Newell's
parts are open sheets. Here each is closed where nobody sees it, so that the teapot is made of
solids: a groove joins the lid to the rim, the handle's and the spout's ends are closed inside the
body, and the spout has an inner wall.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.modelling.curves import bernstein
from renderer.modelling.shape import Shape, merge, weld
from renderer.modelling.surfaces import bezier_patches, grid

Points = NDArray[np.float64]

ARM = 0.56
"""Length of the tangents of Newell's quarter circle of radius 1."""

# (radius, height) of the rings of control points; each third ring is shared by two patches.
BOTTOM = [(0.0, 0.0), (1.425, 0.0), (1.5, 0.075), (1.5, 0.15)]
BODY = [(1.5, 0.15), (1.5, 0.225), (2.0, 0.45), (2.0, 0.9), (2.0, 1.35), (1.75, 1.875), (1.5, 2.4)]
RIM = [(1.5, 2.4), (1.4375, 2.53125), (1.3375, 2.53125), (1.4, 2.4)]
GROOVE = [(1.4, 2.4), (1.37, 2.36), (1.33, 2.36), (1.3, 2.4)]
LID = [(1.3, 2.4), (1.3, 2.55), (0.4, 2.55), (0.2, 2.7)]
KNOB = [(0.2, 2.7), (0.0, 2.85), (0.8, 3.15), (0.0, 3.15)]
REVOLVED = [*BOTTOM, *BODY[1:], *RIM[1:], *GROOVE[1:], *LID[1:], *KNOB[1:]]

# (x, y, z) of half a ring of control points; the other half is its mirror image in z.
HANDLE = [
    [(-1.6, 2.025, 0.0), (-1.6, 2.025, 0.3), (-1.5, 2.25, 0.3), (-1.5, 2.25, 0.0)],
    [(-2.3, 2.025, 0.0), (-2.3, 2.025, 0.3), (-2.5, 2.25, 0.3), (-2.5, 2.25, 0.0)],
    [(-2.7, 2.025, 0.0), (-2.7, 2.025, 0.3), (-3.0, 2.25, 0.3), (-3.0, 2.25, 0.0)],
    [(-2.7, 1.8, 0.0), (-2.7, 1.8, 0.3), (-3.0, 1.8, 0.3), (-3.0, 1.8, 0.0)],
    [(-2.7, 1.575, 0.0), (-2.7, 1.575, 0.3), (-3.0, 1.35, 0.3), (-3.0, 1.35, 0.0)],
    [(-2.5, 1.125, 0.0), (-2.5, 1.125, 0.3), (-2.65, 0.9375, 0.3), (-2.65, 0.9375, 0.0)],
    [(-2.0, 0.9, 0.0), (-2.0, 0.9, 0.3), (-1.9, 0.6, 0.3), (-1.9, 0.6, 0.0)],
]
SPOUT = [
    [(1.7, 1.425, 0.0), (1.7, 1.425, 0.66), (1.7, 0.6, 0.66), (1.7, 0.6, 0.0)],
    [(2.6, 1.425, 0.0), (2.6, 1.425, 0.66), (3.1, 0.825, 0.66), (3.1, 0.825, 0.0)],
    [(2.3, 2.1, 0.0), (2.3, 2.1, 0.25), (2.4, 2.025, 0.25), (2.4, 2.025, 0.0)],
    [(2.7, 2.4, 0.0), (2.7, 2.4, 0.25), (3.3, 2.4, 0.25), (3.3, 2.4, 0.0)],
    [(2.8, 2.475, 0.0), (2.8, 2.475, 0.25), (3.525, 2.49375, 0.25), (3.525, 2.49375, 0.0)],
    [(2.9, 2.475, 0.0), (2.9, 2.475, 0.15), (3.45, 2.5125, 0.15), (3.45, 2.5125, 0.0)],
    [(2.8, 2.4, 0.0), (2.8, 2.4, 0.15), (3.2, 2.4, 0.15), (3.2, 2.4, 0.0)],
]
SPOUT_WALL = 0.65
"""Width of the spout's inside relative to its outside: that of the lip to the ring below it."""


def body(steps: int = 16) -> Shape:
    """Bottom, body, rim, groove, lid and knob: one closed solid."""
    return bezier_patches(revolved_patches(REVOLVED), steps)


def handle(steps: int = 16) -> Shape:
    """The handle, with both ends closed inside the body."""
    rows = _tube_rows(HANDLE, steps)
    return _closed_tube(rows, (-1.4, 2.1, 0.0), (-1.6, 0.75, 0.0))


def spout(steps: int = 16) -> Shape:
    """The spout, closed inside the body, with an inner wall down to half of its length."""
    rows = _tube_rows(SPOUT, steps)
    below = rows[int(0.92 * steps) : steps // 2 : -1]
    center = 0.5 * (below.max(axis=1, keepdims=True) + below.min(axis=1, keepdims=True))
    inner = center + SPOUT_WALL * (below - center)
    return _closed_tube(np.concatenate([rows, inner]), (1.5, 1.0, 0.0), center[-1, 0])


def teapot(steps: int = 16) -> Shape:
    """The whole teapot on y = 0, its spout towards +X, in Newell's units (3.15 high).

    steps : intervals along each side of a patch; 2 · 44 · steps² triangles, nearly
    """
    return merge(body(steps), handle(steps), spout(steps))


def revolved_patches(rings: list[tuple[float, float]]) -> Points:
    """(4k, 4, 4, 3) control points of the patches of rings about +Y, on Newell's circle."""
    radius, height = np.array(rings).T
    across = np.array([1.0, 1.0, ARM, 0.0])
    along = np.array([0.0, ARM, 1.0, 1.0])
    patches = []
    for start in range(0, len(rings) - 1, 3):
        r, y = radius[start : start + 4, None], height[start : start + 4, None]
        for x, z in ((across, along), (-along, across), (-across, -along), (along, -across)):
            patches.append(np.stack(np.broadcast_arrays(r * x, y, -r * z), axis=2))
    return np.array(patches)


def _tube_rows(rings: list[list[tuple[float, float, float]]], steps: int) -> Points:
    """(rows, columns, 3) points of a tube, whose columns close, from half rings."""
    half = np.array(rings)
    weight = bernstein(np.linspace(0.0, 1.0, steps + 1))
    pieces = [
        np.einsum("ur,vc,rcx->uvx", weight, weight, half[start : start + 4])
        for start in range(0, len(rings) - 1, 3)
    ]
    rows = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
    mirror = rows[:, -2:0:-1] * (1.0, 1.0, -1.0)
    return np.concatenate([rows, mirror], axis=1)


def _closed_tube(rows: Points, start: Sequence[float], stop: Sequence[float]) -> Shape:
    """Rows of a tube with its ends drawn together to a point each."""
    ends = [np.broadcast_to(np.asarray(end), (1, *rows.shape[1:])) for end in (start, stop)]
    return weld(grid(np.concatenate([ends[0], rows, ends[1]]), closed_columns=True))
