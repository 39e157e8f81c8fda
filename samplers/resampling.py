"""Resampled importance sampling: many cheap candidates, and rays only for the few that matter.

Candidates come from two tables that know half of the integrand each: the map's luminance and the
surface's BRDF. Each is judged by its target, the luminance of L · f_r · cos, all that can be known
without a ray. From them a few survivors are drawn in proportion to target over density, and only
these are traced. The more candidates, the nearer the survivors come to the product of light and
reflectance; visibility is left to the rays.

    w_j = target(ω_j) / (m p_map(ω_j) + n p_BRDF(ω_j))          m + n candidates
    W   = Σ_j w_j / target(ω)                                    for each survivor ω
    E   = mean over the survivors of L(ω) f_r(ω) cos θ V(ω) W

The denominator is the balance heuristic between the two kinds of candidates, which keeps E
unbiased though the map's table, compensated (Karlík et al. 2019), is 0 where the map is dim: the
BRDF's candidates reach those directions. Survivors are drawn together, by one random number and
equal steps through the running sum of w. The sum follows a Z-shaped curve over the map, so that
survivors, and those of a pixel's other sub-pixels too, share its directions out.

Source: Talbot, Cline and Egbert, "Importance resampling for global illumination", EGSR 2005,
section 3; Burke, Ghosh and Heidrich, "Bidirectional importance sampling for direct illumination",
EGSR 2005. Neither says how to mix candidates of two kinds or how to draw several survivors from one
set: the balance heuristic and systematic resampling along a curve are choices made here.

Costs `candidates` look-ups of map, table and BRDF for each ray. Unbiased.

Survivors are not shared between pixels (ReSTIR; Bitterli et al., SIGGRAPH 2020). Within one frame,
and unbiased with a ray for each survivor, sharing gives a pixel its neighbours' candidates, for
whose targets it pays again: what more candidates of its own give, `experiments.questions.readings`
says. Of visibility they know nothing.

Parameters
    candidates : 8 (default) for each survivor, half from the map and half from the BRDF
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samplers.base import LightSampler, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.resampled_light import ResampledLight
from samplers.grids.survivors import curve_of
from samplers.grids.tabulated import by_luminance
from samplers.lighting import SurfaceDistribution

COMPENSATION = 0.5
"""Karlík's value for as many candidates of one kind as of the other."""


@register("ris")
@dataclass(frozen=True)
class Resampling(LightSampler):
    """Survivors of candidates from the map and the BRDF (RIS)."""

    stochastic: ClassVar[bool] = True

    candidates: int = 8

    def __post_init__(self) -> None:
        if self.candidates < 2:
            raise EnvlightError(f"ris: {self.candidates} candidates; use at least 2")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        from_brdf = self.candidates // 2
        return ResampledLight(
            environment.radiance,
            by_luminance(environment, count, compensation=COMPENSATION),
            count,
            (self.candidates - from_brdf) * count,
            from_brdf * count,
            curve_of(environment.height),
        )
