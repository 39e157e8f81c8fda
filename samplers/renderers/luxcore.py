"""LuxCore: a table of the map's luminance without the rows' solid angle, drawn by inversion.

Each cell holds luminance alone, as if rows at the poles were as long as the equator; the density of
a direction divides by sin θ, so the estimate is unbiased, but draws too much near the poles. No
compensation.

Source: LuxCoreRender as read in 2026, `slg/lights/infinitelight.cpp`; the rule, not the code.

Parameters
    compensation : False (default, as it ships); True takes the mean over the sphere off, as others
        do (see `compensation.py`)
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samplers.base import register
from samplers.environment import EnvironmentMap
from samplers.grids.tabulated import UniformDistribution
from samplers.grids.weight_table import WeightTable
from samplers.lighting import LightDistribution
from samplers.reference import Reference
from samplers.renderers.compensation import RendererTable, compensated
from samplers.renderers.lat_long import LatLongDistribution


@register("luxcore")
@dataclass(frozen=True)
class LuxCore(RendererTable):
    """The table of LuxCore's infinite light, beside BRDF sampling."""

    label: ClassVar[str] = "LuxCore (LuxCoreRender 2026)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "LuxCoreRender",
            "LuxCore, a physically based renderer",
            "LuxCoreRender",
            2026,
            kind="misc",
            url="https://luxcorerender.org",
        ),
    )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.is_black:
            return UniformDistribution(count)
        weight = environment.luminance.astype(np.float64)
        if self.compensation:
            weight = compensated(weight, environment.row_solid_angle)
        return LatLongDistribution(WeightTable.of(weight), count, weight.size)
