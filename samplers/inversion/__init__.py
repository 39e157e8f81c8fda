"""Multiple importance sampling: directions drawn from the map's luminance, met by BRDF sampling.

A texel is found by tabulated inversion: a row by binary search in the marginal distribution of
luminance × solid angle, then a column by binary search in the row's conditional one; the direction
is uniform in solid angle within the texel. Its density is therefore exactly proportional to
luminance. The renderer draws half of the samples from the BRDF and weights both techniques by the
power heuristic, so bright lights and sharp highlights are both found. Unbiased; noisy where the
count is low.

Source: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering",
SIGGRAPH 1995; Pharr, Jakob and Humphreys, "Physically Based Rendering", third edition 2016, 14.2.4.
pbrt filters the map and takes the sine of a row's centre; here the map is constant over each texel
and solid angles are exact, so no density is lost between the table and the map.

"mis-compensated" takes a constant off the density and clamps it at 0: BRDF sampling covers the dim
part of a map already, and samples of the light are better spent on what is bright. Source: Karlík,
Šik, Vévoda, Skřivan and Křivánek, "MIS compensation: optimizing sampling techniques in multiple
importance sampling", SIGGRAPH Asia 2019. Its density is 0 in dim directions, so it is unbiased only
beside BRDF sampling: it takes two samples at least, one of the light and one of the BRDF.

Building the table costs one pass over the map, a sample O(log H + log W).

Parameters
    guided : True (default) starts each binary search from a table of cut points (Chen and Asau,
        "On generating random variates from an empirical distribution", AIIE Transactions 1974),
        which leaves a step or two of it; False searches the whole row, as pbrt does. The samples
        are the same bit for bit.
    numbers : "low-discrepancy" (default), as pbrt's own samplers but one, or "independent"
    share : of "mis-compensated" alone: the part c of the samples that come from the table, ½
        (default) where they are half and half. 2(1 − c) times the map's mean luminance over solid
        angle is taken off. Where nothing would be left, as on a constant map, none is.
    denoise : of "mis-compensated" alone: True has the image denoised (`renderer.denoise`, an extra)
        in its time; then it is biased. False (default)
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np

from samplers.base import LightSampler, Reading, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.tabulated import COMPENSATED_COUNT, by_luminance
from samplers.lighting import LightDistribution
from samplers.reference import Reference


@register("mis")
@dataclass(frozen=True)
class MultipleImportance(LightSampler):
    """Luminance and BRDF sampling, combined by the power heuristic (MIS)."""

    label: ClassVar[str] = "MIS (Veach 1995)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Eric Veach, Leonidas J. Guibas",
            "Optimally combining sampling techniques for Monte Carlo rendering",
            "SIGGRAPH",
            1995,
            doi="10.1145/218380.218498",
        ),
    )
    stochastic: ClassVar[bool] = True

    guided: bool = field(default=True, metadata={"fixed": "the samples are the same"})
    numbers: Literal["low-discrepancy", "independent"] = "low-discrepancy"

    readings = (
        Reading("low-discrepancy numbers", {"numbers": "low-discrepancy"}),
        Reading("independent numbers", {"numbers": "independent"}),
    )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        independent = self.numbers == "independent"
        return by_luminance(environment, count, guided=self.guided, independent=independent)


@register("mis-compensated")
@dataclass(frozen=True)
class CompensatedImportance(MultipleImportance):
    """The same with the part of the light that BRDF sampling covers taken off its density."""

    label: ClassVar[str] = "MIS compensated (Karlík 2019)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Ondřej Karlík, Martin Šik, Petr Vévoda, Tomáš Skřivan, Jaroslav Křivánek",
            "MIS compensation: optimizing sampling techniques in multiple importance sampling",
            "ACM Transactions on Graphics",
            2019,
            kind="article",
            volume="38(6)",
            doi="10.1145/3355089.3356565",
        ),
    )
    minimum_count: ClassVar[int] = COMPENSATED_COUNT

    share: float = field(default=0.5, metadata={"fixed": "half of the samples are the table's"})
    denoise: bool = field(default=False, metadata={"fixed": "an extra, and no way of sampling"})

    readings = (
        Reading("low-discrepancy numbers", {"numbers": "low-discrepancy"}),
        Reading("independent numbers", {"numbers": "independent"}),
    )

    def __post_init__(self) -> None:
        if not 0.0 < self.share <= 1.0:
            raise EnvlightError(f"{self.name}: share {self.share}; use a value in (0, 1]")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        found = by_luminance(
            environment,
            count,
            compensation=self.share,
            guided=self.guided,
            independent=self.numbers == "independent",
        )
        return replace(found, denoised=self.denoise)
