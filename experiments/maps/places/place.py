"""Built places: solids, panels and lamps about an eye, shaded with bounced light.

A place is a list of boxes and cylinders, the first of which may be a room seen from inside. Panels
are rectangles on faces: panes that show the outside, screens that glow, frames that are painted.
Lamps are too small for sampling and become emitters, as far as the eye sees them. Diffuse light
comes from `lightmap`, the sun is traced per sample, and glossy surfaces mirror once.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from experiments.maps.places import lightmap, rays
from experiments.maps.places.emitters import disc
from experiments.maps.places.grid import Grid, grid_of, look_up_all
from experiments.maps.places.lamps import Lamp, add_highlights
from experiments.maps.places.land import UP, horizontal, sky_table
from experiments.maps.places.materials import Material, surface_coordinates
from experiments.maps.places.noise import fractal, mix
from experiments.maps.places.parts import CLEAR, GLOW, PAINT, Panel, Solid
from experiments.maps.places.raster import Picture
from experiments.maps.places.shapes import Array, Point, Shade
from experiments.maps.places.sky import Sun

MOST_POINTS = 56
"""Grid points along the longest side of a face."""


def black_sky(direction: Array, width: float) -> Array:
    return np.zeros_like(direction)


@dataclass(frozen=True, eq=False)
class Place:
    """See the module; `eye` is where the map is taken, `spacing` that of the light's grid in m,
    `haze` the distance in m over which things fade into the horizon."""

    solids: list[Solid]
    eye: Point
    panels: list[Panel] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    room: bool = True
    outside: Shade = black_sky
    sun: Sun | None = None
    shade_of_leaves: Callable[[Array], Array] | None = None
    spacing: float = 0.3
    haze: float = rays.FAR

    def picture(self) -> Picture:
        emitters = [e for lamp in self.lamps for e in lamp.emitters(self.eye, self.shows)]
        if self.sun is not None:
            eye = np.array([self.eye], np.float64)
            seen = self._sunlight(eye, self.sun.direction[None, :])[0] / self.sun.irradiance
            if seen.any():
                emitters.append(
                    disc(self.sun.direction, self.sun.half_angle, seen * self.sun.radiance)
                )
        assert self.irradiance is not None  # built here, before the blocks run on many threads
        return Picture(self.shade, emitters)

    def shows(self, point: Array) -> bool:
        """Whether nothing stands between the eye and a point."""
        way = point - np.array(self.eye)
        distance = float(np.linalg.norm(way))
        return not rays.occluded(np.array(self.eye), way / distance, *self._solids, distance - 1e-3)

    @cached_property
    def _solids(self) -> tuple[Array, NDArray[np.int64], bool]:
        bounds = np.array([[*solid.low, *solid.high] for solid in self.solids], np.float64)
        return bounds, np.array([solid.kind for solid in self.solids], np.int64), self.room

    @cached_property
    def _ordered(self) -> list[Panel]:
        """The panels face by face, those of a face in the order in which they were added."""
        return sorted(self.panels, key=lambda p: (p.solid, p.face))

    @cached_property
    def _panels(self) -> tuple[NDArray[np.int64], Array]:
        """First and last panel (solids, 6, 2) of each face, and the panels' rectangles (m, 4)."""
        where = [6 * p.solid + p.face for p in self._ordered]
        faces = np.arange(6 * len(self.solids))
        ends = [np.searchsorted(where, faces, side) for side in ("left", "right")]
        bounds = np.array([p.rectangle for p in self._ordered], np.float64).reshape(-1, 4)
        return np.stack(ends, axis=-1).reshape(-1, 6, 2).astype(np.int64), bounds

    @cached_property
    def _looks(self) -> tuple[NDArray[np.int64], Array]:
        """Kind and colour of the panels."""
        kind = np.array([p.kind for p in self._ordered], np.int64)
        return kind, np.array([p.colour for p in self._ordered], np.float64).reshape(-1, 3)

    @cached_property
    def _materials(self) -> tuple[list[Material], NDArray[np.int64]]:
        """Distinct materials, and that of each solid."""
        distinct = list(dict.fromkeys(solid.material for solid in self.solids))
        return distinct, np.array([distinct.index(solid.material) for solid in self.solids])

    @cached_property
    def _grid(self) -> Grid:
        return grid_of(*self._solids, self.spacing, MOST_POINTS)

    @cached_property
    def irradiance(self) -> Array:
        """Irradiance (points, 3) of the place's grid; see `lightmap.irradiance`."""
        albedo = np.array([solid.material.albedo for solid in self.solids])
        grid, table = self._grid, sky_table(self.outside)
        sunlight = self._sunlight(grid.point, grid.normal)
        return lightmap.irradiance(
            grid, self._solids, self._panels, albedo, self._light_samples(), sunlight, table
        )

    @cached_property
    def _lamp_samples(self) -> Array:
        rows = [row for lamp in self.lamps for row in lamp.samples()]
        return np.array(rows, np.float64).reshape(-1, 12)

    def _light_samples(self) -> Array:
        rows: list[list[float]] = []
        for panel in self.panels:
            if panel.light and panel.kind != PAINT:
                inward = self.room and panel.solid == 0
                rows.extend(panel.samples(self.solids[panel.solid], inward))
        return np.concatenate([self._lamp_samples, np.array(rows, np.float64).reshape(-1, 12)])

    def _sunlight(self, point: Array, normal: Array) -> Array:
        """Direct irradiance (n, 3) of the sun at points with normals (n, 3)."""
        out = np.zeros((len(point), 3))
        if self.sun is None or not len(point):
            return out
        through = np.empty(len(point), np.int64)
        clear = np.array([p.kind == CLEAR for p in self._ordered], np.bool_)
        rays.sees_sun(
            point, normal, self.sun.direction, *self._solids, *self._panels, clear, through
        )
        lit = through > 0
        cosine = normal[lit] @ self.sun.direction
        tint = np.concatenate([np.zeros((1, 3)), np.ones((1, 3)), self._looks[1]])
        out[lit] = cosine[:, None] * self.sun.irradiance * tint[through[lit]]
        if self.shade_of_leaves is not None:
            out[lit] *= self.shade_of_leaves(point[lit])[:, None]
        return out

    def shade(self, direction: Array, width: float) -> Array:
        """Radiance (n, 3) towards the eye; see `shapes.Shade`."""
        eye = np.array([self.eye], np.float64)
        distance, hit = self._trace(eye, direction)
        out, point, normal = self._surface(eye, direction, distance, hit, width)
        materials, material_of = self._materials
        gloss = np.array([m.gloss for m in materials])[material_of[hit[:, 0]]]
        shiny = np.flatnonzero((hit[:, 0] >= 0) & (hit[:, 2] < 0) & (gloss > 0.0))
        if len(shiny):
            out[shiny] += gloss[shiny, None] * self._mirrored(
                direction[shiny], point[shiny], normal[shiny], hit[shiny], distance[shiny], width
            )
        solid = hit[:, 0] >= 0
        if self.haze < rays.FAR:
            level = horizontal(direction[solid]) + 0.03 * UP
            clear = np.exp(-distance[solid] / self.haze)
            out[solid] = mix(self.outside(level, 0.2), out[solid], clear)
        return out

    def _trace(self, origin: Array, direction: Array) -> tuple[Array, NDArray[np.int64]]:
        distance, hit = np.empty(len(direction)), np.empty((len(direction), 3), np.int64)
        rays.trace(origin, direction, *self._solids, *self._panels, distance, hit)
        return distance, hit

    def _normal(self, point: Array, hit: NDArray[np.int64], direction: Array) -> Array:
        bounds, kind, _ = self._solids
        axis = hit[:, 1] // 2
        normal = np.zeros_like(point)
        row = np.arange(len(point))
        normal[row, axis] = -np.sign(direction[row, axis])
        round_ = (hit[:, 0] >= 0) & (kind[hit[:, 0]] == rays.CYLINDER) & (hit[:, 1] == 0)
        box = bounds[hit[round_, 0]]
        radial = point[round_] - 0.5 * (box[:, :3] + box[:, 3:])
        radial[:, 1] = 0.0
        normal[round_] = radial / np.linalg.norm(radial, axis=1, keepdims=True)
        return normal

    def _surface(
        self, origin: Array, direction: Array, distance: Array, hit: NDArray[np.int64], width: float
    ) -> tuple[Array, Array, Array]:
        """Radiance (n, 3) of what rays hit without its gloss, the points hit and their normals."""
        point = origin + direction * distance[:, None]
        normal = self._normal(point, hit, direction)
        out = np.zeros_like(point)
        missed = hit[:, 0] < 0
        if missed.any():
            out[missed] = self.outside(direction[missed], width)
        irradiance = np.zeros_like(point)
        bounds, kind, _ = self._solids
        solids_of = self._grid.offset, self._grid.size, bounds, kind
        look_up_all(self.irradiance, *solids_of, hit, point, irradiance)
        bare = np.flatnonzero(~missed & (hit[:, 2] < 0))
        irradiance[bare] += self._sunlight(point[bare], normal[bare])
        spread = distance * width / np.sqrt(np.clip(-np.sum(direction * normal, axis=1), 0.02, 1.0))
        materials, material_of = self._materials
        which = material_of[hit[bare, 0]]
        for index, material in enumerate(materials):
            at = bare[which == index]
            if len(at):
                flat = surface_coordinates(point[at], hit[at, 1] // 2)
                factor = material.texture(point[at], flat, spread[at])
                out[at] = np.array(material.albedo) * factor * irradiance[at] / math.pi
                if material.emission is not None:
                    out[at] += material.emission(point[at], flat, spread[at])
        self._add_panels(out, direction, point, hit, irradiance, width)
        return out, point, normal

    def _add_panels(
        self, out: Array, direction: Array, point: Array, hit: NDArray[np.int64], light: Array,
        width: float,
    ) -> None:  # fmt: skip
        at = np.flatnonzero(hit[:, 2] >= 0)
        if not len(at):
            return
        kinds, colours = self._looks
        kind, colour = kinds[hit[at, 2]], colours[hit[at, 2]]
        clear, glow, paint = (kind == which for which in (CLEAR, GLOW, PAINT))
        if clear.any():
            out[at[clear]] = colour[clear] * self.outside(direction[at[clear]], width)
        out[at[glow]] = colour[glow]
        mottle = 1.0 + 0.2 * fractal(point[at[paint]], 0.01, 0.2, 3, 0.5, 990)
        out[at[paint]] = colour[paint] * light[at[paint]] / math.pi * mottle[:, None]
        self._add_patterns(out, point[at], hit[at], at)

    def _add_patterns(
        self, out: Array, point: Array, hit: NDArray[np.int64], at: NDArray[np.int64]
    ) -> None:
        """Multiply the radiance of points on panels by what is painted on their glass."""
        for index in np.unique(hit[:, 2]):
            panel = self._ordered[index]
            if panel.pattern is None and panel.soft == 0.0:
                continue
            mine = np.flatnonzero(hit[:, 2] == index)
            out[at[mine]] *= panel.factor(*panel.place_on(point[mine]))

    def _mirrored(
        self, direction: Array, point: Array, normal: Array, hit: NDArray[np.int64],
        distance: Array, width: float,
    ) -> Array:  # fmt: skip
        """Mirrored radiance (n, 3) times Fresnel's factor, with highlights of the lamps."""
        spread = distance * width
        wave = np.stack(
            [fractal(point, spread, 0.35, 4, 0.5, 1000 + 10 * k) for k in range(3)], axis=1
        )
        bent = normal + 0.03 * wave
        bent /= np.linalg.norm(bent, axis=1, keepdims=True)
        cosine = np.clip(-np.sum(direction * bent, axis=1), 0.02, 1.0)
        fresnel = 0.04 + 0.96 * (1.0 - cosine) ** 5
        mirrored = direction + 2.0 * cosine[:, None] * bent
        mirrored /= np.linalg.norm(mirrored, axis=1, keepdims=True)
        origin = point + 1e-3 * normal
        far, second = self._trace(origin, mirrored)
        radiance, _, _ = self._surface(origin, mirrored, far, second, 3.0 * width)
        materials, material_of = self._materials
        polish = np.array([m.polish for m in materials])[material_of[hit[:, 0]]]
        add_highlights(self._lamp_samples, origin, direction, bent, polish, radiance)
        return radiance * fresnel[:, None]
