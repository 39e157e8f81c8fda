"""Maps of a forest, of a cave, and of nothing: one constant radiance."""

import math
from dataclasses import dataclass

import numpy as np

from experiments.maps.places.building import Builder
from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.emitters import frame
from experiments.maps.places.furnishing import bark, forest_floor
from experiments.maps.places.land import Ground, Land, Ridge, horizontal
from experiments.maps.places.materials import Material
from experiments.maps.places.noise import cell_random, fractal, mix, smoothstep
from experiments.maps.places.raster import Picture
from experiments.maps.places.shapes import Array
from experiments.maps.places.sky import ClearSky, Sun, shell_point, sun, towards


def canopy(point: Array, width: Array | float) -> Array:
    """Density of leaves over points of the crowns' layer, positive where they hide the sky."""
    leaves = fractal(point, width, (0.42, 0.9, 0.42), 7, 0.72, 1200)
    crowns = fractal(point, width, 2.2, 2, 0.5, 1220)
    return leaves + 0.8 * crowns + 0.14


@embedded_map("forest-sun-flecks", "forest")
def forest() -> Picture:
    """High trees; the sun breaks through leaves and flecks the ground."""
    light = sun(-50.0, 52.0, 3.0)
    through = Sun(light.direction, 0.45 * light.radiance)
    clear = ClearSky(light, 3.0)

    def leaves_above(direction: Array, width: float) -> Array:
        point, spread = shell_point(direction, width, 0.05)
        density = canopy(point, spread)
        cos_gamma = np.clip(direction @ light.direction, -1.0, 1.0)
        glow = 0.10 + 0.5 * np.exp(-(1.0 - cos_gamma) * 5.0)
        thin = np.exp(-4.0 * np.maximum(density, 0.0))
        leaf = mix((0.010, 0.018, 0.006), (0.55, 0.75, 0.10), glow * thin)
        gap = smoothstep(0.05, -0.05, density) * smoothstep(0.03, 0.30, direction[:, 1])
        above = mix(leaf, clear(direction), gap)
        trunks = fractal(horizontal(direction), width, 0.05, 3, 0.6, 1240)
        stems = mix((0.015, 0.018, 0.010), (0.10, 0.13, 0.04), smoothstep(-0.25, 0.35, trunks))
        leafy = fractal(direction, width, 0.10, 6, 0.7, 1250)
        stems = stems * np.exp(1.2 * leafy)[:, None]
        return mix(stems, above, smoothstep(0.02, 0.20, direction[:, 1] + 0.12 * leafy))

    def flecks(point: Array) -> Array:
        way = (12.0 - point[:, 1]) / light.direction[1]
        layer = (point + way[:, None] * light.direction) / 12.0
        return smoothstep(0.06, -0.06, canopy(layer * [1.0, 0.0, 1.0] + [0.0, 1.0, 0.0], 0.01))

    wood = Builder((-70.0, 0.0, -70.0), (70.0, 0.0, 70.0), None, forest_floor())
    brown = bark()
    for k in range(70):
        far, turn = 2.6 + 0.55 * k * (0.7 + 0.6 * float(cell_random(k, 71))), 2.39996 * k
        x, z = far * math.sin(turn), far * math.cos(turn)
        wood.cylinder((x, 0.0, z), 0.12 + 0.22 * float(cell_random(k, 72)), 30.0, brown)
    moss = Material((0.06, 0.08, 0.03), brown.texture)
    for x, z, s in ((2.0, 3.5, 0.5), (-3.4, 1.2, 0.7), (1.1, -4.0, 0.4), (-1.8, -2.6, 0.3)):
        wood.box((x, 0.0, z), (x + 1.3 * s, 0.7 * s, z + s), moss)
    wood.box((-2.6, 0.12, 4.6), (2.8, 0.55, 5.0), brown)
    return wood.place(
        (-1.5, 1.6, 0.0), leaves_above, through, spacing=1.6, leaves=flecks, haze=45.0,
    ).picture()  # fmt: skip


@dataclass(frozen=True, eq=False)
class Cave:
    """A hollow whose wall stands at a distance that is noise over directions, and its mouth.

    The wall is lit by points of the mouth, each as bright as what is seen through it, and by what
    little the rock scatters back.
    """

    view: Land
    mouth: Array
    opening: float = 0.46
    size: float = 4.0

    def distance(self, direction: Array, width: float) -> Array:
        swell = fractal(direction, width, 0.9, 2, 0.5, 1300)
        rock = fractal(direction, np.maximum(width, 0.008), 0.55, 4, 0.42, 1310, True)
        floor = 1.6 / np.maximum(-direction[:, 1], 0.12)
        hollow = self.size * np.exp(0.7 * swell - 0.13 * rock)
        return np.minimum(hollow, floor * np.exp(-0.10 * rock))

    def points_of_mouth(self) -> tuple[Array, Array]:
        """Points (m, 3) of the mouth and the light that each sends, per steradian and m²."""
        u, v = frame(self.mouth)
        k = np.arange(9) + 0.5
        radius, turn = math.tan(self.opening) * np.sqrt(k / 9.0), k * 2.39996
        way = self.mouth + radius[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        area = math.pi * (1.6 * self.size * math.tan(self.opening)) ** 2 / 9.0
        return 1.6 * self.size * way, self.view(way, 0.1) * area

    def wall(self, direction: Array, width: float) -> Array:
        """Radiance (n, 3) of the rock."""
        here = self.distance(direction, width)
        point = direction * here[:, None]
        side = np.cross(direction, [0.31, 0.83, 0.46])
        side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-6)
        step = 0.01
        edges = []
        for tangent in (side, np.cross(direction, side)):
            turned = direction + step * tangent
            turned /= np.linalg.norm(turned, axis=1, keepdims=True)
            edges.append(turned * self.distance(turned, width)[:, None] - point)
        normal = np.cross(edges[0], edges[1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        normal *= -np.sign(np.sum(normal * direction, axis=1))[:, None]
        light = np.zeros_like(direction)
        for place, weight in zip(*self.points_of_mouth(), strict=True):
            way = place - point
            square = np.einsum("nk,nk->n", way, way)
            way /= np.sqrt(square)[:, None]
            facing = np.maximum(np.einsum("nk,nk->n", way, normal), 0.0) * np.abs(way @ self.mouth)
            light += (facing / (square + 0.5))[:, None] * weight
        bounce = 0.30 * np.exp(-0.30 * np.linalg.norm(point - self.size * self.mouth, axis=1))
        light += bounce[:, None] * np.array([1.0, 0.85, 0.65])
        strata = fractal(point, here * width, (1.4, 0.22, 1.4), 5, 0.6, 1330)
        damp = fractal(point, here * width, 0.9, 4, 0.5, 1350)
        colour = mix((0.10, 0.075, 0.05), (0.34, 0.27, 0.19), smoothstep(-0.4, 0.4, strata))
        return colour * np.exp(0.5 * damp)[:, None] * light / math.pi

    def __call__(self, direction: Array, width: float) -> Array:
        off = np.arccos(np.clip(direction @ self.mouth, -1.0, 1.0))
        inside = off > self.opening - 0.4
        rim = np.flatnonzero(np.abs(off - self.opening) < 0.4)
        ragged = fractal(direction[rim], width, 0.35, 7, 0.6, 1370)
        inside[rim] = off[rim] + 0.28 * ragged > self.opening
        out = np.empty_like(direction)
        if inside.any():
            out[inside] = self.wall(direction[inside], width)
        if not inside.all():
            out[~inside] = self.view(direction[~inside], width)
        return out


@embedded_map("cave-mouth", "interior")
def cave_mouth() -> Picture:
    """From inside a cave: rock around, a bright valley through the mouth."""
    light = sun(150.0, 40.0, 3.0)
    clear = ClearSky(light, 3.0)
    grass = Ground(((0.06, 0.10, 0.03), (0.16, 0.15, 0.06)), 5.0, 0.4, 0.8, 0.7, eye=12.0, seed=240)
    green = ((0.05, 0.08, 0.03), (0.12, 0.13, 0.06))
    ridges = (
        Ridge(6.0, 5.0, ((0.2, 0.18, 0.16), (0.3, 0.27, 0.24)), "mountains", 0.6, 9000.0, seed=741),
        Ridge(2.0, 3.0, green, "trees", 0.4, 900.0, seed=745),
    )
    valley = Land.under(
        lambda d, w: 5.0 * clear(d), grass, ridges, Sun(light.direction, 5.0 * light.radiance)
    )
    return Picture(Cave(valley, towards(8.0, 6.0)))


@embedded_map("constant", "uniform")
def constant() -> Picture:
    """Radiance ½ from everywhere: the one map without any texture."""
    return Picture(lambda direction, width: np.full_like(direction, 0.5))
