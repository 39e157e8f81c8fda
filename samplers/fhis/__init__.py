"""Fast hierarchical importance sampling: points of a Penrose tiling, thresholded by importance.

The plane of the latitude-longitude map is covered by a hierarchical Penrose tiling whose points
carry evenly spread numbers. A point is accepted where its number lies below the importance there,
so the density of accepted points follows the importance; each is then moved a little by a table of
corrections, made beforehand by relaxation, so that the points keep their distance from each other.
Every point is a light.

Source: Ostromoukhov, Donohue, Jodoin, "Fast hierarchical importance sampling with blue noise
properties", ACM Transactions on Graphics 23(3), 2004. Importance is luminance × cos(latitude). The
paper fixes the scale of the importance and lets the number of points follow; here all candidates
are sorted by number / importance and the first `count` taken, which meets any count without a
search. Points that leave the map come back over the seam or the pole.

Built per map: a pyramid of maxima of the importance, O(pixels); then the cost is about linear in
the count. Deterministic. The lights are a fixed quadrature: noise-free and biased.

Parameters
    color : where a light's colour comes from; the paper does not say. "voronoi" (default) gives a
        light all radiance that is nearer to it than to any other light; the sum is exact in every
        channel. Where several lights crowd into a pixel, as on a sun, those whose cell holds no
        pixel's centre share that pixel equally with its owner. "point" is importance sampling
        proper: the chromaticity at the accepted pixel and an equal share of the map's luminous
        flux, so that each channel is right only on average. Measured on 12 photographed maps and
        two scenes, RMSE / FLIP: with 16 lights .151 / .159 for voronoi, .203 / .250 for point; on
        six of the maps with 64 lights .032 / .073 and .054 / .128.
    correct : move the points by the correction table; False leaves the raw tiling.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.fhis.max_pyramid import MaxPyramid, max_pyramid
from samplers.fhis.penrose import PHI, POINTS_PER_INTEGRAL, Births, births
from samplers.fhis.penrose_correction import anchors, correction_table, displacement
from samplers.grids.nearest_light import nearest_light_cells
from samplers.lighting import DirectionalLights
from samplers.sphere import (
    direction_from_uv,
    pixel_direction,
    pixel_of_direction,
    row_solid_angle,
)

CELL_ROWS = 128
"""Rows of the grid on which the extents of the cells are measured, at least."""
HEXAGON_MEAN = (1.0 / 3.0 + math.log(3.0) / 4.0) / math.sqrt(3.0)
"""Mean distance from a hexagon's centre, for hexagons whose centres are one apart."""


@dataclass(frozen=True, eq=False)
class ImportancePoints:
    """pixel : (n, 2) row and column of acceptance; direction : (n, 3) after displacement."""

    pixel: NDArray[np.int64]
    direction: NDArray[np.float64]


def _first_births(
    importance: MaxPyramid, total: float, count: int, corner: tuple[float, float], side: float
) -> tuple[Births, NDArray[np.int64], NDArray[np.float64]]:
    """Candidates, the `count` first of them by code / importance, and their ratios."""
    expected = count * side**2 / (POINTS_PER_INTEGRAL * total)
    scale = expected * (1.15 + 8.0 / math.sqrt(count))
    born = births(importance, scale, corner, side)
    while len(born.code) < count:
        scale *= 2.0
        born = births(importance, scale, corner, side)
    ratio = born.code / born.importance
    first = np.lexsort((born.code, ratio))[:count]
    return born, first, ratio[first]


def importance_points(
    environment: EnvironmentMap, count: int, correction: NDArray[np.float64]
) -> ImportancePoints | None:
    """Exactly `count` points with the density of luminance × solid angle; None for a black map."""
    importance = max_pyramid(environment.luminance, environment.row_solid_angle)
    if not importance.largest > 0.0:
        return None
    height, width = environment.height, environment.width
    side = 2.0 * width
    corner = (-side * (0.5 * PHI**2 - 0.25), -side / 8.0)
    born, first, ratio = _first_births(importance, environment.luminous_flux, count, corner, side)
    chosen = Births(
        born.position[first], born.direction[first], born.level[first],
        born.code[first], born.newest[first], born.importance[first],
    )  # fmt: skip
    anchor = anchors(chosen, ratio[-1] * chosen.importance, side)
    u, v = ((chosen.position + displacement(anchor, correction)) / (width, height)).T
    # A negative polar angle, or one beyond π, is the point across the pole.
    return ImportancePoints(
        np.floor(chosen.position[:, ::-1]).astype(np.int64), direction_from_uv(u, v)
    )


def _with_measured_extents(
    direction: NDArray[np.float64], irradiance: NDArray[np.float64], mean_angle: NDArray[np.float64]
) -> DirectionalLights:
    """The lights; those whose cell is too small for the grid get a hexagon's mean angle."""
    missing = np.isnan(mean_angle)
    if missing.any():
        from scipy.spatial import cKDTree

        chord = cKDTree(direction).query(direction[missing], k=2)[0][:, 1]
        mean_angle = mean_angle.copy()
        mean_angle[missing] = HEXAGON_MEAN * 2.0 * np.arcsin(0.5 * chord)
    return DirectionalLights(direction, irradiance, mean_angle)


def _share_pixels(
    environment: EnvironmentMap,
    repeat: int,
    direction: NDArray[np.float64],
    flux: NDArray[np.float64],
) -> None:
    """Give lights without flux (n, 3) an equal share of the pixel that they lie in.

    repeat : pixels are those of the map, each cut into `repeat` × `repeat`
    """
    (without,) = np.nonzero(~flux.any(axis=1))
    if not len(without) or len(without) == len(flux):
        return
    from scipy.spatial import cKDTree

    height = environment.height * repeat
    (lit,) = np.nonzero(flux.any(axis=1))
    pixel, member, count = np.unique(
        np.stack(pixel_of_direction(direction[without], height), axis=1),
        axis=0, return_inverse=True, return_counts=True,
    )  # fmt: skip
    row, column = pixel.T
    owner = lit[cKDTree(direction[lit]).query(pixel_direction(row, column, height))[1]]
    solid_angle = row_solid_angle(height, 2 * height)[row]
    radiance = environment.radiance[row // repeat, column // repeat]
    share = radiance * (solid_angle / (count + 1.0))[:, None]
    for k, light in enumerate(owner):
        left = flux[light] - count[k] * share[k]
        if (left < 0.0).any():  # a light at the same distance owns the pixel
            share[k] = 0.0
        else:
            flux[light] = left
    flux[without] = share[member.reshape(-1)]


@register("fhis")
@dataclass(frozen=True)
class HierarchicalImportance(LightSampler):
    """Penrose tiling thresholded by importance (FHIS)."""

    color: Literal["voronoi", "point"] = "voronoi"
    correct: bool = True

    def __post_init__(self) -> None:
        if self.color not in ("point", "voronoi"):
            raise EnvlightError(f"fhis: color is 'point' or 'voronoi', not {self.color!r}")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        table = correction_table() if self.correct else np.zeros_like(correction_table())
        points = importance_points(environment, count, table)
        if points is None:
            return DirectionalLights.none()
        direction = points.direction
        if self.color == "voronoi":
            repeat = -(-CELL_ROWS // environment.height)
            _, angle, flux = nearest_light_cells(direction, environment.radiance, repeat)
            _share_pixels(environment, repeat, direction, flux)
            lit = flux.any(axis=1)
            return _with_measured_extents(direction[lit], flux[lit], angle[lit])
        unlit = np.zeros((1, 2, 3), np.float32)
        _, angle, _ = nearest_light_cells(direction, unlit, CELL_ROWS)
        row, column = points.pixel.T
        color = environment.radiance[row, column].astype(np.float64)
        share = environment.luminous_flux / count
        irradiance = color * (share / (color @ LUMINANCE_WEIGHTS))[:, None]
        return _with_measured_extents(direction, irradiance, angle)
