"""Maps of open country without a sun: after sunset, by the moon, by stars, under an aurora."""

import math

import numpy as np

from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.colours import balanced, daylight
from experiments.maps.places.emitters import disc
from experiments.maps.places.evening import aurora, milky_way, night_air, stars, twilight
from experiments.maps.places.land import Ground, Land, Ridge, Water
from experiments.maps.places.noise import smoothstep
from experiments.maps.places.raster import Picture
from experiments.maps.places.shapes import Array
from experiments.maps.places.sky import Clouds, Sun, sun, towards

ROCK = ((0.09, 0.085, 0.085), (0.17, 0.16, 0.15))
FIRS = ((0.010, 0.014, 0.010), (0.025, 0.032, 0.02))


@embedded_map("sunset-mountains", "dusk")
def sunset_mountains() -> Picture:
    """The last of the sun behind mountains, mirrored in a lake under burning clouds."""
    sky = twilight(-25.0, 1.1, 0.45)
    ridges = (
        Ridge(14.0, 8.0, ROCK, "mountains", 0.7, 12000.0, 22000.0, 16.0, seed=661),
        Ridge(7.0, 6.0, ROCK, "mountains", 0.5, 5000.0, 22000.0, seed=671),
        Ridge(3.0, 3.0, FIRS, "firs", 0.3, 500.0, 22000.0, seed=680),
    )
    low = sun(-25.0, 2.0, 4.0)
    compass = towards(-25.0, 0.0)[None, :]
    top = max(float(ridge.profile(compass, 1e-3)[0]) for ridge in ridges)
    last = Sun(towards(-25.0, math.degrees(top) + 0.2), 0.5 * low.radiance)
    return Picture(Land.under(sky, Water(0.03, 1.5, eye=2.0), ridges, last), [last.emitter])


@embedded_map("moonlit-hills", "night")
def moonlit_hills() -> Picture:
    """A full moon among thin clouds over hills, a farm with two lit windows."""
    blue = daylight(12000.0)
    moon = Sun(towards(35.0, 41.0), 5200.0 * daylight(7500.0), math.radians(0.26))
    clouds = Clouds(0.50, 1.2, 1.2, seed=61)

    def sky(direction: Array, width: float) -> Array:
        cos_gamma = np.clip(direction @ moon.direction, -1.0, 1.0)
        halo = 0.10 * np.exp(-(1.0 - cos_gamma) * 60.0) + 0.02 * np.exp(-(1.0 - cos_gamma) * 6.0)
        air = 0.010 / (0.3 + np.maximum(direction[:, 1], 0.0)) + halo
        depth = clouds.optical_depth(direction, width)
        veil = (1.0 - np.exp(-depth)) * smoothstep(0.0, 0.1, direction[:, 1])
        lit = (0.02 + 6.0 * halo * np.exp(-0.4 * depth)) * (0.4 + 0.6 * np.exp(-0.5 * depth))
        return (air + veil * (lit - 0.6 * air))[:, None] * blue

    grass = Ground(
        ((0.05, 0.07, 0.03), (0.12, 0.12, 0.06)),
        patch=6.0, grain=0.2, contrast=0.9, relief=0.8, bump=(0.9, 0.9, 0.9), seed=200,
    )  # fmt: skip
    ridges = (
        Ridge(6.0, 4.0, ((0.05, 0.06, 0.04), (0.10, 0.10, 0.07)), "hills", 0.8, 6000.0, 9000.0,
              seed=691),
        Ridge(4.0, 4.0, FIRS, "trees", 0.4, 200.0, 9000.0, seed=700),
    )  # fmt: skip
    windows = [
        disc(towards(azimuth, 1.1), math.radians(0.10), 5.0 * balanced(2500.0, 3600.0), 4)
        for azimuth in (-71.0, -69.6)
    ]
    dim = [*windows, *stars(300, 0.3, 5)]
    land = Land.under(sky, grass, ridges, moon)
    return Picture(land, [moon.emitter, *dim])


@embedded_map("starry-desert", "night")
def starry_desert() -> Picture:
    """The Milky Way over dunes, a camp fire, and no moon."""
    pole = towards(70.0, 28.0)

    def sky(direction: Array, width: float) -> Array:
        return night_air(direction, 0.022) + milky_way(direction, width, pole, 0.035)

    sand = Ground(
        ((0.36, 0.26, 0.16), (0.44, 0.33, 0.21)),
        patch=20.0, grain=0.08, contrast=0.35, relief=1.1, bump=(3.5, 3.5, 1.6), haze=8000.0,
        seed=220,
    )  # fmt: skip
    rock = ((0.12, 0.07, 0.05), (0.18, 0.12, 0.08))
    ridges = (
        Ridge(3.0, 4.0, rock, "mountains", 0.6, 6000.0, 30000.0, seed=711),
        Ridge(2.0, 2.5, rock, "hills", 0.35, 1500.0, 30000.0, seed=715),
    )
    camp = disc(towards(-110.0, -0.4), math.radians(0.22), 60.0 * balanced(2000.0, 3600.0), 12)
    return Picture(Land.under(sky, sand, ridges), [camp, *stars(2200, 0.35, 9)])


@embedded_map("aurora-fjord", "night")
def aurora_fjord() -> Picture:
    """Green curtains over a fjord between snowy mountains."""

    def sky(direction: Array, width: float) -> Array:
        return night_air(direction, 0.012) + aurora(direction, width, 0.5)

    ridges = (
        Ridge(20.0, 10.0, ((0.05, 0.055, 0.065), (0.16, 0.17, 0.19)), "mountains", 0.7, 5000.0,
              60000.0, 13.0, seed=723),
        Ridge(3.0, 4.0, ((0.03, 0.03, 0.03), (0.06, 0.06, 0.06)), "hills", 0.5, 1200.0, 60000.0,
              seed=727),
    )  # fmt: skip
    cabins = [
        disc(towards(azimuth, 0.5), math.radians(0.10), 14.0 * balanced(2600.0, 3600.0), 8)
        for azimuth in (-150.0, -148.5, -31.0, 62.0, 63.1)
    ]
    land = Land.under(sky, Water(0.05, 1.2, (0.002, 0.004, 0.006), 3.0), ridges)
    return Picture(land, [*cabins, *stars(900, 0.2, 15, 0.2)])
