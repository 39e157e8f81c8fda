"""Surfaces over a grid of points: lathed, swept along a curve, or made of Bézier patches.

A grid's outside is where its columns' direction times its rows' direction points.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.modelling.curves import bernstein
from renderer.modelling.shape import Shape, weld

Points = NDArray[np.float64]


def grid(points: Points, closed_rows: bool = False, closed_columns: bool = False) -> Shape:
    """Two triangles for each cell of a grid.

    points : (rows, columns, 3), or (patches, rows, columns, 3) for several grids at once
    closed_rows : the last row is joined to the first, closed_columns : the last column likewise
    """
    rows, columns = points.shape[-3:-1]
    row = np.arange(rows if closed_rows else rows - 1)[:, None]
    column = np.arange(columns if closed_columns else columns - 1)[None, :]
    below, above = row * columns, (row + 1) % rows * columns
    left, right = column, (column + 1) % columns
    a, b, c, d = (v.ravel() for v in (below + left, below + right, above + right, above + left))
    triangle = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    first = np.arange(points.size // (3 * rows * columns)) * rows * columns
    return Shape(points.reshape(-1, 3), (triangle[None] + first[:, None, None]).reshape(-1, 3))


def lathe(
    profile: ArrayLike, segments: int = 128, relief: Points | None = None, turn: ArrayLike = 0.0
) -> Shape:
    """A profile turned about the +Y axis.

    profile : (n, 2) radius and height. The outside is to its right; from the axis at the bottom,
        outwards, up and back to the axis makes a closed body. Points on the axis become poles.
    relief : (n, segments), added to the radius
    turn : () or (n,) degrees by which each row is turned, so that spiral ribs follow the grid
    """
    radius, height = np.asarray(profile, np.float64).T
    start = np.radians(np.broadcast_to(np.asarray(turn, np.float64), len(radius)))
    angle = start[:, None] + np.arange(segments) * (2.0 * np.pi / segments)
    reach = radius[:, None] + (0.0 if relief is None else relief)
    points = np.stack(
        np.broadcast_arrays(reach * np.cos(angle), height[:, None], -reach * np.sin(angle)), axis=2
    )
    return weld(grid(points, closed_columns=True))


def sweep(
    path: ArrayLike,
    section: ArrayLike,
    scale: ArrayLike = 1.0,
    up: ArrayLike = (0.0, 1.0, 0.0),
    closed: bool = False,
) -> Shape:
    """A closed section carried along a path, without turning about it more than the path does.

    path : (n, 3)
    section : (k, 2) counter-clockwise, across the path and along `up`
    scale : () or (n,) or (n, 2) factor on the section at each point of the path
    up : where the section's second axis points at the start, as nearly as it can
    closed : the path's end is joined to its start; otherwise the ends are flat
    """
    points = np.asarray(path, np.float64)
    side, above = _frames(points, np.asarray(up, np.float64), closed)
    factor = np.asarray(scale, np.float64)
    factor = np.broadcast_to(factor[:, None] if factor.ndim == 1 else factor, (len(points), 2))
    offset = np.asarray(section, np.float64) * factor[:, None, :]
    rows = points[:, None] + offset[..., :1] * side[:, None] + offset[..., 1:] * above[:, None]
    if not closed:
        ends = np.broadcast_to(points[[0, -1], None], (2, *rows.shape[1:]))
        rows = np.concatenate([ends[:1], rows, ends[1:]])
    return weld(grid(rows, closed_rows=closed, closed_columns=True))


def tube(path: ArrayLike, radius: ArrayLike, segments: int = 16, closed: bool = False) -> Shape:
    """A round tube along a path; open ends are half spheres.

    radius : () or (n,)
    """
    points = np.asarray(path, np.float64)
    width = np.broadcast_to(np.asarray(radius, np.float64), len(points))
    angle = np.arange(segments) * (2.0 * np.pi / segments)
    section = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if closed:
        return sweep(points, section, width, _across(points[1] - points[0]), closed=True)
    bend = np.linspace(0.0, 0.5 * np.pi, max(segments // 4, 2) + 1)[:-1]
    start, stop = points[0] - points[1], points[-1] - points[-2]
    start, stop = start / np.linalg.norm(start), stop / np.linalg.norm(stop)
    cap = np.sin(bend)[::-1, None]
    points = np.concatenate(
        [
            points[:1] + width[0] * start,
            points[0] + width[0] * cap[:-1] * start,
            points,
            points[-1] + width[-1] * cap[-2::-1] * stop,
            points[-1:] + width[-1] * stop,
        ]
    )
    round_off = np.cos(bend)[:0:-1]
    width = np.concatenate([[0.0], width[0] * round_off, width, width[-1] * round_off[::-1], [0.0]])
    return sweep(points, section, width, _across(points[1] - points[0]))


def bezier_patches(control: ArrayLike, steps: int) -> Shape:
    """Bicubic Bézier patches, `steps` intervals along each side, welded where they meet.

    control : (k, 4, 4, 3); rows, then columns
    """
    weight = bernstein(np.linspace(0.0, 1.0, steps + 1))
    points = np.einsum("ur,vc,krcx->kuvx", weight, weight, np.asarray(control, np.float64))
    return weld(grid(points))


def _across(direction: Points) -> Points:
    """Some vector that is not along `direction`."""
    return np.eye(3)[np.argmin(np.abs(direction))]


def _frames(path: Points, up: Points, closed: bool) -> tuple[Points, Points]:
    """(n, 3) twice: rotation-minimising frames, so that side × up runs along the path.

    Wang, Jüttler, Zheng and Liu, "Computation of rotation minimizing frames", ACM Transactions on
    Graphics 27(1), 2008, section 4 (double reflection). Over a closed path the twist that is left
    at the end is spread evenly.
    """
    if closed:
        step = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    else:
        step = np.gradient(path, axis=0)
    tangent = step / np.linalg.norm(step, axis=1, keepdims=True)
    above = np.empty_like(path)
    above[0] = up - (up @ tangent[0]) * tangent[0]
    above[0] /= np.linalg.norm(above[0])
    for i in range(len(path) - 1):
        above[i + 1] = _transport(path[i], path[i + 1], tangent[i], tangent[i + 1], above[i])
    side = np.cross(above, tangent)
    if closed:
        last = _transport(path[-1], path[0], tangent[-1], tangent[0], above[-1])
        twist = np.arctan2(last @ side[0], last @ above[0])
        angle = -twist * np.arange(len(path))[:, None] / len(path)
        above, side = (
            np.cos(angle) * above + np.sin(angle) * side,
            np.cos(angle) * side - np.sin(angle) * above,
        )
    return side, above


def _transport(here: Points, there: Points, from_: Points, to: Points, above: Points) -> Points:
    """`above` carried from one point of a path to the next by two reflections."""
    chord = there - here
    factor = 2.0 / (chord @ chord)
    reflected = above - factor * (chord @ above) * chord
    turned = from_ - factor * (chord @ from_) * chord
    mirror = to - turned
    size = mirror @ mirror
    if size < 1e-24:
        return reflected
    return reflected - 2.0 / size * (mirror @ reflected) * mirror
