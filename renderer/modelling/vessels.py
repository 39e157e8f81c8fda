"""Hollow vessels: from the curve of their outside to a closed profile with a wall."""

import numpy as np
from numpy.typing import ArrayLike

from renderer.modelling.curves import Points, bezier, rounded


def vessel(side: ArrayLike, wall: float, floor: float, foot: float = 0.0, steps: int = 6) -> Points:
    """(n, 2) profile of a vessel: bottom, outside, rim, inside and inner floor.

    side : (k, 2) radius and height of the outside, from the edge of the bottom up to the rim
    wall : thickness; the rim is half a circle of it
    floor : height of the inner floor, above which the inside runs into it smoothly
    foot : radius of the bottom's edge, at most a third of the distance to its neighbours
    """
    outside = np.asarray(side, np.float64)
    bottom = rounded([(0.0, outside[0, 1]), outside[0], *outside[1:2]], foot, steps)[:-1]
    tangent = np.gradient(outside, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    inward = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    angle = np.linspace(0.0, np.pi, 2 * steps + 1)[1:, None]
    rim = outside[-1] + 0.5 * wall * (
        np.sin(angle) * tangent[-1] + (1.0 - np.cos(angle)) * inward[-1]
    )
    first = int(np.flatnonzero(outside[:, 1] > floor + 2.0 * wall)[0])
    inside = (outside + wall * inward)[first:]
    deep = inside[0, 1] - floor
    low = bezier(
        [
            inside[0],
            inside[0] - 0.6 * deep * tangent[first],
            (0.6 * inside[0, 0], floor),
            (0, floor),
        ],
        3 * steps,
    )
    return np.concatenate([bottom, outside[1:], rim, inside[-2::-1], low[1:]])
