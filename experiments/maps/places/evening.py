"""Skies without a sun: twilight, the glow over a city, stars and the Milky Way, aurora.

Radiance is that of a camera exposed for the night: ratios within a sky are physical, its level is
not. Stars are emitters far smaller than a texel whose flux falls by 10^(−0.4) per magnitude, with
2.5 times more of them each, as they are counted in the real sky.
"""

import math

import numpy as np

from experiments.maps.places.colours import balanced, blackbody, daylight, spectral_line
from experiments.maps.places.emitters import Emitter, disc
from experiments.maps.places.noise import fractal, mix, smoothstep
from experiments.maps.places.shapes import Array, Shade
from experiments.maps.places.sky import shell_point, towards

STAR_HALF_ANGLE = math.radians(0.012)


def twilight(azimuth: float, level: float, clouds: float = 0.0, seed: int = 41) -> Shade:
    """The sky when the sun is a few degrees under the horizon at an azimuth in degrees.

    Above the sun glows a low arch, opposite to it the shadow of the earth rises under a pink belt.
    """
    west = towards(azimuth, 0.0)
    arch, gold = blackbody(1900.0), blackbody(2600.0)
    belt, blue = mix(blackbody(3000.0), daylight(9000.0), 0.35), daylight(20000.0)

    def sky(direction: Array, width: float) -> Array:
        up = np.maximum(direction[:, 1], 0.0)
        side = direction @ west / np.maximum(np.sqrt(1.0 - up * up), 0.05)
        near = np.clip(0.5 + 0.5 * side, 0.0, 1.0)
        out = (0.16 + 0.22 * near * np.exp(-1.8 * up))[:, None] * blue
        out += (1.3 * near**3 * np.exp(-up / 0.13))[:, None] * gold
        out += (1.7 * near**10 * np.exp(-up / 0.055))[:, None] * arch
        out += (0.16 * (1.0 - near) ** 2 * np.exp(-(((up - 0.19) / 0.10) ** 2)))[:, None] * belt
        out *= (1.0 - 0.35 * (1.0 - near) * np.exp(-((up / 0.09) ** 2)))[:, None]
        if clouds > 0.0:
            out = _evening_clouds(out, direction, width, near, clouds, seed)
        return level * out

    return sky


def _evening_clouds(
    sky: Array, direction: Array, width: float, near: Array, cover: float, seed: int
) -> Array:
    """Bars of cloud lit from below in the west, dark elsewhere."""
    point, spread = shell_point(direction, width, 6e-3)
    bars = fractal(point, spread, (2.6, 1.0, 1.3), 7, 0.52, seed)
    depth = np.maximum(bars + 1.3 * (cover - 0.5), 0.0)
    veil = 1.0 - np.exp(-7.0 * depth)
    glow = (2.2 * near**4 * np.exp(-2.2 * depth) + 0.06)[:, None]
    lit = glow * mix(blackbody(1700.0), blackbody(2900.0), np.clip(1.0 - 3.0 * depth, 0.0, 1.0))
    shade = 0.10 * daylight(12000.0)
    far = smoothstep(0.0, 0.06, direction[:, 1])
    return mix(sky, 0.6 * lit + shade + 0.25 * sky, veil * far)


def city_glow(direction: Array, width: float) -> Array:
    """A hazy night sky over street lamps."""
    up = np.maximum(direction[:, 1], 0.0)
    point, spread = shell_point(direction, width, 6e-3)
    haze = np.exp(0.7 * fractal(point, spread, 3.0, 6, 0.55, 1100))
    low = balanced(2400.0, 3600.0) * (0.035 * np.exp(-5.0 * up))[:, None]
    return haze[:, None] * (low + 0.006 * daylight(9000.0))


def night_air(direction: Array, level: float) -> Array:
    """Airglow: a little brighter towards the horizon."""
    up = np.maximum(direction[:, 1], 0.0)
    tint = mix(daylight(5000.0), daylight(14000.0), np.clip(3.0 * up, 0.0, 1.0))
    return (level / (0.35 + up))[:, None] * 0.5 * tint


def milky_way(direction: Array, width: float, pole: Array, level: float) -> Array:
    """A band along the great circle round `pole` with dark clouds along its middle."""
    across = direction @ pole
    core = np.array([pole[1], -pole[0], 0.0])
    along = 0.5 + 0.5 * (direction @ (core / np.linalg.norm(core)))
    clumps = fractal(direction, width, 0.35, 7, 0.6, 1120)
    dust = fractal(direction, width, 0.28, 7, 0.58, 1140, True)
    band = np.exp(-((across / (0.08 + 0.07 * along)) ** 2))
    lane = np.exp(-(((across - 0.015) / 0.05) ** 2)) * np.clip(0.55 + 2.2 * dust, 0.0, 1.0)
    bright = band * np.exp(1.1 * clumps) * (0.35 + 1.3 * along**2) * (1.0 - 0.85 * lane)
    return (level * bright)[:, None] * mix(daylight(8000.0), blackbody(4500.0), along)


def stars(count: int, faintest: float, seed: int, lowest: float = 0.02) -> list[Emitter]:
    """Stars above a sine of elevation: the faintest has `faintest` units of flux × 10⁻⁶."""
    rng = np.random.default_rng(seed)
    y = rng.uniform(lowest, 1.0, count)
    turn = rng.uniform(0.0, 2.0 * math.pi, count)
    flux = 1e-6 * faintest * rng.uniform(1e-4, 1.0, count) ** -1.0
    kelvin = np.round(rng.choice([3600.0, 4800.0, 6000.0, 8000.0, 11000.0], count))
    area = math.pi * STAR_HALF_ANGLE**2
    flat = np.sqrt(1.0 - y * y)
    directions = np.stack([flat * np.sin(turn), y, flat * np.cos(turn)], axis=1)
    return [
        disc(direction, STAR_HALF_ANGLE, energy / area * blackbody(float(k)), 4)
        for direction, energy, k in zip(directions, flux, kelvin, strict=True)
    ]


def aurora(direction: Array, width: float, level: float) -> Array:
    """Curtains of excited oxygen: green below, red above, seen along rays through eight heights.

    A curtain stands upright over the zero line of a noise field in the plane; its light falls off
    with the distance from that line and, upwards, with the density of the air.
    """
    up = np.maximum(direction[:, 1], 0.03)
    heights = np.array([1.0, 1.08, 1.18, 1.30, 1.46, 1.68, 2.0, 2.5])
    green = level * spectral_line(540.0, 0.25)
    red = level * spectral_line(640.0, 0.25)
    out = np.zeros_like(direction)
    for k, height in enumerate(heights):
        point = direction * (height / up)[:, None]
        point[:, 1] = 0.0
        spread = width * height / up**1.5
        fold = fractal(point, spread, 2.6, 3, 0.42, 1160)
        ray = np.exp(1.8 * fractal(point, spread, 0.16, 2, 0.6, 1180))
        curtain = (
            np.exp(-np.abs(fold) / (0.03 + 0.02 * k))
            * ray
            * smoothstep(0.02, 0.12, direction[:, 1])
        )
        out += (curtain * math.exp(-0.8 * k))[:, None] * green
        out += (0.008 * curtain * k * math.exp(-0.2 * k))[:, None] * red
    return out + (0.05 * np.exp(-3.0 * up))[:, None] * green
