"""Curves: points along arcs, Bézier curves, splines and polylines with rounded corners.

All return (n, d) float64 arrays; d is 2 for profiles, (radius, height), and 3 for paths.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]


def bernstein(t: Points) -> Points:
    """(n, 4) cubic Bernstein polynomials at `t` (n,)."""
    s = 1.0 - t
    return np.stack([s**3, 3.0 * s * s * t, 3.0 * s * t * t, t**3], axis=-1)


def bezier(control: ArrayLike, steps: int) -> Points:
    """Points along joined cubic Bézier curves, `steps` intervals each.

    control : (3k + 1, d); each third point is shared by two curves
    """
    points = np.asarray(control, np.float64)
    weight = bernstein(np.linspace(0.0, 1.0, steps + 1))
    pieces = [weight[:-1] @ points[i : i + 4] for i in range(0, len(points) - 1, 3)]
    return np.concatenate([*pieces, points[-1:]])


def spline(knots: ArrayLike, steps: int) -> Points:
    """`steps + 1` points along the natural cubic spline through the knots.

    The parameter is the square root of the distance between knots, which keeps uneven knots from
    making loops.
    """
    from scipy.interpolate import CubicSpline

    points = np.asarray(knots, np.float64)
    interval = np.sqrt(np.linalg.norm(np.diff(points, axis=0), axis=1))
    parameter = np.concatenate([[0.0], np.cumsum(interval)])
    curve = CubicSpline(parameter, points, bc_type="natural")
    return np.asarray(curve(np.linspace(0.0, parameter[-1], steps + 1)))


def arc(center: Sequence[float], radius: float, start: float, stop: float, steps: int) -> Points:
    """`steps + 1` points of a circle in the plane between two angles in degrees."""
    angle = np.radians(np.linspace(start, stop, steps + 1))
    return np.asarray(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def rounded(corners: ArrayLike, radius: float | Sequence[float], steps: int = 6) -> Points:
    """An open polyline whose inner corners are replaced by circular arcs.

    radius : of the arcs, one for all or one per inner corner; 0 leaves a corner sharp. An arc is
        made smaller where an edge is too short for it.
    """
    points = np.asarray(corners, np.float64)
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(points) - 2)
    result = [points[:1]]
    for before, here, after, wanted in zip(points, points[1:], points[2:], radii, strict=False):
        back, ahead = before - here, after - here
        back_length, ahead_length = np.linalg.norm(back), np.linalg.norm(ahead)
        back, ahead = back / back_length, ahead / ahead_length
        half = 0.5 * np.arccos(np.clip(back @ ahead, -1.0, 1.0))
        setback = min(wanted / np.tan(half), 0.499 * back_length, 0.499 * ahead_length)
        if setback <= 0.0 or half > 0.499 * np.pi:
            result.append(here[None])
            continue
        middle = here + (back + ahead) / np.linalg.norm(back + ahead) * setback / np.cos(half)
        start, stop = here + back * setback - middle, here + ahead * setback - middle
        sweep = np.pi - 2.0 * half
        t = np.linspace(0.0, 1.0, steps + 1)[:, None]
        result.append(
            middle + (np.sin((1.0 - t) * sweep) * start + np.sin(t * sweep) * stop) / np.sin(sweep)
        )
    return np.concatenate([*result, points[-1:]])
