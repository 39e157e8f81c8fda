"""EnvDirects: a few lights for the emissive pixels of a map, placed on those pixels.

Directions are drawn one by one in proportion to luminance × solid angle, a row from the marginal
and a pixel from the row's conditional distribution; each draw takes its neighbourhood Ω out, so
that lights keep apart. K-means then moves them to the energy centroids of the pixels nearest to
them. Pixels still too far from their light are given back to the non-emissive region.

Source: Wu, "Efficient environment map rendering based on decomposition", Computer Graphics Forum
44(1), 2025, section 3.3 and Table 2.

A draw costs its masked rows, k-means the tiles of emissive pixels times the number of lights per
round. The draws are the only randomness. Energy: after k-means each light carries ∫ L dω of its
pixels.

What the paper leaves open, measured by the experiment `readings`
    The size s·4π/K of Ω is a solid angle by its unit, but the text calls it a distance
    (`masking_radius`); "2·Ω" is twice the angle. Pixels are excluded "upon convergence", or in each
    round, so that they do not pull on centres that will not have them (`Exclusion`); either way a
    centre with nothing of its cluster within Ω (between two suns) moves to the nearest pixel of it
    before, and what is far from there goes to other lights.
    Without k-means lights stay where they were drawn and no pixel is excluded, which belongs to the
    paragraph on k-means. Draws alone are "conventional importance sampling": they share the
    region's flux alike, and nothing is assigned. Masked draws are no longer in proportion to flux,
    but "enforce stratification": each stands for the pixels nearest to it. Table 2 says of both
    only that positions are not adjusted, and has masked draws better than draws alone, which they
    are not where they share alike.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.decomposition.emissive_pixels import EmissivePixels, gather
from samplers.decomposition.spherical_kmeans import (
    OUTSIDE,
    Tiles,
    kmeans,
    nearest_centre,
    squared_chord,
    tiles_of,
)
from samplers.environment import EnvironmentMap
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, extent_of
from samplers.sphere import CANCELLED, DISC_MEAN, DISC_RIM, normalized

TILE_ROWS = 256
"""Tiles of pixels from pole to pole, at most."""
MASK_SLACK = 1e-9
"""Share by which rows are searched beyond the mask's radius, for rounding of the row's angle."""
NOBODY = -1
"""In place of a pixel's index: there is none."""
SPREAD = 0.15
"""s of the neighbourhood Ω, of size s·4π/K."""
Unit = Literal["solid_angle", "radians"]
Exclusion = Literal["converged", "each-round", "none"]
"""When pixels farther than 2·Ω from their centre go back: once k-means has converged, in each of
its assignments, or never."""


@dataclass(frozen=True, eq=False)
class EnvDirects:
    """The lights, and the (H, W) mask of the emissive pixels that they stand for."""

    lights: DirectionalLights
    kept: NDArray[np.bool_]


def masking_radius(count: int, unit: Unit) -> float:
    """Angle in radians of the neighbourhood Ω of size s·4π/K for K lights in all."""
    size = SPREAD * 4.0 * math.pi / count
    if unit == "radians":
        return min(size, math.pi)
    return 2.0 * math.asin(math.sqrt(min(1.0, size / (4.0 * math.pi))))


@kernel
def _first_above(weight, start, stop, target):
    """First entry whose running weight exceeds `target`, the last one with weight otherwise."""
    total, last = 0.0, start
    for p in range(start, stop):
        if weight[p] > 0.0:
            total += weight[p]
            last = p
            if total > target:
                break
    return last


@kernel
def _mask(direction, row_start, pole_distance, radius, weight, row_weight, drawn):
    """Take the pixels within `radius` of pixel `drawn` out of the distribution."""
    height = len(row_weight)
    reach = radius * (1.0 + MASK_SLACK)
    top = max(0, math.floor((pole_distance - reach) / math.pi * height))
    bottom = min(height, math.ceil((pole_distance + reach) / math.pi * height) + 1)
    limit = 4.0 * math.sin(0.5 * min(radius, math.pi)) ** 2
    for r in range(top, bottom):
        total = 0.0
        for p in range(row_start[r], row_start[r + 1]):
            if squared_chord(direction[p], direction[drawn]) <= limit:
                weight[p] = 0.0
            total += weight[p]
        row_weight[r] = total


@kernel
def _draw(direction, row_start, weight, u, radius, masking, drawn):
    """Fill `drawn` with pixels; how many there are once nothing is left to draw from."""
    height = len(row_start) - 1
    row_weight = np.zeros(height)
    for r in range(height):
        for p in range(row_start[r], row_start[r + 1]):
            row_weight[r] += weight[p]
    for k in range(len(u)):
        total = row_weight.sum()
        if not total > 0.0:
            return k
        row = _first_above(row_weight, 0, height, u[k, 0] * total)
        target = u[k, 1] * row_weight[row]
        drawn[k] = _first_above(weight, row_start[row], row_start[row + 1], target)
        if masking:
            angle = (row + 0.5) * math.pi / height
            _mask(direction, row_start, angle, radius, weight, row_weight, drawn[k])
    return len(u)


def draw(
    pixels: EmissivePixels, count: int, radius: float, masking: bool, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Entries of the list drawn by luminous flux, at most `count`; fewer once all are masked.

    radius : angle around a drawn pixel within which none is drawn again, if `masking`
    """
    drawn = np.empty(count, np.int64)
    found = _draw(pixels.direction, pixels.row_start, pixels.luminous_flux.copy(),
                  rng.random((count, 2)), radius, masking, drawn)  # fmt: skip
    return drawn[:found]


@kernel
def _tile_keys(pixel, row_start, side, key):
    height = len(row_start) - 1
    tiles_across = -(-2 * height // side)
    for r in range(height):
        for p in range(row_start[r], row_start[r + 1]):
            key[p] = (r // side) * tiles_across + (pixel[p] - r * 2 * height) // side


def tiles_of_pixels(pixels: EmissivePixels) -> Tiles:
    """The list's pixels in square tiles of the map."""
    key = np.empty(len(pixels.pixel), np.int64)
    _tile_keys(pixels.pixel, pixels.row_start, -(-pixels.height // TILE_ROWS), key)
    return tiles_of(pixels.direction, pixels.luminous_flux, key)


@kernel
def _move_inside(direction, label, centre, limit):
    """Put a centre without a pixel of its cluster within the chord² `limit` on the nearest one."""
    nearest, least = np.full(len(centre), NOBODY), np.full(len(centre), np.inf)
    for p in range(len(label)):
        k = label[p]
        distance = squared_chord(direction[p], centre[k])
        if distance < least[k]:
            nearest[k], least[k] = p, distance
    for k in range(len(centre)):
        if nearest[k] >= 0 and least[k] > limit:
            centre[k] = direction[nearest[k]]


@kernel
def _exclude(direction, label, centre, limit, kept):
    """Keep the pixels within the chord² `limit` of their centre."""
    for p in range(len(label)):
        kept[p] = squared_chord(direction[p], centre[label[p]]) <= limit


@kernel
def _sums(direction, luminous_flux, flux, label, kept, irradiance, moment, brightest):
    """Per cluster: the flux of its kept pixels, their moment and the brightest of them."""
    for p in range(len(label)):
        if kept[p]:
            k = label[p]
            for i in range(3):
                irradiance[k, i] += flux[p, i]
                moment[k, i] += luminous_flux[p] * direction[p, i]
            if brightest[k] < 0 or luminous_flux[p] > luminous_flux[brightest[k]]:
                brightest[k] = p


@kernel
def _angles(direction, solid_angle, label, kept, light, mean, largest):
    """Mean angle to the light, by solid angle, and the largest; a pixel is a disc, not a point."""
    weight = np.zeros(len(light))
    for p in range(len(label)):
        if kept[p]:
            k = label[p]
            angle = 2.0 * math.asin(
                min(1.0, 0.5 * math.sqrt(squared_chord(direction[p], light[k])))
            )
            inside = DISC_MEAN * math.sqrt(solid_angle[p])
            angle = math.sqrt(angle * angle + inside * inside)
            mean[k] += solid_angle[p] * angle
            weight[k] += solid_angle[p]
            largest[k] = max(largest[k], angle)
    for k in range(len(light)):
        if weight[k] > 0.0:
            mean[k] /= weight[k]


def _lights(
    pixels: EmissivePixels,
    label: NDArray[np.int64],
    kept: NDArray[np.bool_],
    count: int,
    light_extent: LightExtent,
    position: NDArray[np.float64] | None = None,
) -> DirectionalLights:
    """A light per cluster that has pixels, at `position` (count, 3) or at its energy centroid."""
    irradiance, moment = np.zeros((count, 3)), np.zeros((count, 3))
    brightest, mean, largest = np.full(count, NOBODY), np.zeros(count), np.zeros(count)
    scale = pixels.luminous_flux.max()
    _sums(pixels.direction, pixels.luminous_flux / scale, pixels.flux, label, kept, irradiance,
          moment, brightest)  # fmt: skip
    found = brightest >= 0
    if position is None:
        position = normalized(moment, pixels.direction[brightest])
        total = np.bincount(label[kept], pixels.luminous_flux[kept] / scale, count)
        cancelled = np.linalg.norm(moment, axis=1) <= CANCELLED * total
        position[cancelled] = pixels.direction[brightest[cancelled]]
    _angles(pixels.direction, pixels.solid_angle, label, kept, position, mean, largest)
    extent = extent_of(light_extent, lambda: mean, lambda: largest)
    return DirectionalLights(position[found], irradiance[found], extent[found])


def _drawn(
    pixels: EmissivePixels, drawn: NDArray[np.int64], light_extent: LightExtent
) -> DirectionalLights:
    """A light of equal flux at each drawn pixel, of the pixel's own extent."""
    irradiance = np.tile(pixels.flux.sum(axis=0) / len(drawn), (len(drawn), 1))
    size = np.sqrt(pixels.solid_angle[drawn])
    extent = extent_of(light_extent, lambda: DISC_MEAN * size, lambda: DISC_RIM * size)
    return DirectionalLights(pixels.direction[drawn], irradiance, extent)


def _clusters(
    pixels: EmissivePixels, tiles: Tiles, starts: list[NDArray[np.int64]], reach: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Centres (k, 3) and labels (n,) of the k-means that ends with the least Σ w min(d², reach²).

    starts : pixels to start from, for each search
    """
    found, least = [], np.empty(len(starts))
    for search, drawn in enumerate(starts):
        centre, label = kmeans(
            pixels.direction, pixels.luminous_flux, tiles, pixels.direction[drawn], reach
        )
        found.append((centre, label))
        if len(starts) > 1:
            square = ((pixels.direction - centre[np.maximum(label, 0)]) ** 2).sum(axis=1)
            square = np.where(label == OUTSIDE, reach**2, square)
            least[search] = pixels.luminous_flux @ square
    return found[int(np.argmin(least))] if len(starts) > 1 else found[0]


def env_directs(
    environment: EnvironmentMap,
    emissive: NDArray[np.bool_],
    count: int,
    radius: float,
    rng: np.random.Generator,
    *,
    masking: bool,
    refine: bool,
    exclusion: Exclusion,
    searches: int = 1,
    light_extent: LightExtent = LIGHT_EXTENT,
) -> EnvDirects:
    """At most `count` lights for the emissive pixels, fewer where they would coincide.

    emissive : (H, W), the pixels to stand for
    radius : angle of the neighbourhood Ω, see `masking_radius`
    masking, refine : the two steps that the paper's Table 2 leaves out, Ω and k-means
    searches : sets of draws from which k-means starts; the best is kept
    """
    if count == 0 or not emissive.any():
        return EnvDirects(DirectionalLights.none(), np.zeros_like(emissive))
    pixels = gather(environment, emissive)
    drawn = draw(pixels, count, radius, masking, rng)
    if not (refine or masking):
        return EnvDirects(_drawn(pixels, drawn, light_extent), emissive)
    tiles, kept = tiles_of_pixels(pixels), np.ones(len(pixels.pixel), np.bool_)
    if not refine:
        centre = pixels.direction[drawn]
        label = nearest_centre(pixels.direction, tiles, centre)
        lights = _lights(pixels, label, kept, len(centre), light_extent, centre)
        return EnvDirects(lights, emissive)
    reach = 2.0 * math.sin(min(radius, 0.5 * math.pi))
    more = (draw(pixels, count, radius, masking, rng) for _ in range(searches - 1))
    centre, label = _clusters(
        pixels, tiles, [drawn, *more], reach if exclusion == "each-round" else math.inf
    )
    if exclusion == "each-round":
        label = nearest_centre(pixels.direction, tiles, centre)
    if exclusion != "none":
        within = 2.0 * math.sin(0.5 * min(radius, math.pi))
        _move_inside(pixels.direction, label, centre, within * within)
        _exclude(pixels.direction, label, centre, reach * reach, kept)
    lights = _lights(pixels, label, kept, len(centre), light_extent)
    kept_map = emissive.copy()
    kept_map.ravel()[pixels.pixel[~kept]] = False
    return EnvDirects(lights, kept_map)
