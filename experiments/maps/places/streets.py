"""Maps among buildings: squares, streets and roofs by day, at dusk and by night."""

import numpy as np

from experiments.maps.places.building import Builder
from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.colours import balanced, blackbody, spectral_line
from experiments.maps.places.evening import city_glow, twilight
from experiments.maps.places.furnishing import leafage
from experiments.maps.places.materials import (
    Material,
    Texture,
    asphalt,
    bricks,
    cobbles,
    concrete,
    facade,
    lit_windows,
    plaster,
)
from experiments.maps.places.noise import cell_random
from experiments.maps.places.raster import Picture
from experiments.maps.places.sky import ClearSky, Clouds, clouded, overcast, sun

WALLS = ((0.52, 0.38, 0.22), (0.58, 0.50, 0.38), (0.44, 0.24, 0.16), (0.50, 0.48, 0.44),
         (0.56, 0.44, 0.30))  # fmt: skip
IRON = Material((0.03, 0.03, 0.032))


def _houses(
    town: Builder, x0: float, x1: float, z0: float, z1: float, seed: int, storeys: float,
    emission: Texture | None = None,
) -> None:  # fmt: skip
    """A row of houses that fills a rectangle, cut along its longer side."""
    along_x = x1 - x0 > z1 - z0
    start, end = (x0, x1) if along_x else (z0, z1)
    at, k = start, 0
    while at < end - 1.0:
        width = min(2.6 * (4 + int(3.0 * cell_random(k, seed, 41))), end - at)
        height = 3.4 * round(storeys - 1.0 + 2.4 * float(cell_random(k, seed, 42))) + 0.9
        wall = WALLS[int(5.0 * cell_random(k, seed, 43))]
        material = Material(wall, facade, emission=emission)
        low = (at, 0.0, z0) if along_x else (x0, 0.0, at)
        high = (at + width, height, z1) if along_x else (x1, height, at + width)
        town.box(low, high, material)
        roof = Material((0.26, 0.12, 0.08), bricks)
        rim = 0.35
        town.box(
            (low[0] - rim, height, low[2] - rim), (high[0] + rim, height + 0.3, high[2] + rim), roof
        )
        town.box(
            (low[0] + 2.0, height, low[2] + 2.0), (high[0] - 2.0, height + 1.9, high[2] - 2.0), roof
        )
        at, k = at + width, k + 1


def _square(town: Builder, storeys: float, emission: Texture | None = None) -> None:
    _houses(town, -34.0, 40.0, 24.0, 36.0, 1, storeys, emission)
    _houses(town, -34.0, 40.0, -38.0, -27.0, 2, storeys, emission)
    _houses(town, 22.0, 33.0, -27.0, 24.0, 3, storeys, emission)
    _houses(town, -33.0, -21.0, -27.0, 8.0, 4, storeys, emission)


def _trees(town: Builder, places: tuple[tuple[float, float], ...]) -> None:
    bark, crown = Material((0.10, 0.075, 0.05)), Material((0.045, 0.075, 0.022), leafage)
    for k, (x, z) in enumerate(places):
        town.cylinder((x, 0.0, z), 0.18, 2.6, bark)
        for layer, (radius, foot, tall) in enumerate(
            ((1.3, 2.2, 0.9), (1.7, 2.9, 1.3), (1.1, 4.1, 0.9))
        ):
            turn = 2.4 * (k + layer)
            town.cylinder(
                (x + 0.35 * np.cos(turn), foot, z + 0.35 * np.sin(turn)), radius, tall, crown
            )


@embedded_map("town-square-afternoon", "sun")
def town_square() -> Picture:
    """Sun at 38° over a square of old houses, a fountain and trees."""
    light = sun(-40.0, 38.0, 4.0)
    sky, veil = ClearSky(light, 4.0), Clouds(0.33, 1.0, 0.8, seed=31)
    town = Builder(
        (-90.0, 0.0, -90.0), (90.0, 0.0, 90.0), None, Material((0.28, 0.25, 0.21), cobbles),
    )  # fmt: skip
    _square(town, 4.2)
    town.box((-31.0, 0.0, 13.0), (-25.0, 27.0, 19.0), Material((0.46, 0.40, 0.31), plaster))
    town.box((-31.4, 27.0, 12.6), (-24.6, 27.6, 19.4), Material((0.26, 0.12, 0.08), bricks))
    stone = Material((0.45, 0.42, 0.37), concrete)
    town.cylinder((-4.0, 0.0, 9.0), 3.0, 0.6, stone)
    town.cylinder((-4.0, 0.6, 9.0), 0.5, 2.2, stone)
    town.cylinder((-4.0, 2.0, 9.0), 1.1, 0.25, stone)
    _trees(town, ((9.0, 6.0), (13.0, -3.0), (10.0, -12.0), (-13.0, -9.0), (-12.0, -17.0)))
    for x, z in ((5.0, -6.0), (-8.0, 3.0)):
        town.box((x, 0.40, z), (x + 1.8, 0.48, z + 0.5), Material((0.25, 0.15, 0.08)))
        town.box((x + 0.1, 0.0, z), (x + 1.7, 0.40, z + 0.4), stone)
    place = town.place((0.0, 1.7, 0.0), lambda d, w: clouded(sky, veil, d, w), light, spacing=2.8)
    return place.picture()


@embedded_map("overcast-courtyard", "overcast")
def overcast_courtyard() -> Picture:
    """A narrow court between tall houses under a grey sky."""
    yard = Builder(
        (-60.0, 0.0, -60.0), (60.0, 0.0, 60.0), None,
        Material((0.17, 0.165, 0.155), cobbles, gloss=0.25),
    )  # fmt: skip
    _houses(yard, -22.0, 24.0, 9.0, 21.0, 5, 5.2)
    _houses(yard, -22.0, 24.0, -24.0, -12.0, 6, 4.6)
    _houses(yard, 9.0, 20.0, -12.0, 9.0, 7, 5.6)
    _houses(yard, -20.0, -8.0, -12.0, 3.0, 8, 4.8)
    yard.box((-4.5, 0.0, 5.0), (-1.0, 2.6, 9.0), Material((0.28, 0.13, 0.09), bricks))
    yard.box((-4.7, 2.6, 4.8), (-0.8, 2.8, 9.2), Material((0.12, 0.12, 0.12)))
    for x in (4.2, 5.3, 6.4):
        yard.box((x, 0.0, -11.6), (x + 0.8, 1.2, -10.9), Material((0.05, 0.10, 0.06)))
    _trees(yard, ((3.6, 3.8),))
    sky = lambda d, w: overcast(d, w, 1.0, 0.4, 8)  # noqa: E731
    return yard.place((0.0, 1.7, -2.0), sky, spacing=1.3).picture()


@embedded_map("night-street-lamps", "night")
def night_street() -> Picture:
    """A wet street at night: two rows of sodium lamps, lit windows, cars."""
    street = Builder(
        (-120.0, 0.0, -160.0), (120.0, 0.0, 160.0), None,
        Material((0.06, 0.06, 0.062), asphalt, 0.9, 250.0),
    )  # fmt: skip
    glow = lit_windows(0.20, 0.35)
    _houses(street, 10.0, 22.0, -88.0, 88.0, 11, 4.4, glow)
    _houses(street, -22.0, -10.0, -88.0, 88.0, 12, 4.8, glow)
    pavement = Material((0.13, 0.13, 0.125), concrete)
    street.box((6.2, 0.0, -90.0), (10.0, 0.15, 90.0), pavement)
    street.box((-10.0, 0.0, -90.0), (-6.2, 0.15, 90.0), pavement)
    sodium = 900.0 * balanced(2150.0, 3200.0)
    for k, z in enumerate(np.arange(-72.0, 73.0, 12.0)):
        for side in (-1.0, 1.0):
            at = z + (6.0 if side > 0 else 0.0)
            street.cylinder((side * 6.9, 0.15, at), 0.07, 5.6, IRON)
            street.box(
                (side * 6.9 - 0.16, 5.95, at - 0.16), (side * 6.9 + 0.16, 6.02, at + 0.16), IRON
            )
            street.globe((side * 6.9, 5.84, at), 0.09, sodium * (0.85 + 0.3 * cell_random(k, 7)))
    for k, (x, z) in enumerate(((4.8, 7.0), (4.8, 15.0), (-4.8, -9.0), (-4.8, 20.0), (4.8, -18.0))):
        body = Material(((0.2, 0.02, 0.02), (0.03, 0.04, 0.08), (0.3, 0.3, 0.3))[k % 3], gloss=1.0)
        street.box((x - 0.85, 0.28, z - 2.1), (x + 0.85, 0.85, z + 2.1), body)
        street.box(
            (x - 0.75, 0.85, z - 1.1), (x + 0.75, 1.4, z + 1.0), Material((0.02,) * 3, gloss=1.0)
        )
    tail = np.array([60.0, 1.5, 0.8])
    for x in (1.5, 2.9):
        street.globe((x, 0.75, 26.0), 0.05, tail)
    for x in (-1.5, -2.9):
        street.globe((x, 0.7, 34.0), 0.07, 700.0 * blackbody(4200.0))
    return street.place((0.4, 1.6, 0.0), city_glow, spacing=3.5).picture()


@embedded_map("neon-alley", "night")
def neon_alley() -> Picture:
    """An alley between brick walls, lit by neon signs on wet ground."""
    alley = Builder(
        (-60.0, 0.0, -60.0), (60.0, 0.0, 60.0), None,
        Material((0.05, 0.05, 0.055), asphalt, 1.0, 160.0),
    )  # fmt: skip
    brick, dark = Material((0.22, 0.12, 0.10), bricks), Material((0.06, 0.06, 0.065))
    alley.box((3.0, 0.0, -30.0), (14.0, 11.0, 30.0), brick)
    alley.box((-14.0, 0.0, -30.0), (-3.2, 13.0, 30.0), brick)
    alley.box((-20.0, 0.0, 30.0), (20.0, 16.0, 40.0),
              Material((0.2, 0.2, 0.22), facade, emission=lit_windows(0.35, 0.15)))  # fmt: skip
    hues = (
        spectral_line(625.0, 0.25), spectral_line(475.0, 0.45), spectral_line(530.0, 0.5),
        spectral_line(640.0, 0.3) + 0.25 * spectral_line(455.0, 0.3), balanced(2600.0, 3600.0),
    )  # fmt: skip
    gases = [170.0 * hue / hue.max() for hue in hues]
    for k, z in enumerate((-12.0, -6.5, -2.0, 3.0, 7.5, 13.0, 19.0)):
        side, y = (2.55 if k % 2 else -2.75), 2.6 + 0.9 * (k % 3)
        _sign(alley, side, y, z, gases[k % 5], gases[(k + 2) % 5], k)
    for k, z in enumerate((-9.0, 0.8, 10.0)):
        alley.box((2.4, 0.0, z), (3.0, 1.2, z + 1.3), dark)
        alley.box(
            (-3.2, 0.0, z + 3.0), (-2.6, 0.9 + 0.3 * k, z + 4.0), Material((0.10, 0.14, 0.10))
        )
        alley.box((2.9, 0.0, z + 3.0), (3.0, 2.2, z + 4.0), dark)
    for z in (-4.0, 6.0, 16.0):
        alley.box((-3.2, 5.4, z), (-2.2, 5.5, z + 3.0), IRON)
        alley.box((-2.25, 5.5, z), (-2.2, 6.4, z + 3.0), IRON)
    alley.globe((-2.9, 2.5, -16.0), 0.08, 260.0 * balanced(2700.0, 3400.0))
    return alley.place((0.0, 1.6, 0.0), city_glow, spacing=0.9).picture()


def _sign(
    alley: Builder, x: float, y: float, z: float, gas: np.ndarray, rim: np.ndarray, seed: int
) -> None:
    """A sign of neon strokes: a frame and a row of letters."""
    tube = 0.009
    tall, wide = 0.55 + 0.15 * (seed % 2), 0.85 + 0.3 * (seed % 3)
    corners = [
        (z - wide, y - tall),
        (z + wide, y - tall),
        (z + wide, y + tall),
        (z - wide, y + tall),
    ]
    for (za, ya), (zb, yb) in zip(corners, corners[1:] + corners[:1], strict=True):
        alley.tube((x, ya, za), (x, yb, zb), tube, rim)
    count = 3 + seed % 3
    pitch = 1.7 * wide / count
    for k in range(count):
        left = z - 0.85 * wide + k * pitch
        right, low, high = left + 0.7 * pitch, y - 0.6 * tall, y + 0.6 * tall
        pick = int(4.0 * cell_random(k, seed, 51))
        strokes = (
            [(left, low, left, high), (left, high, right, high), (left, y, right, y)],
            [(left, low, 0.5 * (left + right), high), (0.5 * (left + right), high, right, low)],
            [(left, low, left, high), (left, low, right, low), (right, low, right, high)],
            [(left, high, right, high), (right, high, left, low), (left, low, right, low)],
        )[pick]
        for za, ya, zb, yb in strokes:
            alley.tube((x, ya, za), (x, yb, zb), tube, gas)


@embedded_map("dusk-skyline", "dusk")
def dusk_skyline() -> Picture:
    """A city seen from a roof a quarter of an hour after sunset, its windows lit."""
    city = Builder(
        (-700.0, -40.0, -700.0), (700.0, -40.0, 700.0), None,
        Material((0.05, 0.05, 0.055), asphalt),
    )  # fmt: skip
    glow = lit_windows(0.30, 0.9)
    greys = ((0.20, 0.20, 0.22), (0.26, 0.22, 0.19), (0.15, 0.16, 0.18), (0.30, 0.27, 0.24))
    for k in range(64):
        turn, far = 2.39996 * k, 45.0 + 4.6 * k
        x, z = far * np.sin(turn), far * np.cos(turn)
        half = 9.0 + 9.0 * float(cell_random(k, 61)), 9.0 + 9.0 * float(cell_random(k, 62))
        top = -28.0 + 55.0 * float(cell_random(k, 63)) ** 1.7 + 0.12 * far
        wall = Material(greys[k % 4], facade, emission=glow)
        city.box((x - half[0], -40.0, z - half[1]), (x + half[0], top, z + half[1]), wall)
    roof = Material((0.16, 0.15, 0.15), concrete)
    city.box((-11.0, -40.0, -9.0), (11.0, 0.0, 9.0), roof)
    for low, high in (
        ((-11.0, 0.0, 8.6), (11.0, 0.9, 9.0)),
        ((-11.0, 0.0, -9.0), (11.0, 0.9, -8.6)),
        ((10.6, 0.0, -9.0), (11.0, 0.9, 9.0)),
        ((-11.0, 0.0, -9.0), (-10.6, 0.9, 9.0)),
        ((-8.0, 0.0, -6.5), (-4.5, 2.6, -2.0)),
        ((5.0, 0.0, 3.0), (7.0, 1.3, 5.5)),
    ):
        city.box(low, high, roof)
    city.cylinder((-6.0, 2.6, -4.0), 0.05, 4.0, IRON)
    city.globe((-6.0, 6.7, -4.0), 0.08, np.array([260.0, 6.0, 3.0]))
    sky = twilight(25.0, 1.0, 0.38, 47)
    return city.place((0.0, 1.7, 0.0), sky, spacing=8.0, haze=1100.0).picture()
