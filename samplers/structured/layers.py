"""Nested layers of a map by brightness, their connected regions, and the samples each should get.

Source: Agarwal, Ramamoorthi, Belongie and Jensen, "Structured importance sampling of environment
maps", ACM Transactions on Graphics 22(3), 2003.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.sphere_grid import components

OUTSIDE = -1


@kernel
def _collect(label, regions, flux, row_solid_angle):
    """Flux and solid angle of regions, and their texels, one region after another."""
    width = len(label) // len(row_solid_angle)
    sums, start = np.zeros((2, regions)), np.zeros(regions + 1, np.int64)
    for texel in range(len(label)):
        k = label[texel]
        if k >= 0:
            sums[0, k] += flux[texel]
            sums[1, k] += row_solid_angle[texel // width]
            start[k + 1] += 1
    for k in range(regions):
        start[k + 1] += start[k]
    order, end = np.empty(start[-1], np.int32), start[:-1].copy()
    for texel in range(len(label)):
        k = label[texel]
        if k >= 0:
            order[end[k]] = texel
            end[k] += 1
    return sums, order, start


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
    def of(cls, label: NDArray[np.int32], environment: EnvironmentMap) -> "Layer":
        """The layer of labels (H·W,) from 0, −1 outside."""
        flux = environment.flux.reshape(-1)
        sums, order, start = _collect(label, label.max() + 1, flux, environment.row_solid_angle)
        return cls(label, sums[0], sums[1], order, start)

    def members(self, region: int) -> NDArray[np.int32]:
        """Flat indices of the texels of a region."""
        return self.order[self.start[region] : self.start[region + 1]]


def layers_of(environment: EnvironmentMap, threshold: NDArray[np.float64]) -> list[Layer]:
    """A layer for each ascending threshold; the first, of all lit texels, is one region.

    That region stands for the whole sphere, dark texels included, so all lit ones belong to it.
    """
    luminance = environment.luminance.reshape(-1)
    lit = luminance > 0.0
    layers = [Layer.of(np.where(lit, np.int32(0), np.int32(OUTSIDE)), environment)]
    for level in threshold[1:]:
        inside = (luminance >= level) & lit
        if not inside.any():
            break
        if inside.all() or np.array_equal(inside, lit):
            continue  # nothing is set apart from the whole
        layers.append(Layer.of(components(inside, environment.height), environment))
    return layers


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
