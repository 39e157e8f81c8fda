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

Building the table costs one pass over the map, a sample O(log H + log W).

Parameters
    compensation : None (default, as pbrt-v3) or a fraction c in (0, 1]. Takes 2(1 − c) times the
        map's mean luminance off the density and clamps it at 0, because BRDF sampling covers the
        dim part already (Karlík et al., "MIS compensation", SIGGRAPH Asia 2019; c = ½ for a
        half-and-half split). Where nothing would be left, as on a constant map, it is not applied.
    guided : True (default) starts each binary search from a table of cut points (Chen and Asau,
        "On generating random variates from an empirical distribution", AIIE Transactions 1974),
        which leaves a step or two of it; False searches the whole row, as pbrt does. The samples
        are the same bit for bit.
    numbers : "low-discrepancy" (default), as pbrt's own samplers but one, or "independent"
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from samplers.base import LightSampler, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.tabulated import UNIFORM_PDF, TabulatedDistribution, UniformDistribution
from samplers.lighting import LightDistribution

LEAST_REMAINDER = 2.0**-20
"""A compensated density below this share of the map is rounding noise of float32 luminance."""


@register("mis")
@dataclass(frozen=True)
class MultipleImportance(LightSampler):
    """Luminance and BRDF sampling, combined by the power heuristic (MIS)."""

    stochastic: ClassVar[bool] = True

    compensation: float | None = None
    guided: bool = True
    numbers: Literal["low-discrepancy", "independent"] = "low-discrepancy"

    def __post_init__(self) -> None:
        if self.compensation is not None and not 0.0 < self.compensation <= 1.0:
            raise EnvlightError(f"mis: compensation {self.compensation}; use a value in (0, 1]")
        if self.numbers not in ("low-discrepancy", "independent"):
            raise EnvlightError("mis: numbers is 'low-discrepancy' or 'independent'")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.is_black:
            return UniformDistribution(count)
        independent = self.numbers == "independent"
        if self.compensation is not None:
            mean = environment.luminous_flux * UNIFORM_PDF
            offset = 2.0 * (1.0 - self.compensation) * mean
            compensated = TabulatedDistribution.of(
                environment, count, offset, self.guided, independent
            )
            if compensated.marginal[-1] > LEAST_REMAINDER * environment.luminous_flux:
                return compensated
        return TabulatedDistribution.of(environment, count, 0.0, self.guided, independent)
