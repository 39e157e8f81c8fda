"""Lamps of built places: globes, tubes, and flat rectangles.

A lamp has three faces: the emitters that the eye sees, the samples that light the place, and the
highlight that it leaves on glossy surfaces. A long lamp is cut into pieces, each shown where the
eye sees the middle of it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.embedded.emitters import Emitter, disc, polygon

Array = NDArray[np.float64]
Point = tuple[float, float, float]
Shows = Callable[[Array], bool]

PIECES = 6


@dataclass(frozen=True, eq=False)
class Lamp:
    """A globe of `radius` at `start`, or a tube of that radius from `start` to `end`.

    radiance : (3,); aim : unit direction where it shines, 0 for all round
    focus : exponent of the cosine to its aim, 1 for a plain reflector, more for a spotlight
    """

    start: Point
    radius: float
    radiance: Array
    end: Point | None = None
    aim: Point = (0.0, 0.0, 0.0)
    focus: float = 1.0

    def _pieces(self) -> list[tuple[Array, Array]]:
        a, b = np.array(self.start), np.array(self.start if self.end is None else self.end)
        count = 1 if self.end is None else PIECES
        return [(a + (b - a) * k / count, a + (b - a) * (k + 1) / count) for k in range(count)]

    def _intensity(self) -> Array:
        """Radiance × area seen of one piece, square to it."""
        if self.end is None:
            return self.radiance * (math.pi * self.radius**2)
        length = math.dist(self.start, self.end) / PIECES
        return self.radiance * (2.0 * self.radius * length)

    def emitters(self, eye: Point, shows: Shows) -> list[Emitter]:
        """What the eye sees of the lamp."""
        origin, out, aim = np.array(eye), [], np.array(self.aim)
        for a, b in self._pieces():
            middle = 0.5 * (a + b) - origin
            distance = float(np.linalg.norm(middle))
            if not shows(0.5 * (a + b) - middle / distance * 1.5 * self.radius):
                continue
            if self.end is None:
                half_angle = math.asin(min(self.radius / distance, 1.0))
                facing = max(-float(aim @ middle) / distance, 0.0) ** self.focus
                seen = 0.04 + 0.96 * facing if aim.any() else 1.0
                out.append(disc(middle, half_angle, self.radiance * seen, 24))
                continue
            side = np.cross(b - a, middle)
            side *= self.radius / np.linalg.norm(side)
            corners = np.array([a - side, b - side, b + side, a + side]) - origin
            out.append(polygon(corners, self.radiance))
        return out

    def samples(self) -> list[list[float]]:
        """Rows of light samples for `lightmap.irradiance`."""
        floor = (2.0 * self.radius) ** 2 + 1e-3
        return [
            [*(0.5 * (a + b)), *self.aim, *self._intensity(), 0.0, floor, self.focus]
            for a, b in self._pieces()
        ]

    def highlight(self, point: Array, direction: Array, normal: Array, polish: Array) -> Array:
        """Mirrored radiance (n, 3): the lamp's irradiance spread over a Blinn lobe."""
        out = np.zeros_like(point)
        for a, b in self._pieces():
            way = 0.5 * (a + b) - point
            square = np.sum(way * way, axis=1) + 1e-6
            way /= np.sqrt(square)[:, None]
            half = way - direction
            half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
            cosine = np.clip(np.sum(half * normal, axis=1), 0.0, 1.0)
            view = np.maximum(-np.sum(direction * normal, axis=1), 0.05)
            lobe = (polish + 2.0) / (8.0 * math.pi) * cosine**polish / view
            if any(self.aim):
                lobe *= np.clip(-(way @ np.array(self.aim)), 0.0, 1.0) ** self.focus
            out += (lobe * np.maximum(np.sum(way * normal, axis=1), 0.0) / square)[:, None] * (
                self._intensity()
            )
        return out
