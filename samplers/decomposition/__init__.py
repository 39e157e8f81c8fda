"""Decomposition: bright pixels and the rest of a map get lights of their own ("Ours" of the paper).

Emissive pixels cast the sharp shadows and highlights, so a few lights are put exactly on them
(EnvDirects: masked importance sampling, then k-means). What remains is smooth, so its lights are
spread evenly (EnvIndirects: a modified illumination cut), shaded in a smaller image and upsampled.

Source: Wu, "Efficient environment map rendering based on decomposition", Computer Graphics Forum
44(1), 2025. The stages are functions of their own: `classify` and `budget` (section 3.2, Eq. 1 and
2), `env_directs` (3.3) and `env_indirects` (3.4, Eq. 3); their modules say what they leave open.

Cost: six passes over the map, besides what depends on the emissive pixels and the number of
lights. Stochastic by the draws of EnvDirects alone; biased as every fixed set of lights is. The
lights carry the map's energy exactly. There are fewer than asked where the map has fewer pixels or
cells with energy; a light that EnvDirects cannot place goes to EnvIndirects.

"ours-no-upsampling" is the same with the low-frequency layer at full resolution. It still returns
two layers, so that the two sets of lights can be told apart.

Parameters
    masking, kmeans : the steps of EnvDirects that the paper's Table 2 switches off
    radius_unit : the size s·4π/K of the masked neighbourhood is a "solid_angle" (default, by its
        unit) or an angle in "radians" (the text calls it a distance)
    exclusion : emissive pixels far from every light go back to the other region once k-means has
        "converged", in "each-round" of it, or never: "none"
    searches : sets of draws that k-means starts from, of which the best is kept: 1 (default);
        LightGen takes 5
    variance_weight, extent_weight, energy_weight : w_V, w_D and w_E of Eq. 3, 1, 5 and 1; with 1,
        0 and 0 it is the original illumination cut
    tree_axis, tree_median, variance, extent : the light tree and what its nodes are measured by, as
        in `CutRule`
    light_extent : "mean", "largest" or "full", the "directional extent" of section 3.5, by which
        interleaved sampling perturbs a light, and of Eq. 3; the same for all samplers
        (`samplers.lighting`)
    sets : "perturbed" (default) or "independent", eight sets of its own
        (`samplers.independent_sets`)
    upsampling : 4 (default; the paper names no factor), 2, 8, or 1 for none
    guides : of upsampling, the mean over a "pixel" (default) or those of each "subpixel"

Every choice that the paper leaves open is measured by the experiment `readings`.
"""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.decomposition.emissive import budget, classify
from samplers.decomposition.env_directs import Exclusion, Unit, env_directs, masking_radius
from samplers.decomposition.illumination_cut import (
    Axis,
    CutRule,
    Extent,
    Median,
    Variance,
    env_indirects,
)
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LayeredLights, LightExtent, Sets
from samplers.reference import Reference


@dataclass(frozen=True, eq=False)
class Decomposed:
    """A map's lights, and which of its pixels each layer stands for.

    emissive : (H, W) bool, the pixels that section 3.2 calls emissive
    carried : (H, W) bool, those that EnvDirects carries; EnvIndirects carries all others, the
        emissive ones that were given back among them
    """

    lights: LayeredLights
    emissive: NDArray[np.bool_]
    carried: NDArray[np.bool_]


@register("ours")
@dataclass(frozen=True)
class Decomposition(LightSampler):
    """EnvDirects and EnvIndirects, the latter upsampled from a smaller image."""

    label: ClassVar[str] = "Ours (Wu 2025)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Yu-Ting Wu",
            "Efficient environment map rendering based on decomposition",
            "Computer Graphics Forum",
            2025,
            kind="article",
            volume="44(1)",
            doi="10.1111/cgf.15264",
        ),
    )
    stochastic: ClassVar[bool] = True

    masking: bool = True
    kmeans: bool = True
    radius_unit: Unit = "solid_angle"
    exclusion: Exclusion = "converged"
    searches: int = 1
    variance_weight: float = field(
        default=1.0, metadata={"fixed": "only the ratios of the three weights matter"}
    )
    extent_weight: float = 5.0
    energy_weight: float = 1.0
    tree_axis: Axis = "principal"
    tree_median: Median = "solid_angle"
    variance: Variance = "sum"
    extent: Extent = "angle"
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"
    upsampling: Literal[1, 2, 4, 8] = 4
    guides: Literal["pixel", "subpixel"] = "pixel"

    readings = (
        Reading("draws mask their neighbourhood", {"masking": True}),
        Reading("no masking", {"masking": False}, "its paper masks the neighbourhood of a draw"),
        Reading("k-means", {"kmeans": True}),
        Reading("no k-means", {"kmeans": False}, "its paper moves the lights by k-means"),
        Reading("neighbourhood s·4π/K in radians", {"radius_unit": "radians"}),
        Reading("neighbourhood s·4π/K as a solid angle", {"radius_unit": "solid_angle"}),
        Reading("far emissive pixels given back after k-means", {"exclusion": "converged"}),
        Reading("far emissive pixels given back in each round", {"exclusion": "each-round"}),
        Reading("far emissive pixels kept", {"exclusion": "none"}),
        Reading("one search by k-means", {"searches": 1}),
        Reading(
            "best of five searches by k-means",
            {"searches": 5},
            "its paper has one search; more of them take time",
        ),
        Reading(
            "the original illumination cut",
            {"extent_weight": 0.0, "energy_weight": 0.0},
            "its paper replaces it by the modified cut",
        ),
        Reading("light tree cut along the box's longer side", {"tree_axis": "box"}),
        Reading("light tree cut along the principal axis", {"tree_axis": "principal"}),
        Reading("light tree cut at half of the solid angle", {"tree_median": "solid_angle"}),
        Reading("light tree cut at half of the energy", {"tree_median": "energy"}),
        Reading("variance of a node as a sum", {"variance": "sum"}),
        Reading("variance of a node as a mean", {"variance": "mean"}),
        Reading("extent of a node by its angle", {"extent": "angle"}),
        Reading("extent of a node by its solid angle", {"extent": "solid_angle"}),
        Reading("second layer upsampled by 2", {"upsampling": 2}),
        Reading("second layer upsampled by 4", {"upsampling": 4}),
        Reading("second layer upsampled by 8", {"upsampling": 8}),
        Reading(
            "second layer not upsampled",
            {"upsampling": 1},
            "its paper upsamples; this is the sampler `ours-no-upsampling`",
        ),
        Reading("upsampled by the mean guides of a pixel", {"guides": "pixel"}),
        Reading("upsampled by the guides of every sub-pixel", {"guides": "subpixel"}),
    )
    costly = ("upsampling", "guides")

    def __post_init__(self) -> None:
        self.cut_rule()
        if self.searches < 1:
            raise EnvlightError(f"{self.name}: searches is {self.searches}; use at least 1")

    def cut_rule(self) -> CutRule:
        """What `env_indirects` needs of the parameters; EnvlightError for bad weights."""
        return CutRule(
            variance_weight=self.variance_weight,
            extent_weight=self.extent_weight,
            energy_weight=self.energy_weight,
            axis=self.tree_axis,
            median=self.tree_median,
            variance=self.variance,
            extent=self.extent,
            light_extent=self.light_extent,
        )

    def decompose(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> Decomposed:
        """The lights that `prepare` returns, with the pixels that they stand for."""
        if environment.is_black:
            none = DirectionalLights.none()
            nowhere = np.zeros(environment.luminance.shape, np.bool_)
            return Decomposed(
                LayeredLights(none, none, self.upsampling, self.guides), nowhere, nowhere
            )
        regions = classify(environment)
        direct, indirect = budget(regions, count)
        directs = env_directs(
            environment,
            regions.emissive,
            direct,
            masking_radius(count, self.radius_unit),
            rng,
            masking=self.masking,
            refine=self.kmeans,
            # What is given back needs a light to go to.
            exclusion=self.exclusion if indirect > 0 else "none",
            searches=self.searches,
            light_extent=self.light_extent,
        )
        rule = self.cut_rule()
        rest = env_indirects(environment, directs.kept, count - len(directs.lights), rule)
        lights = LayeredLights(directs.lights, rest, self.upsampling, self.guides)
        return Decomposed(lights, regions.emissive, directs.kept)

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LayeredLights:
        return self.decompose(environment, count, rng).lights


@register("ours-no-upsampling")
@dataclass(frozen=True)
class FullResolutionDecomposition(Decomposition):
    """The same lights, both layers at full resolution ("Ours (w/o U)" of the paper)."""

    label: ClassVar[str] = "Ours w/o U (Wu 2025)"

    upsampling: Literal[1, 2, 4, 8] = 1
