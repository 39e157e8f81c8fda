"""Centre-surround decomposition: a few bright discs as area lights, the rest as ambient light.

A bank of filters, each a disc with weight +1 inside a ring with weight -10, is tried at the
brightest pixels of the map. The place and size of the largest response become a disc light with all
light within the disc; the disc is set to black, and the search starts again. It ends when a light
would add less than 2 % of what all lights before it gave. What remains of the map is the ambient
part, rendered without shadows.

Source: Arbree, Walter, Bala, "Pre-processing environment maps for dynamic hardware shadows",
Cornell University technical report, 2005, section 3.

Built per map: responses on a grid of at most 256 × 128 pixels, by prefix sums along φ; after each
light only what lies within reach of it. The sums of the lights themselves run over the full map, so
lights and ambient part together hold its flux. Deterministic. Biased: the ambient part casts no
shadows. The number of lights is the map's own; the budget is an upper bound, and each light gets an
equal share of it as shadow rays.

Twenty sizes from 4.5 to 45 degrees, an inner radius of 0.75 of the outer, a weight of -10 for the
ring, the brightest 10 % of pixels and the stop at 2 % are the paper's.

Parameters, all of them what the paper leaves open
    spacing : "linear" (default) or "geometric" sizes.
    extent : the angular extent of a filter is the outer circle's "radius" (default) or its
        "diameter", which caps the discs at half the size.
    inner_in : the inner radius is 0.75 of the outer as an "angle" (default) or in the tangent
        "plane".
    surface : weights by solid angle on the "sphere" (default), or by area in the "plane" that is
        tangent at the filter's centre, which is what a camera's image has.
    brightest_by : the brightest pixels of what remains of the map are counted by "count" (default)
        or by "solid angle".

`experiments.questions.readings` compares them.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.center_surround.filters import FilterBank, angular_extents, filter_bank
from samplers.center_surround.search import SurroundSearch
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import DiscLights
from samplers.reference import Reference

SIZES, SMALLEST, LARGEST = 20, 4.5, 45.0
"""Filters, and their angular extents in degrees."""
INNER, SURROUND = 0.75, -10.0
"""Inner radius over outer, and the weight of the ring; the disc has the weight 1."""
BRIGHTEST = 0.1
"""Share of the pixels that is tried."""
STOP = 0.02
"""Share of the earlier lights' sum below which a light is not made."""
ROWS = 128
"""Rows of the search grid at most; a smaller map is searched as it is."""
CHOICES = {
    "spacing": ("linear", "geometric"),
    "extent": ("radius", "diameter"),
    "inner_in": ("angle", "plane"),
    "surface": ("sphere", "plane"),
    "brightest_by": ("count", "solid angle"),
}


@dataclass(frozen=True, eq=False)
class DiscPixels:
    """The pixels of a map whose centres lie in a disc: per row an interval that may cross the seam.

    row, first, count : (m,) int64
    """

    row: NDArray[np.int64]
    first: NDArray[np.int64]
    count: NDArray[np.int64]

    def columns(self, k: int, width: int) -> NDArray[np.int64]:
        return (self.first[k] + np.arange(self.count[k])) % width


def disc_pixels(height: int, u: float, v: float, half_angle: float) -> DiscPixels:
    """The pixels of a map of H × 2H within `half_angle` of the direction at u, v."""
    step = math.pi / height
    theta0 = v * math.pi
    row = np.arange(
        max(0, math.floor((theta0 - half_angle) / step)),
        min(height, math.ceil((theta0 + half_angle) / step)),
    )
    theta = (row + 0.5) * step
    reach = math.sin(0.5 * half_angle) ** 2 - np.sin(0.5 * (theta - theta0)) ** 2
    row, theta, reach = row[reach > 0.0], theta[reach > 0.0], reach[reach > 0.0]
    sine2 = np.minimum(reach / (math.sin(theta0) * np.sin(theta)), 1.0)
    half = 2.0 * np.arcsin(np.sqrt(sine2)) / step
    middle = u * 2 * height - 0.5
    first = np.ceil(middle - half).astype(np.int64)
    count = np.floor(middle + half).astype(np.int64) - first + 1
    return DiscPixels(row, first, np.clip(count, 0, 2 * height))


def disc_flux(
    radiance: NDArray[np.float32], solid_angle: NDArray[np.float64], disc: DiscPixels
) -> NDArray[np.float64]:
    """∫ L dω over the pixels of a disc, (3,)."""
    total = np.zeros(3)
    for k, r in enumerate(disc.row):
        line = radiance[r, disc.columns(k, radiance.shape[1])]
        total += solid_angle[r] * line.sum(axis=0, dtype=np.float64)
    return total


@register("center-surround")
@dataclass(frozen=True)
class CenterSurround(LightSampler):
    """Disc lights found by centre-surround filters, and an ambient remainder."""

    label: ClassVar[str] = "Centre-surround (Arbree 2005)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Adam Arbree, Bruce Walter, Kavita Bala",
            "Pre-processing environment maps for dynamic hardware shadows",
            "Cornell University",
            2005,
            kind="techreport",
            volume="TR2005-1998",
            url="https://hdl.handle.net/1813/5698",
        ),
    )

    spacing: Literal["linear", "geometric"] = "linear"
    extent: Literal["radius", "diameter"] = "radius"
    inner_in: Literal["angle", "plane"] = "angle"
    surface: Literal["sphere", "plane"] = "sphere"
    brightest_by: Literal["count", "solid angle"] = "count"

    readings = (
        Reading("sizes in equal steps", {"spacing": "linear"}),
        Reading("sizes in equal ratios", {"spacing": "geometric"}),
        Reading("sizes are diameters", {"extent": "diameter"}),
        Reading("sizes are radii", {"extent": "radius"}),
        Reading("inner radius 0.75 as an angle", {"inner_in": "angle"}),
        Reading("inner radius 0.75 in the plane", {"inner_in": "plane"}),
        Reading("weights by solid angle", {"surface": "sphere"}),
        Reading("weights by the plane's area", {"surface": "plane"}),
        Reading("brightest 10 % of the pixels", {"brightest_by": "count"}),
        Reading("brightest 10 % of the sphere", {"brightest_by": "solid angle"}),
    )
    costly = ("spacing", "extent", "inner_in", "surface", "brightest_by")

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise EnvlightError(
                    f"center-surround: {name} is {' or '.join(map(repr, choices))}, "
                    f"not {getattr(self, name)!r}"
                )

    def bank(self) -> FilterBank:
        """The filters that these parameters describe."""
        return filter_bank(
            angular_extents(SIZES, SMALLEST, LARGEST, self.spacing == "geometric"),
            self.extent == "diameter",
            INNER,
            self.inner_in == "plane",
            SURROUND,
            self.surface == "plane",
        )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DiscLights:
        bank = self.bank()
        remaining = environment.radiance.copy()
        search = SurroundSearch(
            remaining, bank, ROWS, BRIGHTEST, self.brightest_by == "solid angle"
        )
        direction: list[NDArray] = []
        irradiance: list[NDArray] = []
        half_angle: list[float] = []
        taken = 0.0
        while len(direction) < count and (found := search.best()) is not None:
            radius = float(bank.inner[found.filter])
            u, v = (found.column + 0.5) / (2 * search.height), (found.row + 0.5) / search.height
            disc = disc_pixels(environment.height, u, v, radius)
            flux = disc_flux(remaining, environment.row_solid_angle, disc)
            intensity = float(flux @ LUMINANCE_WEIGHTS)
            if intensity < STOP * taken:
                break
            for k, r in enumerate(disc.row):
                remaining[r, disc.columns(k, environment.width)] = 0.0
            search.forget(remaining, found)
            taken += intensity
            direction.append(found.direction)
            irradiance.append(flux)
            half_angle.append(radius)
        ambient = EnvironmentMap(remaining, environment.name) if direction else environment
        return DiscLights(
            np.array(direction).reshape(-1, 3),
            np.array(irradiance).reshape(-1, 3),
            np.array(half_angle),
            ambient,
            rays_per_light=max(1, count // max(len(direction), 1)),
        )
