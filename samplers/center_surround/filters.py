"""A bank of centre-surround filters on the sphere, written as weighted sums over nested caps.

Each filter weighs a disc of directions with +1 and the ring around it with a negative number, so it
answers only where the disc is much brighter than its surroundings. A ring is the difference of two
caps, and weights that vary with the angle from the centre become a staircase of rings; so every
filter is Σ weight × (flux within a cap), and caps can be summed fast.

Source: Arbree, Walter, Bala, "Pre-processing environment maps for dynamic hardware shadows",
Cornell University technical report, 2005, section 3 and figure 1.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.sphere import cap_solid_angle

PLANAR_STEPS = 16
"""Rings per zone that follow the planar weight 1/cos³; it varies by 8 % within one at most."""


@dataclass(frozen=True, eq=False)
class FilterBank:
    """Filters with `inner` and `outer` radii (n,) in radians, each a sum over caps.

    cap_radius, cap_weight, cap_filter : (m,) radius, weight, and the filter it belongs to; the
        weights are divided by the filter's angular extent
    """

    inner: NDArray[np.float64]
    outer: NDArray[np.float64]
    cap_radius: NDArray[np.float64]
    cap_weight: NDArray[np.float64]
    cap_filter: NDArray[np.int64]


def angular_extents(
    count: int, smallest: float, largest: float, geometric: bool
) -> NDArray[np.float64]:
    """`count` angles from `smallest` to `largest`, in radians from degrees."""
    spaced = np.geomspace if geometric else np.linspace
    return np.radians(spaced(smallest, largest, count))


def _ring_weight(low: NDArray, high: NDArray, planar: bool) -> NDArray[np.float64]:
    """Weight per solid angle of rings: 1 on the sphere, area in the tangent plane otherwise."""
    if not planar:
        return np.ones_like(low)
    area = math.pi * (np.tan(high) ** 2 - np.tan(low) ** 2)
    return area / (cap_solid_angle(high) - cap_solid_angle(low))


def filter_bank(
    extent: NDArray[np.float64],
    extent_is_diameter: bool,
    inner_share: float,
    share_in_plane: bool,
    surround: float,
    planar: bool,
) -> FilterBank:
    """The filters of the given angular extents (n,) in radians.

    extent_is_diameter : the extent is the outer circle's diameter, otherwise its radius
    inner_share, share_in_plane : inner radius / outer radius, as angles or in the tangent plane
    surround : weight of the ring, a negative number
    planar : weigh by area in the tangent plane in place of solid angle
    """
    outer = 0.5 * extent if extent_is_diameter else extent
    inner = np.arctan(inner_share * np.tan(outer)) if share_in_plane else inner_share * outer
    steps = PLANAR_STEPS if planar else 1
    fraction = np.arange(1, steps + 1) / steps
    radius = np.concatenate(
        [inner[:, None] * fraction, inner[:, None] + (outer - inner)[:, None] * fraction], axis=1
    )
    below = np.concatenate([np.zeros((len(outer), 1)), radius[:, :-1]], axis=1)
    level = _ring_weight(below, radius, planar) * np.repeat([1.0, surround], steps)
    next_level = np.concatenate([level[:, 1:], np.zeros((len(outer), 1))], axis=1)
    weight = (level - next_level) / extent[:, None]
    owner = np.repeat(np.arange(len(outer)), 2 * steps)
    return FilterBank(inner, outer, radius.ravel(), weight.ravel(), owner)
