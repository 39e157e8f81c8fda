"""Lamps of built places: globes, tubes, and flat rectangles.

A lamp has two sides: the emitters that the eye sees, and the samples that light the place and leave
highlights on its glossy surfaces. A long lamp is cut into pieces, each shown where the
eye sees the middle of it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.maps.places.emitters import Emitter, disc, polygon
from experiments.maps.places.shapes import Array, Point
from samplers.compiled import kernel

Shows = Callable[[Array], bool]

FAINT = 8.0
"""A highlight ends where its lobe has fallen to exp(−8)."""
PIECE = 0.5
"""A tube is cut into pieces of about this length in metres, at most six."""


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
        count = 1 if self.end is None else min(max(round(math.dist(a, b) / PIECE), 1), 6)
        return [(a + (b - a) * k / count, a + (b - a) * (k + 1) / count) for k in range(count)]

    def _intensity(self) -> Array:
        """Radiance × area that one piece shows sideways."""
        if self.end is None:
            return self.radiance * (math.pi * self.radius**2)
        length = math.dist(self.start, self.end) / len(self._pieces())
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


@kernel
def add_highlights(lights, point, direction, normal, polish, out):
    """Add the mirrored radiance of light samples, each spread over a Blinn lobe, to out (n, 3).

    lights : rows as of `Lamp.samples`; polish : (n,) exponent of the lobe
    """
    for n in range(len(point)):
        for j in range(len(lights)):
            x, y = lights[j, 0] - point[n, 0], lights[j, 1] - point[n, 1]
            z = lights[j, 2] - point[n, 2]
            square = x * x + y * y + z * z + 1e-6
            scale = 1.0 / math.sqrt(square)
            x, y, z = x * scale, y * scale, z * scale
            facing = x * normal[n, 0] + y * normal[n, 1] + z * normal[n, 2]
            if facing <= 0.0:
                continue
            hx, hy, hz = x - direction[n, 0], y - direction[n, 1], z - direction[n, 2]
            length = math.sqrt(hx * hx + hy * hy + hz * hz) + 1e-9
            cosine = (hx * normal[n, 0] + hy * normal[n, 1] + hz * normal[n, 2]) / length
            off = 1.0 - cosine
            if polish[n] * off > FAINT:
                continue
            view = -(direction[n, 0] * normal[n, 0] + direction[n, 1] * normal[n, 1]
                     + direction[n, 2] * normal[n, 2])  # fmt: skip
            # exp(−p (x + x²/2)) is (1 − x)^p to third order, at a fifth of its cost.
            power = math.exp(-polish[n] * off * (1.0 + 0.5 * off))
            lobe = (polish[n] + 2.0) / (8.0 * math.pi) * power / max(view, 0.05)
            if lights[j, 3] != 0.0 or lights[j, 4] != 0.0 or lights[j, 5] != 0.0:
                aim = -(x * lights[j, 3] + y * lights[j, 4] + z * lights[j, 5])
                lobe *= max(aim, 0.0) ** lights[j, 11]
            for c in range(3):
                out[n, c] += lobe * facing / square * lights[j, 6 + c]
