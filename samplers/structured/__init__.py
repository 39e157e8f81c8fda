"""Structured importance sampling: bright regions first, each filled with well spread samples.

The map is cut at six brightness levels into nested layers. From the brightest layer down, each
connected region gets samples in proportion to its importance Γ = L min(ΔΩ, Δω₀)^¼, with L its
luminous flux and ΔΩ its solid angle, less those that brighter regions within it already hold. They
are spread over the region by always adding the point that is farthest from all samples so far, at
most twice as far from the best arrangement. Strata are the cells nearest to each sample; a light
carries its stratum's integral of radiance.

Source: Agarwal, Ramamoorthi, Belongie and Jensen, "Structured importance sampling of environment
maps", ACM Transactions on Graphics 22(3), 2003. Γ lies between sampling by flux (exponents 1 and 0)
and by solid angle (0 and 1): it is what the variance of visibility asks for, where visibility is
alike over neighbouring directions and unrelated beyond Δω₀. Thresholds are i σ with i = 0 … 5 and σ
the standard deviation of luminance. Placement is the 2-approximation of k-centre by Hochbaum and
Shmoys, "A best possible heuristic for the k-center problem", 1985. The paper's jitter of a light
within its stratum, point by point, is the renderer's interleaved sampling.

What each region asks for is rounded, and no more is given than is left of the budget, so the number
of lights is exact; only where fewer texels are lit are there fewer. Built per map: components of
six layers, O(texels); then the texels that each new sample comes nearest to. Deterministic. The
lights are a fixed quadrature, noise-free and biased; their energy is exact.

Parameters
    useful_solid_angle : Δω₀ in sr, 0.01 in the paper. None counts all of a region's solid angle,
        as Wu 2025 and Wan et al. 2005 print the importance.
    deviation : σ is taken over "texels" (default), as published implementations do, or by
        "solid angle".
    position : a light stands at the energy "centroid" of its stratum (default) or at its "sample".
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
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.nearest_light import nearest_light_cells
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.reference import Reference
from samplers.sphere import centroid, pixel_direction
from samplers.structured.layers import layers_of, numbers_of_samples
from samplers.structured.placement import Texels, spread

LEVELS = 6
"""Thresholds: 0, σ, … 5σ."""


@register("structured")
@dataclass(frozen=True)
class StructuredImportance(LightSampler):
    """Nested bright regions filled with well spread samples (structured importance sampling)."""

    label: ClassVar[str] = "Structured (Agarwal 2003)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Sameer Agarwal, Ravi Ramamoorthi, Serge Belongie, Henrik Wann Jensen",
            "Structured importance sampling of environment maps",
            "ACM Transactions on Graphics",
            2003,
            kind="article",
            volume="22(3)",
            doi="10.1145/882262.882314",
        ),
    )

    useful_solid_angle: float | None = 0.01
    deviation: Literal["texels", "solid angle"] = "texels"
    position: Literal["centroid", "sample"] = "centroid"
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("solid angle counts up to 0.01 sr", {"useful_solid_angle": 0.01}),
        Reading("all solid angle counts", {"useful_solid_angle": None}),
        Reading("deviation over texels", {"deviation": "texels"}),
        Reading("deviation over solid angle", {"deviation": "solid angle"}),
        Reading("lights at the energy centroid", {"position": "centroid"}),
        Reading("lights at the sample", {"position": "sample"}),
    )

    def __post_init__(self) -> None:
        useful = self.useful_solid_angle
        if useful is not None and not 0.0 < useful < math.inf:
            raise EnvlightError(
                f"structured: useful_solid_angle is {useful}; use a positive number of sr, or None"
            )
        if self.deviation not in ("texels", "solid angle"):
            raise EnvlightError("structured: deviation is over 'texels' or by 'solid angle'")
        if self.position not in ("centroid", "sample"):
            raise EnvlightError("structured: position is 'centroid' or 'sample'")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        sample = self.samples(environment, count)
        row, column = np.divmod(sample, environment.width)
        direction = pixel_direction(row, column, environment.height)
        cells = nearest_light_cells(direction, environment.radiance)
        if self.position == "centroid":
            direction = centroid(cells.moment, cells.flux @ LUMINANCE_WEIGHTS, direction)
        extent = cells.extent(direction, self.light_extent)
        return DirectionalLights(direction, cells.flux, extent)

    def thresholds(self, environment: EnvironmentMap) -> NDArray[np.float64]:
        """Luminances (6,) at which the layers begin, ascending from 0."""
        apart = environment.luminance.astype(np.float64).ravel()
        weight = environment.row_solid_angle if self.deviation == "solid angle" else None
        by_row = None if weight is None else np.repeat(weight, environment.width)
        apart -= np.average(apart, weights=by_row)
        square = np.average(np.square(apart, out=apart), weights=by_row)
        return np.arange(LEVELS, dtype=np.float64) * math.sqrt(square)

    def samples(self, environment: EnvironmentMap, count: int) -> NDArray[np.int64]:
        """Flat indices of the texels with a sample, `count` of them or all that are lit."""
        tables, samples = Texels.of(environment), np.empty(0, np.int64)
        count = min(count, int(np.count_nonzero(environment.luminance)))
        total, useful = environment.luminous_flux, self.useful_solid_angle
        for layer in layers_of(environment, self.thresholds(environment)):
            for region, number in numbers_of_samples(layer, total, count, samples, useful):
                inside = samples[layer.label[samples] == region]
                new = spread(tables, layer.members(region), inside, number)
                samples = np.concatenate([samples, new])
        lit = np.flatnonzero(environment.luminance).astype(np.int32)
        return np.concatenate([samples, spread(tables, lit, samples, count - len(samples))])
