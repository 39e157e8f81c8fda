"""Open country: level ground or water under a sky, ridges and trees along the horizon.

The ground is a plane below the eye, textured where rays meet it and lit by the sun and by the
sky's irradiance; its bumps are a noise field whose slope tilts the normal. Ridges are silhouettes
whose height is noise along the circle of the horizon; they fade with distance into the colour that
the sky has at the horizon there. Water mirrors the sky in waves and glitters with the slopes of Cox
& Munk, "Measurement of the roughness of the sea surface from photographs of the sun's glitter",
J. Opt. Soc. Am. 1954.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from experiments.maps.places.noise import cell_random, fractal, mix, smoothstep
from experiments.maps.places.shapes import Array, Shade
from experiments.maps.places.sky import Sun
from samplers.sphere import direction_from_uv, pixel_directions, row_solid_angle

UP = np.array([0.0, 1.0, 0.0])
TABLE_HEIGHT = 32
RIM = 128
"""Points of the horizon whose colour is kept for what fades into it."""


def sky_table(sky: Shade) -> Array:
    """Radiance (32, 64, 3) of a sky on a coarse map, for what needs averages only."""
    direction = pixel_directions(TABLE_HEIGHT).reshape(-1, 3)
    return sky(direction, math.pi / TABLE_HEIGHT).reshape(TABLE_HEIGHT, -1, 3)


def sky_irradiance(sky: Shade) -> Array:
    """Irradiance (3,) of the upper hemisphere on level ground."""
    half = TABLE_HEIGHT // 2
    radiance = sky_table(sky)[:half].sum(axis=1)
    weight = row_solid_angle(TABLE_HEIGHT, 2 * TABLE_HEIGHT)[:half]
    cosine = np.cos((np.arange(half) + 0.5) * math.pi / TABLE_HEIGHT)
    return (weight * cosine) @ radiance


def horizontal(direction: Array) -> Array:
    """Unit vectors (n, 3) of the compass points of directions (n, 3)."""
    flat = direction * np.array([1.0, 0.0, 1.0])
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)


@dataclass(frozen=True)
class Ground:
    """Level ground `eye` metres below; sizes in metres, colours are albedos.

    colours : two that alternate in patches of size `patch`; `grain` is the size of the texture
    relief : height of the bumps of size `bump` divided by that size
    """

    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    patch: float = 6.0
    grain: float = 0.4
    contrast: float = 0.7
    relief: float = 0.5
    bump: tuple[float, float, float] = (2.0, 2.0, 2.0)
    eye: float = 1.7
    haze: float = 1500.0
    seed: int = 100

    def albedo(self, point: Array, width: Array) -> Array:
        patch = fractal(point, width, self.patch, 5, 0.55, self.seed)
        grain = fractal(point, width, self.grain, 5, 0.65, self.seed + 20)
        colour = mix(self.colours[0], self.colours[1], smoothstep(-0.35, 0.35, patch))
        return colour * np.exp(self.contrast * grain)[:, None]

    def normal(self, point: Array, width: Array) -> Array:
        step = 0.04 * min(self.bump)

        def height(at: Array) -> Array:
            return fractal(at, width, self.bump, 6, 0.5, self.seed + 40)

        here = height(point)
        dx = (height(point + np.array([step, 0.0, 0.0])) - here) / step
        dz = (height(point + np.array([0.0, 0.0, step])) - here) / step
        scale = self.relief * min(self.bump)
        normal = np.stack([-scale * dx, np.ones_like(dx), -scale * dz], axis=1)
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def radiance(self, direction: Array, width: float, scene: "Land") -> Array:
        distance = self.eye / np.maximum(-direction[:, 1], 1e-4)
        point = direction * distance[:, None]
        # A sample is long and thin on ground seen at a grazing angle; the mean serves both ways.
        spread = distance * width / np.sqrt(np.maximum(-direction[:, 1], 1e-4))
        normal = self.normal(point, spread)
        irradiance = scene.ambient * (0.35 + 0.65 * normal[:, 1] ** 3)[:, None]
        if scene.sun is not None:
            cosine = np.maximum(normal @ scene.sun.direction, 0.0)
            irradiance = irradiance + scene.sun.irradiance * cosine[:, None]
        radiance = self.albedo(point, spread) * irradiance / math.pi
        fade = 1.0 - np.exp(-distance / self.haze)
        return mix(radiance, scene.horizon(direction), fade)


@dataclass(frozen=True)
class Water:
    """Sea or lake; roughness is the root mean square slope of the waves."""

    roughness: float = 0.15
    ripple: float = 2.0
    depth_colour: tuple[float, float, float] = (0.004, 0.018, 0.022)
    eye: float = 4.0
    haze: float = 8000.0
    seed: int = 300

    def radiance(self, direction: Array, width: float, scene: "Land") -> Array:
        down = np.maximum(-direction[:, 1], 1e-4)
        distance = self.eye / down
        point = direction * distance[:, None]
        spread = distance * width / np.sqrt(down)
        stretch = (self.ripple, self.ripple, 0.5 * self.ripple)
        tilt = [fractal(point, spread, stretch, 6, 0.6, self.seed + 20 * axis) for axis in range(2)]
        slope = 2.2 * self.roughness * np.minimum(1.0, 12.0 * down)
        normal = np.stack([slope * tilt[0], np.ones_like(down), slope * tilt[1]], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        cosine = np.clip(-np.sum(direction * normal, axis=1), 0.02, 1.0)
        mirrored = direction + 2.0 * cosine[:, None] * normal
        mirrored[:, 1] = np.abs(mirrored[:, 1]) + 1e-3
        mirrored /= np.linalg.norm(mirrored, axis=1, keepdims=True)
        fresnel = 0.02 + 0.98 * (1.0 - cosine) ** 5
        body = np.array(self.depth_colour) * scene.ambient / math.pi
        radiance = mix(body, scene.above(mirrored, width), fresnel)
        if scene.sun is not None:
            radiance = radiance + self._glitter(direction, normal, scene.sun)
        return mix(radiance, scene.horizon(direction), 1.0 - np.exp(-distance / self.haze))

    def _glitter(self, direction: Array, normal: Array, sun: Sun) -> Array:
        half = sun.direction - direction
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        cosine = np.clip(np.sum(half * normal, axis=1), 1e-3, 1.0)
        fresnel = 0.02 + 0.98 * (1.0 - np.clip(half @ sun.direction, 0.0, 1.0)) ** 5
        variance = self.roughness**2
        slopes = np.exp((1.0 - cosine**-2) / variance) / (math.pi * variance * cosine**4)
        view = np.maximum(-direction[:, 1], 0.03)
        return (slopes * fresnel / (4.0 * view))[:, None] * sun.irradiance


@dataclass(frozen=True)
class Ridge:
    """A silhouette along the horizon, `height` degrees high on average.

    shape : "hills", "mountains" (creased), "trees" (round crowns) or "firs" (pointed)
    rough : degrees by which it rises and falls; scale : size of a rise in radians
    snow : elevation in degrees above which it is white, none by default
    """

    height: float
    rough: float
    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    shape: str = "hills"
    scale: float = 0.5
    distance: float = 3000.0
    visibility: float = 12000.0
    snow: float = 90.0
    seed: int = 500

    def profile(self, compass: Array, width: float) -> Array:
        """Elevation in radians above which the sky begins, (n,)."""
        ridged = self.shape == "mountains"
        octaves = 8 if ridged else 6
        gain = 0.45 if self.shape in ("hills", "mountains") else 0.6
        rise = fractal(compass, width, self.scale, octaves, gain, self.seed, ridged)
        elevation = self.height + 1.6 * self.rough * rise
        if self.shape in ("trees", "firs"):
            elevation = elevation + self._crowns(compass)
        return np.radians(elevation)

    def _crowns(self, compass: Array) -> Array:
        count = max(24, int(2.0 * math.pi / (0.35 * math.radians(self.height))))
        turn = (np.arctan2(compass[:, 0], -compass[:, 2]) / (2.0 * math.pi)) % 1.0 * count
        cell = np.floor(turn).astype(np.int64)
        best = np.full(len(turn), -0.5 * self.height)
        for offset in (-1, 0, 1):
            tree = (cell + offset) % count
            place = cell + offset + 0.5 + 0.7 * (cell_random(tree, 1, self.seed) - 0.5)
            size = 0.35 + 0.65 * cell_random(tree, 2, self.seed)
            away = np.abs(turn - place) / (1.1 * size)
            if self.shape == "firs":
                crown = size - 0.8 * away
            else:
                crown = size * np.sqrt(np.maximum(1.0 - away**2, 0.0)) - 0.3
            best = np.maximum(best, 0.7 * self.height * crown)
        return best

    def radiance(self, direction: Array, width: float, top: Array, scene: "Land") -> Array:
        compass = horizontal(direction)
        point = compass + UP * direction[:, 1:2]
        rough = fractal(point, width, 0.30 * self.scale, 7, 0.62, self.seed + 60)
        colour = mix(self.colours[0], self.colours[1], smoothstep(-0.4, 0.4, rough))
        if self.snow < 90.0:
            line = math.radians(self.snow) * (1.0 + 0.5 * rough)
            white = smoothstep(0.85, 1.1, direction[:, 1] / line)
            colour = mix(colour, (0.8, 0.82, 0.86), white)
        elevation = np.arcsin(direction[:, 1])
        rise = np.clip(elevation / np.maximum(top, 1e-3), 0.0, 1.0)
        irradiance = scene.ambient * (0.25 + 0.5 * rise)[:, None]
        if scene.sun is not None:
            irradiance = irradiance + self._sunlit(point, compass, width, scene.sun)
        radiance = colour * np.exp(0.8 * rough)[:, None] * irradiance / math.pi
        fade = 1.0 - math.exp(-self.distance / self.visibility)
        return mix(radiance, scene.horizon(direction), np.full(len(direction), fade))

    def _sunlit(self, point: Array, compass: Array, width: float, sun: Sun) -> Array:
        step = 0.03 * self.scale
        size, octaves = 0.5 * self.scale, 6
        here = fractal(point, width, size, octaves, 0.55, self.seed + 80, True)
        there = fractal(
            point + step * sun.direction, width, size, octaves, 0.55, self.seed + 80, True
        )
        facing = 0.55 * UP - 0.8 * compass
        cosine = facing @ sun.direction + 0.30 * (here - there) * size / step
        return np.clip(cosine, 0.0, 1.0)[:, None] * sun.irradiance


@dataclass(frozen=True, eq=False)
class Land:
    """A sky over ground or water with ridges from far to near; callable as a picture's shade."""

    sky: Shade
    ground: Ground | Water
    ridges: tuple[Ridge, ...] = ()
    sun: Sun | None = None
    ambient: Array = field(default_factory=lambda: np.zeros(3))
    rim: Array = field(default_factory=lambda: np.zeros((RIM, 3)))

    @classmethod
    def under(
        cls,
        sky: Shade,
        ground: Ground | Water,
        ridges: tuple[Ridge, ...] = (),
        sun: Sun | None = None,
    ) -> "Land":
        """The land lit by the irradiance of its own sky."""
        turn = (np.arange(RIM) + 0.5) / RIM
        level = direction_from_uv(turn, np.full(RIM, 0.5 - 0.02 / math.pi))
        rim = sky(level, 2.0 * math.pi / RIM)
        return cls(sky, ground, ridges, sun, sky_irradiance(sky), rim)

    def horizon(self, direction: Array) -> Array:
        """The sky's radiance at the horizon below or above the directions (n, 3)."""
        place = np.arctan2(direction[:, 0], -direction[:, 2]) * (RIM / (2.0 * math.pi)) - 0.5
        first = np.floor(place).astype(np.int64)
        return mix(self.rim[first % RIM], self.rim[(first + 1) % RIM], place - first)

    def above(self, direction: Array, width: float) -> Array:
        """Sky and ridges in directions (n, 3) above the horizon."""
        highest = math.radians(sum(3.0 * (r.height + r.rough) for r in self.ridges))
        out = self.sky(direction, width)
        low = np.flatnonzero(direction[:, 1] < math.sin(min(highest, 1.5)))
        if not len(low):
            return out
        some = direction[low]
        compass, elevation = horizontal(some), np.arcsin(some[:, 1])
        for ridge in self.ridges:
            top = ridge.profile(compass, width)
            hit = np.flatnonzero(elevation < top)
            if len(hit):
                out[low[hit]] = ridge.radiance(some[hit], width, top[hit], self)
        return out

    def __call__(self, direction: Array, width: float) -> Array:
        out = np.empty_like(direction)
        up = direction[:, 1] >= 0.0
        if up.any():
            out[up] = self.above(direction[up], width)
        if not up.all():
            out[~up] = self.ground.radiance(direction[~up], width, self)
        return out
