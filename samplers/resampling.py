"""Resampled importance sampling: many cheap candidates, and a ray only for the one that matters.

Candidates come from two tables that know half of the integrand each: the map's luminance and the
surface's BRDF. Each is judged by its target, the luminance of L · f_r · cos, all that can be known
without a ray. One of them survives, drawn in proportion to target over density, and it alone is
traced. The more candidates, the nearer the survivor comes to the product of light and reflectance;
visibility is left to the ray.

    w_j = target(ω_j) / (m p_map(ω_j) + n p_BRDF(ω_j))          m + n candidates
    W   = Σ_j w_j / target(ω)                                    for the survivor ω
    E   = mean over the sets of L(ω) f_r(ω) cos θ V(ω) W

"ris" is the method as published: each of a point's rays has a set of candidates of its own, all
random numbers are independent, and one candidate of a set survives. Source: Talbot, Cline and
Egbert, "Importance resampling for global illumination", EGSR 2005, section 3; Burke, Ghosh and
Heidrich, "Bidirectional importance sampling for direct illumination", EGSR 2005, who draw the
candidates from the map or from the BRDF.

"ris-stratified" shares what a point's rays can share. All its candidates are one pool, drawn by
low-discrepancy numbers, the map's from a table that MIS compensation has cut (Karlík et al., "MIS
compensation", SIGGRAPH Asia 2019), which may be 0 where the map is dim since the BRDF's candidates
reach those directions. Its survivors are drawn together, by one random number and equal steps
through the running sum of w (systematic resampling), which follows a Z-shaped curve over the map,
so that survivors, and those of a pixel's other sub-pixels too, share its directions out.

Order along a curve is the idea of Ciklabakkal, Gruson, Georgiev, Nowrouzezahrai and Hachisuka,
"Single-pass stratified importance resampling", EGSR 2022. There every survivor has candidates of
its own, generated one after the other along a curve over the square of random numbers, and the u
that draws the survivors are stratified; a running sum from both ends finds the one that a search of
the whole would, so that no candidate is kept. "ris-stratified[shared=False]" does the same with
candidates that are kept: each curve goes through the map's, then through the BRDF's.

The denominator is the balance heuristic between the two kinds of candidates. Both are unbiased, and
cost `candidates` look-ups of map, table and BRDF for each ray.

Parameters
    candidates : for each survivor; default 4, of "ris-stratified" 2
    source : of "ris" alone: half from the map, half from the BRDF ("both", default), or all of one
    shared : of "ris-stratified" alone: survivors of one pool (True, default), or of sets in the
        order of a curve (False)
"""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from samplers.base import LightSampler, Reading, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.resampled_light import OrderedSets, ResampledLight
from samplers.grids.survivors import curve_of
from samplers.grids.tabulated import by_luminance
from samplers.lighting import SurfaceDistribution
from samplers.reference import Reference

COMPENSATION = 0.5
"""Karlík's value for as many candidates of one kind as of the other."""

MORE = "more candidates for the same rays, and more time"


@register("ris")
@dataclass(frozen=True)
class Resampling(LightSampler):
    """A survivor of each set of candidates from the map and the BRDF (RIS)."""

    label: ClassVar[str] = "RIS (Talbot 2005)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Justin F. Talbot, David Cline, Parris Egbert",
            "Importance resampling for global illumination",
            "Eurographics Symposium on Rendering",
            2005,
            doi="10.2312/EGWR/EGSR05/139-146",
        ),
    )
    stochastic: ClassVar[bool] = True

    candidates: int = 4
    source: Literal["both", "map", "brdf"] = "both"

    readings = (
        Reading("four candidates a survivor", {"candidates": 4}),
        Reading("two candidates a survivor", {"candidates": 2}),
        Reading("eight candidates a survivor", {"candidates": 8}, MORE),
        Reading("sixteen candidates a survivor", {"candidates": 16}, MORE),
        Reading("32 candidates a survivor", {"candidates": 32}, MORE),
    )
    costly = ("candidates",)

    def __post_init__(self) -> None:
        require_candidates(self.name, self.candidates)

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        share = {"both": self.candidates // 2, "map": 0, "brdf": self.candidates}[self.source]
        return ResampledLight(
            environment.radiance,
            by_luminance(environment, count),
            count,
            (self.candidates - share) * count,
            share * count,
            curve=None,
            independent=True,
        )


@register("ris-stratified")
@dataclass(frozen=True)
class StratifiedResampling(LightSampler):
    """Survivors of one pool, which share the map's directions out."""

    label: ClassVar[str] = "RIS, stratified (envlight)"
    references: ClassVar[tuple[Reference, ...]] = (
        *Resampling.references,
        Reference(
            "Ege Ciklabakkal, Adrien Gruson, Iliyan Georgiev, Derek Nowrouzezahrai, "
            "Toshiya Hachisuka",
            "Single-pass stratified importance resampling",
            "Computer Graphics Forum",
            2022,
            kind="article",
            volume="41(4)",
            doi="10.1111/cgf.14585",
        ),
    )
    stochastic: ClassVar[bool] = True

    candidates: int = field(
        default=2,
        metadata={"readings": (4, 8, 16, 32), "ruled_out": dict.fromkeys((4, 8, 16, 32), MORE)},
    )
    shared: bool = True

    costly = ("candidates",)

    def __post_init__(self) -> None:
        require_candidates(self.name, self.candidates)

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        from_brdf = self.candidates // 2
        resampled = ResampledLight(
            environment.radiance,
            by_luminance(environment, count, compensation=COMPENSATION),
            count,
            (self.candidates - from_brdf) * count,
            from_brdf * count,
            curve_of(environment.height) if self.shared else None,
        )
        return resampled if self.shared else OrderedSets(resampled)


def require_candidates(name: str, candidates: int) -> None:
    """Raise EnvlightError for fewer than two candidates: one alone is no choice."""
    if candidates < 2:
        raise EnvlightError(f"{name}: {candidates} candidates; use at least 2")
