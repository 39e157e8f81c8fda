"""Maps of large interiors: a gallery, a church, a ballroom, and places of work."""

import numpy as np

from experiments.maps.places.building import Builder, garden
from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.colours import balanced, blackbody
from experiments.maps.places.furnishing import night_window
from experiments.maps.places.materials import (
    Material,
    asphalt,
    boards,
    bricks,
    concrete,
    fabric,
    masonry,
    plaster,
    sheet_metal,
    shelves,
    tiles,
    wood,
)
from experiments.maps.places.noise import cell_random
from experiments.maps.places.raster import Picture
from experiments.maps.places.sky import sun

DOWN = (0.0, -1.0, 0.0)
DARK_WOOD = Material((0.16, 0.09, 0.05), wood, gloss=0.3)
STEEL = Material((0.22, 0.23, 0.24), sheet_metal)
CONCRETE = Material((0.32, 0.31, 0.29), concrete)


@embedded_map("gallery-skylight", "interior")
def gallery_skylight() -> Picture:
    """A picture gallery lit from above by one large skylight."""
    wall = Material((0.42, 0.12, 0.10), plaster)
    room = Builder(
        (-4.5, 0.0, -7.0), (4.5, 5.6, 7.0), wall, Material((0.30, 0.19, 0.11), boards, gloss=0.6),
        None,
    )  # fmt: skip
    white = Material((0.74, 0.72, 0.68), plaster)
    for low, high in (
        ((-4.5, 5.0, -7.0), (-1.7, 5.6, 7.0)), ((1.7, 5.0, -7.0), (4.5, 5.6, 7.0)),
        ((-1.7, 5.0, -7.0), (1.7, 5.6, -4.4)), ((-1.7, 5.0, 4.4), (1.7, 5.6, 7.0)),
    ):  # fmt: skip
        room.box(low, high, white)
    room.window("y+", (-1.7, 1.7), (-4.4, 4.4), (2, 6), bar=0.09)
    for k, z in enumerate((-5.4, -2.7, 0.2, 3.0, 5.6)):
        tone = cell_random(np.array([k, k + 9, k + 18]), 4) * 0.35 + 0.04
        size = 0.7 + 0.35 * (k % 3)
        room.painting("x-", (z - size, z + size), (1.3, 2.4 + 0.3 * (k % 2)), tone)
        room.painting("x+", (z - size, z + size), (1.4, 2.5 + 0.3 * ((k + 1) % 2)), tone[::-1])
    room.painting("z+", (-1.6, 1.6), (1.2, 3.4), (0.16, 0.15, 0.10))
    room.box((-0.9, 0.0, -7.0), (0.9, 2.6, -6.9), Material((0.10, 0.07, 0.05), wood))
    room.box((-0.35, 0.40, 1.6), (0.35, 0.48, 3.6), DARK_WOOD)
    for z in (1.7, 3.4):
        room.box((-0.3, 0.0, z), (0.3, 0.40, z + 0.1), DARK_WOOD)
    stone = Material((0.55, 0.53, 0.50), plaster)
    for x, z in ((-3.2, -4.0), (3.2, 2.0)):
        room.box((x - 0.3, 0.0, z - 0.3), (x + 0.3, 1.1, z + 0.3), stone)
        room.cylinder((x, 1.1, z), 0.18, 0.55, stone)
    return room.place((0.3, 1.65, -1.2), garden(8.0), spacing=0.35).picture()


@embedded_map("gothic-church", "interior")
def gothic_church() -> Picture:
    """A nave with pillars, sun through stained glass from the south."""
    light = sun(-72.0, 36.0, 2.5)
    stone = Material((0.40, 0.37, 0.32), masonry)
    nave = Builder(
        (-6.5, 0.0, -13.0), (6.5, 13.0, 13.0), stone,
        Material((0.24, 0.22, 0.19), tiles, gloss=0.3),
        Material((0.36, 0.33, 0.29), masonry),
    )  # fmt: skip
    for k, z in enumerate((-9.6, -4.8, 0.0, 4.8, 9.6)):
        for face, seed in (("x-", 70), ("x+", 80)):
            nave.window(face, (z - 0.9, z + 0.9), (3.4, 10.5), (3, 6), _glass(3, 6, seed + k),
                        (0.05, 0.05, 0.05), 0.06)  # fmt: skip
    nave.window("z+", (-2.4, 2.4), (4.0, 11.5), (6, 9), _glass(6, 9, 95), (0.05,) * 3, 0.07)
    for z in (-7.2, -2.4, 2.4, 7.2):
        for x in (-3.6, 3.6):
            nave.cylinder((x, 0.0, z), 0.42, 11.0, stone)
            nave.box((x - 0.6, 0.0, z - 0.6), (x + 0.6, 0.55, z + 0.6), stone)
            nave.box((x - 0.6, 8.6, z - 0.6), (x + 0.6, 9.0, z + 0.6), stone)
        nave.box((-6.5, 10.9, z - 0.4), (6.5, 13.0, z + 0.4), stone)
    for z in np.arange(-6.0, 7.5, 1.5):
        for x in (-2.9, 0.9):
            nave.box((x, 0.0, z), (x + 2.0, 0.45, z + 0.4), DARK_WOOD)
            nave.box((x, 0.45, z - 0.05), (x + 2.0, 0.95, z), DARK_WOOD)
    nave.box((-1.5, 0.0, 10.6), (1.5, 1.0, 11.6), stone)
    candle = 90.0 * blackbody(2000.0)
    for x in (-1.2, -0.7, 0.7, 1.2):
        nave.globe((x, 1.45, 11.0), 0.02, candle)
    return nave.place((0.0, 1.7, -1.6), garden(5.0, light), light, spacing=0.9).picture()


def _glass(columns: int, rows: int, seed: int) -> np.ndarray:
    """Tints (columns, rows, 3) of leaded panes: mostly blue and red, some gold and green."""
    palette = np.array(
        [[0.08, 0.14, 0.62], [0.62, 0.06, 0.07], [0.75, 0.45, 0.08], [0.08, 0.40, 0.16],
         [0.16, 0.30, 0.72], [0.62, 0.60, 0.52]]
    )  # fmt: skip
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    pick = (cell_random(np.minimum(i, columns - 1 - i), j, seed) * 6.0).astype(np.int64)
    return palette[pick] * (0.55 + 0.6 * cell_random(i, j, seed + 500))[..., None]


@embedded_map("ballroom-ring-of-lamps", "interior")
def ballroom() -> Picture:
    """A hall at night under two rings of small lamps."""
    hall = Builder(
        (-7.0, 0.0, -9.0), (7.0, 6.2, 9.0), Material((0.55, 0.47, 0.33), plaster),
        Material((0.30, 0.18, 0.09), boards, gloss=0.9), Material((0.62, 0.58, 0.50), plaster),
    )  # fmt: skip
    lamp = 900.0 * balanced(2700.0, 3600.0)
    hall.ring((0.0, 4.4, 1.2), 1.5, 24, 0.035, lamp)
    hall.ring((0.0, 4.8, 1.2), 0.8, 12, 0.035, lamp)
    iron = Material((0.20, 0.14, 0.05))
    hall.cylinder((0.0, 4.83, 1.2), 0.05, 1.4, iron)
    gilt, velvet = Material((0.50, 0.36, 0.13), plaster), Material((0.22, 0.03, 0.04), fabric)
    for z in (-6.0, -2.0, 2.0, 6.0):
        for x in (-6.2, 6.2):
            hall.cylinder((x, 0.0, z), 0.32, 5.4, Material((0.62, 0.58, 0.50), plaster))
            hall.box((x - 0.45, 5.3, z - 0.45), (x + 0.45, 5.6, z + 0.45), gilt)
            hall.box((x - 0.45, 0.0, z - 0.45), (x + 0.45, 0.3, z + 0.45), gilt)
    for z in (-4.0, 0.0, 4.0):
        hall.window("x-", (z - 0.8, z + 0.8), (0.9, 4.6), (2, 4))
        hall.box((-6.98, 0.0, z - 1.3), (-6.85, 5.2, z - 0.85), velvet)
        hall.box((-6.98, 0.0, z + 0.85), (-6.85, 5.2, z + 1.3), velvet)
        hall.painting("x+", (z - 0.9, z + 0.9), (1.4, 4.0), (0.30, 0.32, 0.34))
    hall.box((-2.5, 0.0, 7.4), (2.5, 0.6, 9.0), DARK_WOOD)
    hall.box((-1.0, 0.6, 7.9), (0.9, 1.6, 8.5), Material((0.02, 0.02, 0.02), gloss=1.0))
    for z in (-8.0, -6.8, 6.2):
        for x in (-4.4, 4.4):
            hall.box((x - 0.3, 0.0, z - 0.3), (x + 0.3, 0.5, z + 0.3), velvet)
    return hall.place((0.8, 1.65, -2.4), night_window, spacing=0.45).picture()


@embedded_map("warehouse-tubes", "industrial")
def warehouse() -> Picture:
    """A warehouse with rows of tubes high up, shelves, and a loading door ajar."""
    hall = Builder(
        (-11.0, 0.0, -16.0), (11.0, 8.0, 16.0), STEEL, CONCRETE, Material((0.25, 0.25, 0.25))
    )
    tube = 90.0 * blackbody(4200.0)
    for x in (-7.0, 0.0, 7.0):
        for z in np.arange(-13.0, 14.0, 4.3):
            hall.box((x - 0.1, 7.1, z - 1.2), (x + 0.1, 7.2, z + 1.2), STEEL)
            hall.tube((x, 7.06, z - 1.15), (x, 7.06, z + 1.15), 0.022, tube, DOWN)
    goods = Material((0.28, 0.20, 0.13), shelves)
    for x in (-9.6, -4.2, 4.6):
        for z in (-13.0, -6.5, 5.0):
            hall.box((x - 0.6, 0.0, z), (x + 0.6, 4.6, z + 5.0), goods)
    for x, z, s in ((1.5, 5.0, 1.0), (2.1, 6.6, 1.3), (-1.6, 7.4, 0.9), (-2.0, -4.6, 1.1)):
        hall.box((x, 0.0, z), (x + s, 0.9 * s, z + s), Material((0.35, 0.23, 0.13), wood))
    for z in (-10.7, -5.3, 0.0, 5.3, 10.7):
        hall.box((-11.0, 7.3, z - 0.1), (11.0, 7.8, z + 0.1), Material((0.30, 0.08, 0.05)))
    hall.window("z+", (-2.0, 2.0), (0.05, 2.6), (1, 1), bar=0.02)
    for x in (-8.0, 8.0):
        hall.window("z-", (x - 1.2, x + 1.2), (5.0, 6.4), (4, 2))
    return hall.place((0.6, 1.7, 0.4), garden(2.2), spacing=0.7).picture()


@embedded_map("car-park-tubes", "industrial")
def car_park() -> Picture:
    """An underground car park: low, dark, with tubes between the beams."""
    hall = Builder(
        (-15.0, 0.0, -18.0), (15.0, 2.6, 18.0), CONCRETE,
        Material((0.13, 0.13, 0.13), asphalt, gloss=0.5), CONCRETE,
    )  # fmt: skip
    tube = 560.0 * balanced(3900.0, 5200.0)
    for x in (-5.2, 5.2):
        for z in np.arange(-15.0, 16.0, 5.0):
            hall.tube((x, 2.50, z - 0.6), (x, 2.50, z + 0.6), 0.014, tube, DOWN)
    stripe = Material((0.55, 0.42, 0.06))
    for z in (-12.5, -7.5, -2.5, 2.5, 7.5, 12.5):
        hall.box((-15.0, 2.2, z - 0.2), (15.0, 2.6, z + 0.2), CONCRETE)
        for x in (-8.5, -2.4, 2.6, 8.5):
            hall.box((x - 0.25, 0.0, z - 0.25), (x + 0.25, 2.6, z + 0.25), CONCRETE)
            hall.box((x - 0.26, 0.6, z - 0.26), (x + 0.26, 1.1, z + 0.26), stripe)
    paints = ((0.30, 0.03, 0.03), (0.45, 0.45, 0.46), (0.03, 0.05, 0.14), (0.03, 0.03, 0.03))
    bays = (
        (-12.3, -10.0), (-12.3, -5.0), (-12.3, 5.2), (12.3, -4.8), (12.3, 0.2), (12.3, 10.0),
        (5.6, 10.0), (-5.6, -10.2),
    )  # fmt: skip
    for k, (x, z) in enumerate(bays):
        _car(hall, x, z, paints[k % 4])
    hall.glow("z+", (-1.0, 1.0), (1.75, 2.1), (0.8, 19.0, 4.0))
    hall.glow("x-", (-0.8, 0.8), (1.9, 2.15), (0.8, 19.0, 4.0))
    return hall.place((0.3, 1.6, -0.4), spacing=1.0).picture()


def _car(hall: Builder, x: float, z: float, colour: tuple[float, float, float]) -> None:
    paint, tyre = Material(colour, gloss=1.0), Material((0.02, 0.02, 0.02))
    hall.box((x - 2.1, 0.28, z - 0.85), (x + 2.1, 0.85, z + 0.85), paint)
    hall.box((x - 1.2, 0.85, z - 0.75), (x + 1.0, 1.40, z + 0.75), Material((0.03,) * 3, gloss=1.0))
    hall.box((x - 1.0, 1.38, z - 0.70), (x + 0.8, 1.43, z + 0.70), paint)
    for wheel in (x - 1.6, x + 1.0):
        hall.box((wheel, 0.0, z - 0.8), (wheel + 0.6, 0.30, z + 0.8), tyre)


@embedded_map("workshop", "industrial")
def workshop() -> Picture:
    """A brick workshop: hanging lamps over benches, a north window gone dim."""
    room = Builder(
        (-5.0, 0.0, -6.0), (5.0, 4.2, 6.0), Material((0.26, 0.12, 0.08), bricks), CONCRETE,
        Material((0.24, 0.16, 0.10), boards),
    )  # fmt: skip
    room.window("x-", (-3.2, 3.2), (1.3, 3.5), (8, 4), frame=(0.05, 0.07, 0.06))
    lamp = 700.0 * balanced(2800.0, 3800.0)
    for x, z in ((2.6, -3.4), (2.6, 0.0), (2.6, 3.4), (-1.2, 3.6), (-1.2, -3.8)):
        room.cylinder((x, 2.62, z), 0.01, 1.6, STEEL)
        room.cylinder((x, 2.60, z), 0.20, 0.04, Material((0.03, 0.06, 0.04)))
        room.globe((x, 2.53, z), 0.045, lamp)
    bench, tools = Material((0.32, 0.20, 0.11), wood), Material((0.22, 0.20, 0.18), shelves)
    for z in (-5.0, -1.4, 2.2):
        room.box((3.2, 0.86, z), (4.4, 0.93, z + 2.8), bench)
        for x, dz in ((3.25, 0.1), (4.25, 0.1), (3.25, 2.6), (4.25, 2.6)):
            room.box((x, 0.0, z + dz), (x + 0.1, 0.86, z + dz + 0.1), bench)
        room.box((3.5, 0.93, z + 0.5), (3.8, 1.2, z + 0.9), STEEL)
    room.box((4.7, 1.4, -5.0), (5.0, 2.5, 5.0), tools)
    room.box((-1.6, 0.0, 5.3), (1.8, 2.2, 6.0), tools)
    room.box((-3.6, 0.0, -1.0), (-2.4, 0.9, 1.4), Material((0.06, 0.14, 0.08), gloss=0.4))
    room.cylinder((-3.0, 0.9, 0.2), 0.25, 0.9, STEEL)
    room.box((-2.0, 0.0, -6.0), (0.0, 2.4, -5.92), Material((0.10, 0.14, 0.18), boards))
    for z in (-3.0, 0.0, 3.0):
        room.box((-5.0, 3.7, z - 0.12), (5.0, 4.0, z + 0.12), DARK_WOOD)
    return room.place((0.2, 1.65, 0.3), garden(0.8), spacing=0.4).picture()
