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
    spread : s = 0.15 of the masked neighbourhood, of size s·4π/K
    radius_unit : "radians" (default: the text calls it a distance) or "solid_angle"
    exclusion : give emissive pixels far from every light back to the other region
    percentile_weight : the 98th percentile counts "pixels" (default, as written) or "solid_angle"
    clamp_solid_angle : Eq. 2 with the solid angle limited to 0.01 sr, as where its metric comes
        from; off, as the paper leaves the limit out
    variance_weight, extent_weight, energy_weight : w_V, w_D and w_E of Eq. 3, 1, 5 and 1; with 1,
        0 and 0 it is the original illumination cut
    leaf_side, tree_axis, tree_median, variance, extent : the light tree and what its nodes are
        measured by, as in `CutRule`
    rounds : limit to the rounds of k-means, which ends by itself long before
    upsampling : 2 (default; the paper names no factor), 4, or 1 for none

Measured by rendering 12 photographed maps on two scenes with 16 lights, RMSE / FLIP: the default
.038 / .112, upsampled by 4 .042 / .122, not at all .036 / .108. Without upsampling, the radius as a
solid angle .035 / .103, no exclusion .036 / .105, principal axis .045 / .108, the limit in Eq. 2
.040 / .123, the percentile by solid angle .036 / .108. With it, the original cut .046 / .138, and
Table 2's ablations: draws alone .043 / .122, with masking .041 / .114, with k-means .039 / .116.
The paper's wording stays the default where the difference is a few per cent.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from samplers.base import LightSampler, register
from samplers.decomposition.emissive import budget, classify
from samplers.decomposition.env_directs import env_directs, masking_radius
from samplers.decomposition.illumination_cut import CutRule, env_indirects
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import DirectionalLights, LayeredLights


@register("ours")
@dataclass(frozen=True)
class Decomposition(LightSampler):
    """EnvDirects and EnvIndirects, the latter upsampled from a smaller image."""

    stochastic: ClassVar[bool] = True

    masking: bool = True
    kmeans: bool = True
    spread: float = 0.15
    radius_unit: Literal["radians", "solid_angle"] = "radians"
    exclusion: bool = True
    percentile_weight: Literal["pixels", "solid_angle"] = "pixels"
    clamp_solid_angle: bool = False
    variance_weight: float = 1.0
    extent_weight: float = 5.0
    energy_weight: float = 1.0
    leaf_side: int = 32
    tree_axis: Literal["box", "principal"] = "box"
    tree_median: Literal["solid_angle", "count", "energy"] = "solid_angle"
    variance: Literal["sum", "mean"] = "sum"
    extent: Literal["cone", "solid_angle"] = "cone"
    rounds: int = 1000
    upsampling: Literal[1, 2, 4] = 2

    def __post_init__(self) -> None:
        if self.radius_unit not in ("radians", "solid_angle"):
            raise EnvlightError(f"{self.name}: radius_unit is 'radians' or 'solid_angle'")
        if self.percentile_weight not in ("pixels", "solid_angle"):
            raise EnvlightError(f"{self.name}: percentile_weight is 'pixels' or 'solid_angle'")
        if not self.spread >= 0.0 or self.rounds < 0:
            raise EnvlightError(f"{self.name}: spread and rounds must not be negative")
        self.cut_rule()

    def cut_rule(self) -> CutRule:
        """What `env_indirects` needs of the parameters; EnvlightError for unknown options."""
        return CutRule(
            variance_weight=self.variance_weight,
            extent_weight=self.extent_weight,
            energy_weight=self.energy_weight,
            side=self.leaf_side,
            axis=self.tree_axis,
            median=self.tree_median,
            variance=self.variance,
            extent=self.extent,
        )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LayeredLights:
        if environment.is_black:
            none = DirectionalLights.none()
            return LayeredLights(none, none, self.upsampling)
        regions = classify(environment, self.percentile_weight)
        direct, indirect = budget(regions, count, self.clamp_solid_angle)
        directs = env_directs(
            environment,
            regions.emissive,
            direct,
            masking_radius(self.spread, count, self.radius_unit),
            rng,
            masking=self.masking,
            refine=self.kmeans,
            # What is given back needs a light to go to.
            exclude=self.exclusion and indirect > 0,
            rounds=self.rounds,
        )
        rule = self.cut_rule()
        rest = env_indirects(environment, directs.kept, count - len(directs.lights), rule)
        return LayeredLights(directs.lights, rest, self.upsampling)


@register("ours-no-upsampling")
@dataclass(frozen=True)
class FullResolutionDecomposition(Decomposition):
    """The same lights, both layers at full resolution ("Ours (w/o U)" of the paper)."""

    upsampling: Literal[1, 2, 4] = 1
