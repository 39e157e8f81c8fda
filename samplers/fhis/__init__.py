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

Which part of the tiling lies over the map is a matter of chance: the seed draws the shift.

Built per map: a pyramid of maxima of the importance, O(pixels); then, for each set, the cost is
about linear in the count, and one pass over the map sums up the cells. Each set of lights is a
fixed quadrature: noise-free and biased.

Parameters
    light : what a point becomes; the paper does not say. "centroid" (default) is a light with all
        radiance that is nearer to the point than to any other, at the energy centroid of that cell,
        so that the sum is exact in every channel; "cell" has the same radiance and stands at the
        point. Where several points crowd into a pixel, as on a sun, those whose cell holds no
        pixel's centre share that pixel equally with its owner. "point" is importance sampling
        proper: the chromaticity at the accepted pixel and an equal share of the map's luminous
        flux, at the point, so that each channel is right only on average.
    sets : interleaved sampling uses one shift of the tiling, whose lights the renderer has
        "perturbed" (default) as it has those of other methods, or eight "shifted" tilings.
    correct : move the points by the correction table; False leaves the raw tiling.
    light_extent : how far a light's cluster reaches, by which interleaved sampling perturbs it:
        "mean", "largest" or "full", the same for all samplers (`samplers.lighting`)

`experiments.questions.readings` compares them.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.fhis.max_pyramid import MaxPyramid, max_pyramid
from samplers.fhis.penrose import POINTS_PER_INTEGRAL, Births, births
from samplers.fhis.penrose_correction import anchors, correction_table, displacement
from samplers.grids.nearest_light import nearest_light_cells
from samplers.lighting import LIGHT_EXTENT, SETS, DirectionalLights, LightExtent, extent_of
from samplers.reference import Reference
from samplers.sphere import (
    centroid,
    direction_from_uv,
    pixel_direction,
    pixel_of_direction,
    row_solid_angle,
)

CELL_ROWS = 128
"""Rows of the grid on which the extents of the cells are measured, at least."""
HEXAGON_MEAN = (1.0 / 3.0 + math.log(3.0) / 4.0) / math.sqrt(3.0)
"""Mean distance from a hexagon's centre to its points, for hexagons whose centres are one apart."""
HEXAGON_RIM = 1.0 / math.sqrt(3.0)
"""Distance to its corners."""
SIDE = 8.0
"""Side s₀ of the root triangle, in widths of the map: its long side is φ²s₀, its height .95 s₀."""
NEAREST, REACH = (0.6, 1.0 / 16.0), (1.25, 0.25)
"""The map's corner, from the root's in sides s₀: where shifts begin, and how far they go. The map,
⅛ × 1/16 of a side, stays within the root: up to 3/8 above its long side, which leaves it 0.52 to
2.10 along that side."""


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
    environment: EnvironmentMap,
    importance: MaxPyramid,
    count: int,
    correction: NDArray[np.float64],
    shift: tuple[float, float],
) -> ImportancePoints:
    """Exactly `count` points with the density of luminance × solid angle.

    importance : of luminance × solid angle, not zero everywhere
    shift : of the tiling, each of the two numbers in [0, 1)
    """
    height, width = environment.height, environment.width
    side = SIDE * width
    corner = (
        -side * (NEAREST[0] + REACH[0] * shift[0]),
        -side * (NEAREST[1] + REACH[1] * shift[1]),
    )
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


def _filled(
    angle: NDArray[np.float64], direction: NDArray[np.float64], which: LightExtent
) -> NDArray[np.float64]:
    """The extents (n,); a hexagon's where a cell is too small for the grid (NaN)."""
    missing = np.isnan(angle)
    if not missing.any():
        return angle
    from scipy.spatial import cKDTree

    chord = cKDTree(direction).query(direction[missing], k=2)[0][:, 1]
    angle = angle.copy()
    apart = 2.0 * np.arcsin(0.5 * chord)
    angle[missing] = extent_of(which, lambda: HEXAGON_MEAN * apart, lambda: HEXAGON_RIM * apart)
    return angle


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

    label: ClassVar[str] = "FHIS (Ostromoukhov 2004)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Victor Ostromoukhov, Charles Donohue, Pierre-Marc Jodoin",
            "Fast hierarchical importance sampling with blue noise properties",
            "ACM Transactions on Graphics",
            2004,
            kind="article",
            volume="23(3)",
            doi="10.1145/1015706.1015750",
        ),
    )
    stochastic: ClassVar[bool] = True

    light: Literal["centroid", "cell", "point"] = "centroid"
    sets: Literal["perturbed", "shifted"] = "perturbed"
    correct: bool = True
    light_extent: LightExtent = LIGHT_EXTENT

    readings = (
        Reading("lights at the centroids of cells", {"light": "centroid"}),
        Reading("lights of cells at the points", {"light": "cell"}),
        Reading("equal lights at the points", {"light": "point"}),
        Reading("one tiling, perturbed", {"sets": "perturbed"}),
        Reading(
            "eight shifts of the tiling",
            {"sets": "shifted"},
            "no sampler has sets of its own where its rivals are perturbed",
        ),
        Reading("points corrected", {"correct": True}),
        Reading(
            "raw tiling", {"correct": False}, "its paper moves the points by the correction vectors"
        ),
    )
    costly = ("sets",)

    def __post_init__(self) -> None:
        if self.light not in ("centroid", "cell", "point"):
            raise EnvlightError(f"fhis: light is 'centroid', 'cell' or 'point', not {self.light!r}")
        if self.sets not in ("perturbed", "shifted"):
            raise EnvlightError(f"fhis: sets are 'perturbed' or 'shifted', not {self.sets!r}")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        importance = max_pyramid(environment.luminance, environment.row_solid_angle)
        if not importance.largest > 0.0:
            return DirectionalLights.none()
        table = correction_table() if self.correct else np.zeros_like(correction_table())
        lights_of = self._points if self.light == "point" else self._cells
        shifts = rng.random((SETS if self.sets == "shifted" else 1, 2)).tolist()
        first, *further = (
            lights_of(environment, importance_points(environment, importance, count, table, shift))
            for shift in shifts
        )
        return replace(first, further_sets=tuple(further))

    def _cells(self, environment: EnvironmentMap, points: ImportancePoints) -> DirectionalLights:
        """Lights with the energy of their cells."""
        direction = points.direction
        repeat = -(-CELL_ROWS // environment.height)
        cells = nearest_light_cells(direction, environment.radiance, repeat)
        if self.light == "centroid":
            direction = centroid(cells.moment, cells.flux @ LUMINANCE_WEIGHTS, direction)
        flux = cells.flux.copy()
        _share_pixels(environment, repeat, points.direction, flux)
        angle = cells.angle(direction, self.light_extent)
        lit = flux.any(axis=1)
        direction, angle = direction[lit], angle[lit]
        extent = _filled(angle, direction, self.light_extent)
        return DirectionalLights(direction, flux[lit], extent)

    def _points(self, environment: EnvironmentMap, points: ImportancePoints) -> DirectionalLights:
        """Lights with equal shares of the luminous flux, coloured by the pixels below them."""
        direction = points.direction
        unlit = np.zeros((1, 2, 3), np.float32)
        angle = nearest_light_cells(direction, unlit, CELL_ROWS).angle(direction, self.light_extent)
        row, column = points.pixel.T
        color = environment.radiance[row, column].astype(np.float64)
        share = environment.luminous_flux / len(direction)
        irradiance = color * (share / (color @ LUMINANCE_WEIGHTS))[:, None]
        extent = _filled(angle, direction, self.light_extent)
        return DirectionalLights(direction, irradiance, extent)
