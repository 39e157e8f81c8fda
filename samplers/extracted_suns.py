"""What engines do with a map: a sun or a few lights taken out, harmonics of the rest.

Programs that draw pictures in real time, or want a map's sun as a light of their own, take what
outshines the rest out of the map and keep the rest as nine numbers a channel: spherical harmonics
up to the second order, which are all that a diffuse surface sees of light that nothing hides
(Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps", SIGGRAPH
2001). The lights cast shadows, the rest casts none.

"sun-and-sh" takes one sun. Every texel is clamped to `threshold` times the map's mean luminance,
its colour kept; all that is above is the sun. It stands at the energy centroid of that excess, and
its angular radius α is that of an even cap whose directions scatter as much: their mean has the
length (1 + cos α)/2. Source: the sun that Blender's EEVEE extracts from a world (release 4.3, 2024,
"Sun Threshold"), which clamps at a radiance of 10 instead; the rule, not the code.

"mksource" takes discs. The brightest cell above the map's 98th percentile, by solid angle, is the
seed of a disc, which grows from cell to cell, is 15° across at most, and stops where cells fall
below 15 % of the seed, or below the percentile. All light in them is the disc's, which has their
solid angle. Then the search starts again, until no cell above the percentile is left or there are
as many discs as the budget has rays. What has less than 5 % of the light of a disc of 15° at the
percentile is left to the rest.
Source: `mksource` of Radiance (Ward, "The RADIANCE lighting simulation and rendering system",
SIGGRAPH 1994): its percentile and limits, not its code.

Both return discs and an ambient map (`samplers.lighting.DiscLights`): the harmonics, clamped at 0
where they swing below it and scaled so that all of it carries the map's flux in each channel. Rays
of the budget are shared out among the discs. One pass over the map, deterministic. Biased: the
ambient part casts no shadows and has no detail for glossy surfaces.

Parameters
    threshold : of "sun-and-sh" alone, times the mean luminance: 10 (default)
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.reduced_map import ReducedMap, reduce_map
from samplers.lighting import DiscLights
from samplers.reference import Reference
from samplers.sphere import (
    cap_solid_angle,
    normalized,
    pixel_direction,
    pixel_directions,
    row_solid_angle,
)

ROWS, AMBIENT_ROWS = 128, 64
"""Rows of the cells that are looked at, and of the ambient map, at most."""
PERCENTILE, WIDEST, LEAST_CELL, LEAST_DISC = 0.98, math.radians(15.0), 0.15, 0.05
FREE, LEFT = -1, -2
"""Cells that no disc has, and those that are too little for one."""
ROUNDING = 1e-6
"""More than a cell's mean luminance is off: no cell of an even sky outshines the others."""
IN_FLOAT32 = (1e-36, 1e36)
"""A map whose largest value is beyond these keeps its rest as it is: float32 has no digits, or no
room, for harmonics of the same flux."""


def harmonics(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nine real spherical harmonics (..., 9) up to the second order of directions (..., 3)."""
    x, y, z = np.moveaxis(direction, -1, 0)
    one, two = math.sqrt(3.0 / (4.0 * math.pi)), math.sqrt(15.0 / (4.0 * math.pi))
    found = np.empty((*x.shape, 9))
    found[..., 0] = math.sqrt(1.0 / (4.0 * math.pi))
    found[..., 1:4] = one * direction
    found[..., 4], found[..., 5], found[..., 6] = two * x * y, two * y * z, two * z * x
    found[..., 7] = 0.5 * two * (x * x - z * z)
    found[..., 8] = math.sqrt(5.0 / (16.0 * math.pi)) * (3.0 * y * y - 1.0)
    return found


def smoothed(environment: EnvironmentMap) -> EnvironmentMap:
    """The map by its harmonics up to the second order, not negative, with the same flux."""
    total = environment.total_flux
    if not IN_FLOAT32[0] < environment.radiance.max() < IN_FLOAT32[1]:
        return environment
    cells = reduce_map(environment, ROWS)
    # In units of the flux, so that nothing overflows.
    share = np.divide(cells.flux, total, out=np.zeros_like(cells.flux), where=total > 0.0)
    height = min(environment.height, AMBIENT_ROWS)
    found = harmonics(pixel_directions(height)) @ (harmonics(cells.direction).T @ share)
    found = np.maximum(found, 0.0)
    flux = np.einsum("rck,r->k", found, row_solid_angle(height, 2 * height))
    scale = np.divide(total, flux, out=np.zeros(3), where=flux > 0.0)
    return EnvironmentMap((found * scale).astype(np.float32), environment.name)


def discs_and_rest(
    environment: EnvironmentMap,
    flux: NDArray[np.float64],
    direction: NDArray[np.float64],
    half_angle: NDArray[np.float64],
    rest: NDArray[np.float32],
    count: int,
) -> DiscLights:
    """The lighting of discs (n,), and of what radiance (H, 2H, 3) is left without them."""
    ambient = smoothed(EnvironmentMap(rest, environment.name) if len(flux) else environment)
    # What float32 rounds off the rest is the discs'.
    lost = environment.total_flux - ambient.total_flux - flux.sum(axis=0)
    luminous = flux @ LUMINANCE_WEIGHTS
    if len(flux):
        flux = np.maximum(flux + lost * (luminous / luminous.sum())[:, None], 0.0)
    rays = max(1, count // max(1, len(flux)))
    return DiscLights(direction, flux, half_angle, ambient, rays_per_light=rays)


@register("sun-and-sh")
@dataclass(frozen=True)
class SunAndHarmonics(LightSampler):
    """One sun, and second-order harmonics of the rest."""

    label: ClassVar[str] = "Sun and SH (EEVEE 2024)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "EEVEE",
            "Sun extraction from a world's light, Blender 4.3",
            "Blender Foundation",
            2024,
            kind="misc",
            url="https://www.blender.org",
        ),
        Reference(
            "Ravi Ramamoorthi, Pat Hanrahan",
            "An efficient representation for irradiance environment maps",
            "SIGGRAPH",
            2001,
            doi="10.1145/383259.383317",
        ),
    )

    threshold: float = field(default=10.0, metadata={"readings": (30.0,)})

    def __post_init__(self) -> None:
        if not self.threshold > 0.0:
            raise EnvlightError(f"sun-and-sh: threshold {self.threshold}; use more than 0")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DiscLights:
        limit = self.threshold * environment.luminous_flux / (4.0 * math.pi)
        rest, above = environment.radiance.copy(), []
        for r, line in enumerate(rest):
            luminance = line @ LUMINANCE_WEIGHTS
            (column,) = np.nonzero(luminance > limit)
            line[column] = line[column] * (limit / luminance[column, None])
            above.append(np.stack([np.full_like(column, r), column]))
        row, column = np.concatenate(above, axis=1)
        excess = environment.radiance[row, column].astype(np.float64) - rest[row, column]
        excess *= environment.row_solid_angle[row, None]
        weight = excess @ LUMINANCE_WEIGHTS
        if not weight.sum() > 0.0:
            nothing = np.zeros((0, 3))
            return discs_and_rest(
                environment, nothing, nothing, np.zeros(0), environment.radiance, count
            )
        direction = pixel_direction(row, column, environment.height)
        mean = (weight / weight.sum()) @ direction
        brightest = int(np.argmax(weight))
        texel = environment.row_solid_angle[row[brightest]]
        spread = math.acos(min(1.0, max(0.0, 2.0 * float(np.linalg.norm(mean)) - 1.0)))
        half_angle = min(max(spread, math.sqrt(texel / math.pi)), 0.5 * math.pi)
        sun = normalized(mean[None], direction[brightest])
        return discs_and_rest(
            environment, excess.sum(axis=0)[None], sun, np.array([half_angle]), rest, count
        )


@register("mksource")
@dataclass(frozen=True)
class MakeSource(LightSampler):
    """Discs grown from the brightest cells, and second-order harmonics of the rest."""

    label: ClassVar[str] = "mksource (Ward 1994)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Gregory J. Ward",
            "The RADIANCE lighting simulation and rendering system",
            "SIGGRAPH",
            1994,
            doi="10.1145/192161.192286",
        ),
    )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DiscLights:
        cells = reduce_map(environment, ROWS)
        luminance = cells.luminous_flux / cells.solid_angle
        order = np.argsort(luminance, kind="stable")
        running = np.cumsum(cells.solid_angle[order])
        place = np.searchsorted(running, PERCENTILE * running[-1])
        limit = luminance[order][min(int(place), len(order) - 1)]
        least = LEAST_DISC * limit * float(cap_solid_angle(0.5 * WIDEST))
        disc, discs = np.full(len(luminance), FREE), 0
        for seed in order[::-1]:
            if luminance[seed] <= (1.0 + ROUNDING) * limit or discs == count:
                break
            if disc[seed] == FREE:
                floor = max(limit, LEAST_CELL * luminance[seed])
                grown = _grown(cells, (disc == FREE) & (luminance >= floor), int(seed))
                enough = cells.luminous_flux[grown].sum() >= least
                disc[grown] = discs if enough else LEFT
                discs += int(enough)
        at = np.arange(environment.width) * cells.height // environment.height
        taken = disc.reshape(cells.height, -1)[at[: environment.height, None], at] >= 0
        rest = np.where(taken[..., None], np.float32(0.0), environment.radiance)
        member, own = disc >= 0, disc[disc >= 0]
        flux, moment = np.zeros((2, discs, 3))
        np.add.at(flux, own, cells.flux[member])
        np.add.at(moment, own, cells.moment[member])
        size = np.bincount(own, cells.solid_angle[member], discs)
        half_angle = 2.0 * np.arcsin(np.sqrt(np.minimum(size / (4.0 * math.pi), 0.5)))
        up = np.array([0.0, 1.0, 0.0])
        return discs_and_rest(environment, flux, normalized(moment, up), half_angle, rest, count)


def _grown(cells: ReducedMap, wanted: NDArray[np.bool_], seed: int) -> NDArray[np.int64]:
    """The wanted cells that hang together with a seed, as far as a disc may reach."""
    columns = 2 * cells.height
    reach = math.ceil(WIDEST * cells.height / math.pi)
    top = max(0, seed // columns - reach)
    rows = slice(top * columns, (seed // columns + reach + 1) * columns)
    wanted, direction = wanted[rows].reshape(-1, columns), cells.direction[rows]
    found = np.zeros_like(wanted)
    found.reshape(-1)[seed - rows.start] = True
    poles = [
        row for row, is_pole in ((0, top == 0), (-1, top + len(found) >= cells.height)) if is_pole
    ]
    while True:
        members = rows.start + np.flatnonzero(found)
        centre = normalized(cells.moment[members].sum(axis=0), cells.direction[seed])
        wider = found | np.roll(found, 1, axis=1) | np.roll(found, -1, axis=1)
        wider[1:] |= found[:-1]
        wider[:-1] |= found[1:]
        for row in poles:  # all of its cells touch there
            wider[row] |= found[row].any()
        near = direction @ centre >= math.cos(0.5 * WIDEST)
        wider &= wanted & near.reshape(wanted.shape)
        wider |= found
        size = cells.solid_angle[rows][wider.reshape(-1)].sum()
        if size > cap_solid_angle(0.5 * WIDEST) or np.array_equal(wider, found):
            return members
        found = wider
