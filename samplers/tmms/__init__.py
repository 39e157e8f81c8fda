"""Tone-mapped mean shift: regions of irregular shape from segmentation, one light each (TMMS).

The map is tone mapped and segmented by mean shift. One fixed bandwidth after tone mapping acts as
one that adapts to the brightness of the map itself. Segments are then split and merged by their
importance until there are as many as lights are wanted; each gives a light at its energy centroid
with its integral of radiance, taken at full resolution.

Source: Feng, Yang, Wan and Yu, "Tone-mapped mean-shift based environment map sampling", IEEE
Transactions on Visualization and Computer Graphics 22(9), 2016. The paper's constants were not at
hand: its scheme is as published, its numbers are this project's and stand as parameters, and so is
`widest`.

Segmentation works on at most 256 × 128 cells, each the exact sum of its pixels, so that its cost
does not grow with the map: cells × steps of a climb × cells in a ball. Splitting is O(n log n) in
cells, merging O(n log n) in segments. Deterministic and biased as every fixed set of lights is;
the lights carry the map's energy exactly, and there are fewer only where fewer cells have energy.

Parameters
    tone : "photographic" (default), Y_d = Y_m / (1 + Y_m) with Y_m = 0.18 · Y over the logarithmic
        average, displayed with a gamma of 2.2; or "log". Either runs from 0 to 100.
    spatial_bandwidth : 0.3 rad, range_bandwidth : 6.5 units of tone
    mode_reach : cells that touch are one segment if their modes lie within this share (0.1) of
        the bandwidths
    split_ratio : regions more important than 2 times the average are split
    useful_solid_angle : in sr, the largest that importance counts, 0.01 in structured importance
        sampling, from which the importance comes. None (default) counts all of it, as Wu 2025 and
        Wan et al. 2005 print it.
    widest : regions are cut, and not merged, where a light in their middle would give a plane that
        faces it 2.5 (default) times as much too much as it does for an even cap of their size. On
        a smooth map, where importance has nothing against rings, their middles would be dark. Where
        that does not help, regions are merged by what is too much alone. None for no such limit.
    light_extent : how far a light's cluster reaches, by which interleaved sampling perturbs it:
        "mean", "largest" or "full", the same for all samplers (`samplers.lighting`)
    sets : "perturbed" (default) or "independent", eight sets of its own
        (`samplers.independent_sets`)

`experiments.questions.readings` compares them.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.light_leaves import lights_of_leaves
from samplers.grids.reduced_map import ReducedMap, reduce_map
from samplers.grids.sphere_grid import linked
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.reference import Reference
from samplers.tmms.mean_shift import groups_of, mean_of_groups, modes
from samplers.tmms.region_merging import merge_regions, split_regions

LEAST_LUMINANCE = 1e-6
"""Of the average; added before a logarithm, so that black has one."""
DISPLAY_GAMMA = 2.2
TONE_RANGE = 100.0
KEY = 0.18
"""What the photographic operator makes of the logarithmic average: its usual middle grey."""
ROWS = 128
"""Rows of the grid that is segmented, at most."""


def tone_mapped(grid: ReducedMap, operator: Literal["photographic", "log"]) -> NDArray[np.float64]:
    """Displayed brightness (h, 2h) of the cells, 0 to 100, whatever the map's own brightness.

    Cells that mean shift takes together near the poles are given their common brightness.
    """
    average = grid.luminous_flux.sum() / grid.solid_angle.sum()
    luminance = grid.luminous_flux / grid.solid_angle / average
    luminance = mean_of_groups(luminance.reshape(grid.height, 2 * grid.height))
    logarithm = np.log(luminance + LEAST_LUMINANCE)
    if operator == "log":
        low, high = logarithm.min(), logarithm.max()
        return TONE_RANGE * (logarithm - low) / max(high - low, 1.0)
    mean = math.exp(np.average(logarithm.ravel(), weights=grid.solid_angle))
    scaled = KEY * luminance / mean
    return TONE_RANGE * (scaled / (1.0 + scaled)) ** (1.0 / DISPLAY_GAMMA)


def segments(
    tone: NDArray[np.float64], spatial_bandwidth: float, range_bandwidth: float, mode_reach: float
) -> NDArray[np.int64]:
    """Labels (n,) of the connected sets of cells of a grid (h, 2h) that climb to one mode."""
    chord = 2.0 * math.sin(0.5 * min(spatial_bandwidth, math.pi))
    mode = modes(groups_of(tone, chord, range_bandwidth))
    return linked(mode.reshape(-1, 4), mode_reach, len(tone))


@register("tmms")
@dataclass(frozen=True)
class ToneMappedMeanShift(LightSampler):
    """One light for each of the regions that segmentation, splitting and merging leave."""

    label: ClassVar[str] = "TMMS (Feng 2016)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Wei Feng, Ying Yang, Liang Wan, Changguo Yu",
            "Tone-mapped mean-shift based environment map sampling",
            "IEEE Transactions on Visualization and Computer Graphics",
            2016,
            kind="article",
            volume="22(9)",
            doi="10.1109/TVCG.2015.2500236",
        ),
    )

    tone: Literal["photographic", "log"] = "photographic"
    spatial_bandwidth: float = 0.3
    range_bandwidth: float = 6.5
    mode_reach: float = 0.1
    split_ratio: float = 2.0
    useful_solid_angle: float | None = None
    widest: float | None = 2.5
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("photographic tone mapping", {"tone": "photographic"}),
        Reading("logarithmic tone mapping", {"tone": "log"}),
        Reading("spatial bandwidth 0.3", {"spatial_bandwidth": 0.3}),
        Reading("spatial bandwidth 0.15", {"spatial_bandwidth": 0.15}),
        Reading("spatial bandwidth 0.4", {"spatial_bandwidth": 0.4}),
        Reading("range bandwidth 6.5", {"range_bandwidth": 6.5}),
        Reading("range bandwidth 3", {"range_bandwidth": 3.0}),
        Reading("modes within 0.1 bandwidths", {"mode_reach": 0.1}),
        Reading("modes within 0.5 bandwidths", {"mode_reach": 0.5}),
        Reading(
            "modes within 0.5 of half the spatial bandwidth",
            {"mode_reach": 0.5, "spatial_bandwidth": 0.15},
        ),
        Reading("split above 2 times the average", {"split_ratio": 2.0}),
        Reading("split above the average", {"split_ratio": 1.0}),
        Reading("split above 4 times the average", {"split_ratio": 4.0}),
        Reading("all solid angle counts", {"useful_solid_angle": None}),
        Reading("solid angle counts up to 0.01 sr", {"useful_solid_angle": 0.01}),
        Reading("no region wider than 2.5 caps", {"widest": 2.5}),
        Reading("no region wider than 4 caps", {"widest": 4.0}),
        Reading("regions of any shape", {"widest": None}),
    )

    def __post_init__(self) -> None:
        if self.tone not in ("photographic", "log"):
            raise EnvlightError(f"{self.name}: tone is 'photographic' or 'log'")
        positive = ("spatial_bandwidth", "range_bandwidth", "split_ratio", "useful_solid_angle")
        for name in (*positive, "widest"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise EnvlightError(f"{self.name}: {name} is {value}; it must be positive")
        if not self.mode_reach >= 0.0:
            raise EnvlightError(f"{self.name}: mode_reach is {self.mode_reach}; use 0 or more")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        grid = reduce_map(environment, ROWS)
        flux = grid.luminous_flux / grid.luminous_flux.sum()
        tone = tone_mapped(grid, self.tone)
        label = segments(tone, self.spatial_bandwidth, self.range_bandwidth, self.mode_reach)
        useful = self.useful_solid_angle
        widest = math.inf if self.widest is None else self.widest
        label = split_regions(label, grid, flux, count, self.split_ratio, useful, widest)
        label = merge_regions(label, grid, flux, count, useful, widest)
        leaves, lit = grid.leaves()
        label = np.unique(label[lit], return_inverse=True)[1]
        return lights_of_leaves(leaves, label, self.light_extent)
