"""Nested layers of a map by brightness, their connected regions, and the samples each should get.

Source: Agarwal, Ramamoorthi, Belongie and Jensen, "Structured importance sampling of environment
maps", ACM Transactions on Graphics 22(3), 2003.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.sphere_grid import by_label, components


@kernel
def _sums(label, regions, luminance, row_solid_angle):
    """Flux and solid angle (2, k) of regions."""
    width = len(label) // len(row_solid_angle)
    sums = np.zeros((2, regions))
    for texel in range(len(label)):
        k = label[texel]
        if k >= 0:
            solid_angle = row_solid_angle[texel // width]
            sums[0, k] += np.float64(luminance[texel]) * solid_angle
            sums[1, k] += solid_angle
    return sums


@dataclass(frozen=True, eq=False)
class Layer:
    """The lit texels not darker than a threshold, as k connected regions.

    label : (H·W,) int32, region of each texel, −1 outside
    flux, solid_angle : (k,) luminous flux, and solid angle in sr
    order, start : the texels of the regions, int32, one region after another in `order`
    """

    label: NDArray[np.int32]
    flux: NDArray[np.float64]
    solid_angle: NDArray[np.float64]
    order: NDArray[np.int32]
    start: NDArray[np.int64]

    @classmethod
    def of(cls, inside: NDArray[np.bool_], environment: EnvironmentMap) -> "Layer":
        """The layer of the texels that are inside (H·W,)."""
        label = components(inside, environment.height)
        regions, luminance = label.max() + 1, environment.luminance.reshape(-1)
        sums = _sums(label, regions, luminance, environment.row_solid_angle)
        return cls(label, *sums, *by_label(label, regions))

    def members(self, region: int) -> NDArray[np.int32]:
        """Flat indices of the texels of a region."""
        return self.order[self.start[region] : self.start[region + 1]]


def layers_of(environment: EnvironmentMap, threshold: NDArray[np.float64]) -> Iterator[Layer]:
    """The layers of ascending thresholds above the first, the brightest first.

    Left out are those without a texel, and those of all that is lit. A layer takes twice as much
    memory as the map's luminance: each is made when it is asked for.
    """
    luminance = environment.luminance.reshape(-1)
    lit = np.count_nonzero(luminance)
    for level in threshold[:0:-1]:
        inside = (luminance >= level) & (luminance > 0.0)
        if 0 < np.count_nonzero(inside) < lit:
            yield Layer.of(inside, environment)


def importance(
    flux: NDArray[np.float64], solid_angle: NDArray[np.float64], useful: float | None
) -> NDArray[np.float64]:
    """Γ (k,) of regions; `useful` is the largest solid angle that counts, None for no limit."""
    counted = solid_angle if useful is None else np.minimum(solid_angle, useful)
    return flux * counted**0.25


def numbers_of_samples(
    layer: Layer, total: float, count: int, samples: NDArray[np.int64], useful: float | None
) -> list[tuple[int, int]]:
    """Regions of a layer and the new samples that each gets, the most important region first.

    total : luminous flux of the map; samples : (m,) texels with a sample from brighter layers

    A region asks for round(count · Γ / Γ of the sphere), less the samples within it. It never gets
    more than it has texels without one, nor more than is left of `count`.
    """
    sphere = importance(np.array([total]), np.array([4.0 * math.pi]), useful)[0]
    value = importance(layer.flux, layer.solid_angle, useful)
    owner = layer.label[samples]
    held = np.bincount(owner[owner >= 0], minlength=len(value))
    wanted = np.floor(count * value / sphere + 0.5).astype(np.int64)
    wanted = np.minimum(wanted, np.diff(layer.start)) - held
    left, given = count - len(samples), []
    for region in np.lexsort((np.arange(len(value)), -value)).tolist():
        number = min(int(wanted[region]), left)
        if number > 0:
            given.append((region, number))
            left -= number
    return given
