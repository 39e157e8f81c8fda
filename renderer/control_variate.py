"""What a reference knows without sampling: its surfaces' diffuse light where nothing casts shadows.

Shadows take little from most points, so that the diffuse light of a point's samples before shadows
goes together with what arrives of them. The former's expectation E is known, which makes it a
control variate: radiance + β (E − samples' diffuse light before shadows), with the same expectation
for every β that does not depend on the samples' mean. See Owen, "Monte Carlo theory, methods and
examples", section 8.9.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.background import background_radiance
from renderer.irradiance import COATED, IRRADIANCE, diffuse_maps
from renderer.monte_carlo import POINT_BLOCK
from renderer.packet import coated, material_table
from renderer.packet.embree import LANES
from renderer.packet.lambert import evaluate
from renderer.view import View
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.bilinear import bilinear_at
from samplers.sphere import RUN, map_positions
from samplers.threads import block_of, for_blocks

LEAST_PIXELS = 64
"""Pixels that a β is fitted to; tiles that show fewer share one, so that it follows no noise."""


@kernel
def _expect(surface, material, materials, maps, start, stop, out):
    """E of the points start … stop into out (n, 3): maps, between their pixels, times f_r."""
    _, normal, _, toward_eye = surface
    way, place, value = np.zeros(3 * RUN), np.empty(2 * RUN), np.empty(3)
    for first in range(start, stop, LANES):
        used = min(LANES, stop - first)
        map_positions(normal, first, used, maps.shape[1], way, place)
        for k in range(used):
            i = first + k
            row = materials[material[i]]
            nv = 0.0
            for axis in range(3):
                nv += np.float64(normal[i, axis]) * np.float64(toward_eye[i, axis])
            share, under = coated.diffuse_share(row, nv), IRRADIANCE
            if int(row[material_table.KIND]) == material_table.COATED:
                share *= row[material_table.BASE_SCALE] * (1.0 - row[material_table.COAT])
                under = COATED
            bilinear_at(maps[under], place[k], place[RUN + k], value)
            for channel in range(3):
                reflected = evaluate(row[material_table.DIFFUSE + channel]) * share
                out[i, channel] = reflected * value[channel]


def expected_diffuse(view: View, environment: EnvironmentMap) -> NDArray[np.float64]:
    """E (n, 3): the diffuse radiance of the view's points if nothing shadowed the map."""
    out = np.zeros((len(view), 3))
    maps = diffuse_maps(environment)
    surface, material, materials = view.surface, view.material, view.materials
    for_blocks(
        lambda start, stop: _expect(surface, material, materials, maps, start, stop, out),
        len(view),
        block_of(len(view), POINT_BLOCK),
    )
    return out


def fitted_beta(
    tile: NDArray[np.int64], radiance: NDArray[np.float64], diffuse: NDArray[np.float64]
) -> NDArray[np.float64]:
    """β of each tile (t,): of least squared radiance − β · diffuse over its pixels and channels.

    tile : (p,), of each pixel that shows a surface
    radiance, diffuse : (p, 3), differences of two halves of the samples. They do not tell on which
        side of its expectation the halves' mean lies, so that β does not shift it.
    """
    count = np.bincount(tile)
    common = count[tile] < LEAST_PIXELS
    group = np.where(common, len(count), tile)
    together = np.bincount(group, (radiance * diffuse).sum(axis=1), len(count) + 1)
    square = np.bincount(group, (diffuse * diffuse).sum(axis=1), len(count) + 1)
    beta = np.divide(together, square, out=np.zeros(len(count) + 1), where=square > 0.0)
    return np.where(count < LEAST_PIXELS, beta[-1], beta[:-1])


@dataclass(frozen=True, eq=False)
class SurfacePixels:
    """The pixels of a view that show a surface, and what is known of them without sampling.

    place : (p,), where they lie in the flat image; tile : (p,), the tile of each
    known : (p, 3), their diffuse radiance if nothing cast a shadow
    background : (height, width, 3), what pixels show beside surfaces
    """

    view: View
    place: NDArray[np.int64]
    tile: NDArray[np.int64]
    known: NDArray[np.float64]
    background: NDArray[np.float64]

    @classmethod
    def of(cls, view: View, environment: EnvironmentMap) -> "SurfacePixels":
        # A pixel lies in one tile, that of its first point.
        place, first = np.unique(view.pixel.astype(np.int64), return_index=True)
        tile = np.searchsorted(view.tile, first, side="right") - 1
        black = np.zeros((len(view), 3), np.float32)
        background = view.to_image(black, background_radiance(view, environment))
        known = _at(view, place, expected_diffuse(view, environment))
        return cls(view, place, tile, known, background.astype(np.float64))

    def of_points(self, radiance: NDArray) -> NDArray[np.float64]:
        """What radiance (n, 3) of the view's points adds to the pixels, (p, 3)."""
        return _at(self.view, self.place, radiance)

    def image(self, radiance: NDArray[np.float64]) -> NDArray[np.float64]:
        """The picture of radiance (p, 3) over the background, at least 0."""
        image = self.background.copy()
        image.reshape(-1, 3)[self.place] += radiance
        return np.maximum(image, 0.0)


def _at(view: View, place: NDArray[np.int64], radiance: NDArray) -> NDArray[np.float64]:
    found: NDArray[np.float64] = view.to_image(radiance, None).reshape(-1, 3)[place].astype(float)
    return found
