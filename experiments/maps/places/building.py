"""Putting places together: walls by name, windows with bars, paintings, lamps, a garden outside."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from experiments.maps.places.lamps import Lamp
from experiments.maps.places.land import Ground, Land, Ridge
from experiments.maps.places.materials import Material
from experiments.maps.places.parts import CLEAR, GLOW, PAINT, Panel, Pattern, Solid
from experiments.maps.places.place import Place, black_sky
from experiments.maps.places.rays import BOX, CYLINDER, FAR
from experiments.maps.places.shapes import Array, Point, Shade
from experiments.maps.places.sky import ClearSky, Sun, overcast

Range = tuple[float, float]

FACES = {"x-": 0, "x+": 1, "y-": 2, "y+": 3, "z-": 4, "z+": 5}
SKIN = 0.02


def garden(brightness: float, sun: Sun | None = None, grey: float = 0.25) -> Shade:
    """The view from a window: sky over trees and grass, `brightness` times its true radiance."""
    ground = Ground(((0.05, 0.09, 0.02), (0.12, 0.13, 0.05)), 3.0, 0.3, 0.8, 0.6, eye=2.5)
    leaves = ((0.02, 0.04, 0.012), (0.08, 0.10, 0.03))
    trees = (Ridge(7.0, 7.0, leaves, "trees", 0.5, 60.0, seed=650),)
    if sun is None:
        land = Land.under(lambda d, w: overcast(d, w, 0.9, grey), ground, trees)
    else:
        clear = ClearSky(sun, 3.0)
        land = Land.under(lambda d, w: clear(d), ground, trees, sun)
    return lambda direction, width: brightness * land(direction, width)


class Builder:
    """Collects the parts of a place: a room between two corners or, without a wall, open ground.

    Floor and ceiling are slabs with materials of their own.
    """

    def __init__(
        self,
        low: Point,
        high: Point,
        wall: Material | None,
        floor: Material,
        ceiling: Material | None = None,
    ) -> None:
        room = wall is not None
        self.room = room
        self.solids: list[Solid] = []
        self.panels: list[Panel] = []
        self.lamps: list[Lamp] = []
        if wall is not None:
            self.solids.append(Solid(low, high, wall))
        self.solids.append(
            Solid((low[0], low[1] - 1.0, low[2]), (high[0], low[1] + SKIN * room, high[2]), floor)
        )
        if ceiling is not None:
            top = high[1] - SKIN
            self.solids.append(
                Solid((low[0], top, low[2]), (high[0], high[1] + 1.0, high[2]), ceiling)
            )

    def box(self, low: Point, high: Point, material: Material) -> int:
        """Add a box; returns its index."""
        self.solids.append(Solid(low, high, material, BOX))
        return len(self.solids) - 1

    def cylinder(self, foot: Point, radius: float, height: float, material: Material) -> int:
        """Add an upright cylinder that stands on `foot`; returns its index."""
        x, y, z = foot
        low, high = (x - radius, y, z - radius), (x + radius, y + height, z + radius)
        self.solids.append(Solid(low, high, material, CYLINDER))
        return len(self.solids) - 1

    def panel(
        self,
        face: str,
        along: Range,
        up: Range,
        kind: int,
        colour: ArrayLike,
        solid: int = 0,
        soft: float = 0.0,
        light: bool = True,
        pattern: Pattern | None = None,
    ) -> None:
        """Add a panel; along and up are (z, y) on x faces, (x, y) on z faces, (x, z) on y faces."""
        value = np.asarray(colour, np.float64)
        self.panels.append(Panel(solid, FACES[face], along, up, kind, value, soft, light, pattern))

    def glow(
        self, face: str, along: Range, up: Range, radiance: ArrayLike, solid: int = 0,
        soft: float = 0.0, pattern: Pattern | None = None,
    ) -> None:  # fmt: skip
        """A glowing screen on a face."""
        self.panel(face, along, up, GLOW, radiance, solid, soft, True, pattern)

    def painting(self, face: str, along: Range, up: Range, colour: ArrayLike) -> None:
        """A picture in a dark frame."""
        w = 0.05
        inner = (along[0] + w, along[1] - w), (up[0] + w, up[1] - w)
        self.panel(face, *inner, PAINT, colour)
        self.panel(face, along, up, PAINT, (0.05, 0.035, 0.02))

    def window(
        self,
        face: str,
        along: Range,
        up: Range,
        panes: tuple[int, int] = (2, 2),
        tint: ArrayLike = (0.88, 0.9, 0.88),
        frame: ArrayLike = (0.6, 0.58, 0.55),
        bar: float = 0.05,
    ) -> None:
        """Panes in a grid of bars within a frame."""
        n, m = panes
        tints = np.broadcast_to(np.asarray(tint, np.float64), (n, m, 3))
        pitch = (along[1] - along[0] - bar) / n, (up[1] - up[0] - bar) / m
        for i in range(n):
            for j in range(m):
                s, t = along[0] + bar + i * pitch[0], up[0] + bar + j * pitch[1]
                across = (s, s + pitch[0] - bar), (t, t + pitch[1] - bar)
                self.panel(face, *across, CLEAR, tints[i, j])
        rim = 0.04
        outer = (along[0] - rim, along[1] + rim), (up[0] - rim, up[1] + rim)
        self.panel(face, *outer, PAINT, frame)

    def globe(self, centre: Point, radius: float, radiance: ArrayLike) -> None:
        """A lamp that shines all round."""
        self.lamps.append(Lamp(centre, radius, np.asarray(radiance, np.float64)))

    def spotlight(
        self, centre: Point, radius: float, radiance: ArrayLike, target: Point, focus: float
    ) -> None:
        """A lamp that shines towards a point; see `Lamp` for the focus."""
        way = np.subtract(target, centre)
        aim = tuple(way / np.linalg.norm(way))
        self.lamps.append(Lamp(centre, radius, np.asarray(radiance, np.float64), None, aim, focus))

    def tube(
        self, start: Point, end: Point, radius: float, radiance: ArrayLike,
        aim: Point = (0.0, 0.0, 0.0),
    ) -> None:  # fmt: skip
        """A slender tube."""
        self.lamps.append(Lamp(start, radius, np.asarray(radiance, np.float64), end, aim))

    def ring(
        self, centre: Point, radius: float, count: int, size: float, radiance: ArrayLike
    ) -> None:
        """Globes in a level ring."""
        for k in range(count):
            turn = 2.0 * math.pi * k / count
            x, z = centre[0] + radius * math.cos(turn), centre[2] + radius * math.sin(turn)
            self.globe((x, centre[1], z), size, radiance)

    def place(
        self,
        eye: Point,
        outside: Shade = black_sky,
        sun: Sun | None = None,
        spacing: float = 0.25,
        haze: float = FAR,
        leaves: Callable[[Array], Array] | None = None,
    ) -> Place:
        """The finished place."""
        return Place(
            self.solids, eye, self.panels, self.lamps, self.room, outside, sun, leaves, spacing,
            haze,
        )  # fmt: skip
