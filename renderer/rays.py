"""Counting rays, and the packet of shadow rays that the shading kernels fill."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from renderer.embree import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    LANES,
    ORG_X,
    ORG_Y,
    ORG_Z,
    T_FAR,
    occluded,
)


@dataclass(frozen=True)
class RayCount:
    """Rays of an image by kind.

    primary : one per sub-pixel, shared by all images of a view
    shadow : towards lights; brdf : in directions drawn from the BRDF
    skipped : lights or samples that were dropped before a ray existed, since they face away or
        carry nothing
    """

    primary: int = 0
    shadow: int = 0
    brdf: int = 0
    skipped: int = 0

    def __add__(self, other: "RayCount") -> "RayCount":
        return RayCount(
            max(self.primary, other.primary),
            self.shadow + other.shadow,
            self.brdf + other.brdf,
            self.skipped + other.skipped,
        )

    @property
    def traced(self) -> int:
        """Rays traced for this image alone."""
        return self.shadow + self.brdf


@njit(nogil=True, cache=True)
def push_ray(packet, owner, value, lane, position, i, lx, ly, lz, red, green, blue):
    """Put a shadow ray of point i with what it would carry into the packet's next lane."""
    packet[ORG_X, lane] = position[i, 0]
    packet[ORG_Y, lane] = position[i, 1]
    packet[ORG_Z, lane] = position[i, 2]
    packet[DIR_X, lane] = lx
    packet[DIR_Y, lane] = ly
    packet[DIR_Z, lane] = lz
    owner[lane] = i
    value[lane, 0], value[lane, 1], value[lane, 2] = red, green, blue


@njit(nogil=True, cache=True)
def flush_rays(scene, packet, valid, owner, value, lanes, start, total, arguments):
    """Trace the packet's first `lanes` rays and add what the unblocked ones carry to `total`.

    total : (points, 3) float64, row 0 belonging to point `start`
    """
    for k in range(LANES):
        valid[k] = -1 if k < lanes else 0
    occluded(scene, valid, packet, arguments)
    for k in range(lanes):
        if packet[T_FAR, k] >= 0.0:
            for channel in range(3):
                total[owner[k] - start, channel] += value[k, channel]


@njit(nogil=True, cache=True)
def new_ray_values():
    """Owners (16,) int64 and values (16, 3) float64 that go with a packet."""
    return np.zeros(LANES, np.int64), np.zeros((LANES, 3), np.float64)
