"""The emissive pixels of a map as a compact list, at most a fiftieth of the map.

Row-major order is kept, so that a row of the map is a slice of the list. Sources of the notion are
named in `samplers.decomposition.emissive`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap


@dataclass(frozen=True, eq=False)
class EmissivePixels:
    """The emissive pixels of a map as a list in row-major order.

    pixel : (n,) index into the flattened map; row_start : (H + 1,) first entry of each row
    direction : (n, 3) of the centres; luminous_flux : (n,); flux : (n, 3); solid_angle : (n,)
    """

    height: int
    pixel: NDArray[np.int64]
    row_start: NDArray[np.int64]
    direction: NDArray[np.float64]
    luminous_flux: NDArray[np.float64]
    flux: NDArray[np.float64]
    solid_angle: NDArray[np.float64]


@kernel
def _gather(emissive, row_start, radiance, luminance, row_solid_angle, sine, cosine, pixel,
            direction, luminous_flux, flux, solid_angle):  # fmt: skip
    height, width = emissive.shape
    for r in range(height):
        p = row_start[r]
        if row_start[r + 1] == p:
            continue
        theta = (r + 0.5) * math.pi / height
        sin_theta, cos_theta = math.sin(theta), math.cos(theta)
        for c in range(width):
            if emissive[r, c]:
                pixel[p] = r * width + c
                direction[p, 0] = sine[c] * sin_theta
                direction[p, 1] = cos_theta
                direction[p, 2] = -cosine[c] * sin_theta
                solid_angle[p] = row_solid_angle[r]
                luminous_flux[p] = np.float64(luminance[r, c]) * row_solid_angle[r]
                for i in range(3):
                    flux[p, i] = np.float64(radiance[r, c, i]) * row_solid_angle[r]
                p += 1


def gather(environment: EnvironmentMap, emissive: NDArray[np.bool_]) -> EmissivePixels:
    """The pixels of the mask (H, W) as a list."""
    height, width = emissive.shape
    row_start = np.concatenate([[0], np.cumsum(np.count_nonzero(emissive, axis=1))])
    count = int(row_start[-1])
    phi = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
    pixels = EmissivePixels(
        height,
        np.empty(count, np.int64),
        row_start,
        np.empty((count, 3)),
        np.empty(count),
        np.empty((count, 3)),
        np.empty(count),
    )
    _gather(emissive, row_start, environment.radiance, environment.luminance,
            environment.row_solid_angle, np.sin(phi), np.cos(phi), pixels.pixel, pixels.direction,
            pixels.luminous_flux, pixels.flux, pixels.solid_angle)  # fmt: skip
    return pixels
