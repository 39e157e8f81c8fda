"""The parts of a built place: solids, and panels on their faces."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.maps.places.materials import Material
from experiments.maps.places.rays import BOX
from experiments.maps.places.shapes import Array, Point

Pattern = Callable[[Array, Array], Array]

CLEAR, GLOW, PAINT = 0, 1, 2


@dataclass(frozen=True)
class Solid:
    """A box from `low` to `high`, or the upright cylinder inscribed in it."""

    low: Point
    high: Point
    material: Material
    kind: int = BOX


@dataclass(frozen=True, eq=False)
class Panel:
    """A rectangle on a face: (along, up) or (x, z) ranges.

    kind : CLEAR shows the outside times `colour`, GLOW emits it, PAINT reflects it
    soft : how far a glow falls off from its middle to its rim, 0 to 1
    pattern : factor (n, 3) over coordinates from −1 to 1 along the face's two axes after its own
    light : whether it is a light source of the place
    """

    solid: int
    face: int
    along: tuple[float, float]
    up: tuple[float, float]
    kind: int
    colour: Array
    soft: float = 0.0
    light: bool = True
    pattern: Pattern | None = None

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """Bounds in the two axes after the face's own."""
        (s0, s1), (t0, t1) = self.along, self.up
        return (s0, t0, s1, t1) if self.face // 2 == 2 else (t0, s0, t1, s1)

    def place_on(self, point: Array) -> tuple[Array, Array]:
        """Coordinates (n,) from −1 to 1 over the panel of points (n, 3) on it."""
        axis, r = self.face // 2, self.rectangle
        u = 2.0 * (point[:, (axis + 1) % 3] - r[0]) / (r[2] - r[0]) - 1.0
        v = 2.0 * (point[:, (axis + 2) % 3] - r[1]) / (r[3] - r[1]) - 1.0
        return u, v

    def factor(self, u: Array, v: Array) -> Array:
        """What softness and pattern make of the colour, (n, 1) or (n, 3)."""
        fall = 1.0 - self.soft * np.clip(0.5 * (u * u + v * v), 0.0, 1.0)
        return fall[:, None] if self.pattern is None else fall[:, None] * self.pattern(u, v)

    def samples(self, solid: Solid, inward: bool) -> list[list[float]]:
        """Rows of light samples for `lightmap.irradiance`."""
        axis = self.face // 2
        a, b = (axis + 1) % 3, (axis + 2) % 3
        r = self.rectangle
        sides = r[2] - r[0], r[3] - r[1]
        count = [int(np.clip(round(side / 0.45), 1, 4)) for side in sides]
        sign = (1.0 if self.face % 2 else -1.0) * (-1.0 if inward else 1.0)
        area = sides[0] * sides[1] / (count[0] * count[1])
        grid = (np.indices((16, 16)).reshape(2, -1) + 0.5) / 8.0 - 1.0
        weight = self.colour * area * self.factor(*grid).mean(axis=0)
        rows = []
        for i in range(count[0]):
            for j in range(count[1]):
                point, normal = [0.0] * 3, [0.0] * 3
                point[axis] = (solid.high if self.face % 2 else solid.low)[axis] + 5e-3 * sign
                point[a] = r[0] + sides[0] * (i + 0.5) / count[0]
                point[b] = r[1] + sides[1] * (j + 0.5) / count[1]
                normal[axis] = sign
                window = 1.0 if self.kind == CLEAR else 0.0
                rows.append([*point, *normal, *weight, window, 0.3 * area, 1.0])
        return rows
