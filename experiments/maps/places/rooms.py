"""Maps of rooms that people live and work in."""

from experiments.maps.places.building import Builder, garden
from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.colours import balanced, blackbody
from experiments.maps.places.furnishing import flames, leafage, log_wall, night_window
from experiments.maps.places.materials import (
    Material,
    boards,
    chequer,
    fabric,
    masonry,
    plaster,
    shelves,
    tiles,
    wood,
)
from experiments.maps.places.raster import Picture
from experiments.maps.places.sky import sun

WHITE_WALL = Material((0.72, 0.70, 0.66), plaster)
OAK_FLOOR = Material((0.36, 0.22, 0.12), boards, gloss=0.5)
DARK_WOOD = Material((0.16, 0.09, 0.05), wood, gloss=0.3)
PALE_WOOD = Material((0.42, 0.29, 0.17), wood)
CLOTH = Material((0.16, 0.20, 0.26), fabric)
BOOKS = Material((0.22, 0.20, 0.18), shelves)


@embedded_map("room-one-window", "interior")
def room_one_window() -> Picture:
    """A study in daylight from a single window."""
    room = Builder((-2.4, 0.0, -2.6), (2.4, 2.7, 2.6), WHITE_WALL, OAK_FLOOR)
    room.window("z+", (-0.9, 0.6), (0.85, 2.2), (2, 3))
    room.box((-0.9, 0.72, 1.7), (0.9, 0.76, 2.5), DARK_WOOD)
    for x in (-0.85, 0.8):
        room.box((x, 0.0, 1.75), (x + 0.05, 0.72, 2.45), DARK_WOOD)
    room.box((-0.25, 0.0, 1.0), (0.25, 0.46, 1.45), PALE_WOOD)
    room.box((-0.25, 0.46, 1.0), (0.25, 0.95, 1.05), PALE_WOOD)
    room.box((-2.4, 0.0, -1.6), (-2.05, 2.1, 0.6), BOOKS)
    room.box((1.4, 0.0, -2.5), (2.4, 0.5, -0.6), CLOTH)
    room.box((2.15, 0.5, -2.5), (2.4, 0.9, -0.6), CLOTH)
    room.box((-0.3, 0.0, -2.6), (0.6, 2.0, -2.55), DARK_WOOD)
    room.painting("x+", (0.4, 1.5), (1.2, 2.0), (0.20, 0.12, 0.07))
    room.box((-1.2, 0.0, -0.8), (0.8, 0.012, 0.6), Material((0.30, 0.10, 0.08), fabric))
    return room.place((0.2, 1.6, -0.3), garden(120.0)).picture()


@embedded_map("room-three-windows", "interior")
def room_three_windows() -> Picture:
    """A living room with sun on the floor through three tall windows."""
    light = sun(-65.0, 32.0, 3.0)
    room = Builder((-3.4, 0.0, -3.0), (3.4, 3.1, 3.0), WHITE_WALL, OAK_FLOOR)
    for centre in (-1.9, 0.0, 1.9):
        room.window("x+", (centre - 0.55, centre + 0.55), (0.4, 2.6), (2, 4))
    room.box((-3.3, 0.0, -1.4), (-2.4, 0.42, 1.4), CLOTH)
    room.box((-3.3, 0.42, -1.4), (-3.0, 0.85, 1.4), CLOTH)
    room.box((-1.7, 0.36, -0.6), (-0.9, 0.42, 0.7), DARK_WOOD)
    for x, z in ((-1.68, -0.58), (-0.96, -0.58), (-1.68, 0.62), (-0.96, 0.62)):
        room.box((x, 0.0, z), (x + 0.06, 0.36, z + 0.06), DARK_WOOD)
    room.box((-1.0, 0.0, 2.6), (1.2, 1.9, 3.0), BOOKS)
    room.box((-0.4, 0.0, -3.0), (0.5, 2.05, -2.95), DARK_WOOD)
    room.cylinder((2.5, 0.0, -2.4), 0.22, 0.5, Material((0.40, 0.16, 0.09)))
    room.painting("x-", (-0.9, 0.9), (1.3, 2.2), (0.12, 0.16, 0.22))
    lamp = 40.0 * blackbody(2700.0)
    room.cylinder((-2.6, 0.0, 2.2), 0.02, 1.5, DARK_WOOD)
    room.globe((-2.6, 1.62, 2.2), 0.11, lamp)
    return room.place((0.5, 1.6, 0.2), garden(9.0, light), light).picture()


@embedded_map("conservatory", "interior")
def conservatory() -> Picture:
    """A garden room with windows all round and in the roof, under a grey sky."""
    frame = Material((0.75, 0.76, 0.74), plaster)
    room = Builder(
        (-3.0, 0.0, -3.6), (3.0, 3.0, 3.6), frame, Material((0.33, 0.28, 0.22), chequer, gloss=0.4)
    )
    for face, reach in (("x-", 3.6), ("x+", 3.6), ("z+", 3.0)):
        count = 4 if reach > 3.3 else 3
        pitch = 2.0 * reach / count
        for k in range(count):
            s = -reach + k * pitch
            room.window(face, (s + 0.12, s + pitch - 0.12), (0.6, 2.75), (2, 3), frame=(0.7,) * 3)
    for k in range(4):
        room.window("y+", (-2.8, 2.8), (-3.4 + 1.75 * k, -1.85 + 1.75 * k), (4, 1))
    clay, leaf = Material((0.42, 0.18, 0.09)), Material((0.05, 0.10, 0.03), leafage)
    spots = ((-2.4, 2.8), (-2.5, 1.2), (2.4, 2.9), (2.5, 0.4), (-2.4, -2.6), (2.3, -2.7))
    for k, (x, z) in enumerate(spots):
        tall = 0.5 + 0.25 * (k % 3)
        room.cylinder((x, 0.0, z), 0.22, 0.4, clay)
        room.cylinder((x, 0.4, z), 0.30 + 0.06 * (k % 2), tall, leaf)
        room.cylinder((x + 0.05, 0.4 + tall, z), 0.20, 0.35, leaf)
    room.box((-0.7, 0.70, 1.4), (0.7, 0.75, 2.4), PALE_WOOD)
    room.cylinder((0.0, 0.0, 1.9), 0.08, 0.7, DARK_WOOD)
    for x in (-1.3, 0.9):
        room.box((x, 0.0, 1.65), (x + 0.45, 0.45, 2.1), PALE_WOOD)
    room.box((-0.6, 0.0, -3.6), (0.6, 2.1, -3.55), DARK_WOOD)
    return room.place((0.1, 1.6, -0.6), garden(1.6)).picture()


@embedded_map("fireplace-cabin", "interior")
def fireplace_cabin() -> Picture:
    """A log cabin at night by its fire, with one dim lamp."""
    logs = Material((0.26, 0.15, 0.08), log_wall)
    stone = Material((0.22, 0.20, 0.18), masonry)
    room = Builder(
        (-2.8, 0.0, -2.6), (2.8, 2.6, 2.6), logs, Material((0.24, 0.14, 0.08), boards, gloss=0.25),
        Material((0.22, 0.13, 0.07), boards),
    )  # fmt: skip
    room.box((-1.1, 0.0, 2.05), (-0.55, 1.15, 2.6), stone)
    room.box((0.55, 0.0, 2.05), (1.1, 1.15, 2.6), stone)
    room.box((-1.1, 1.0, 2.05), (1.1, 2.6, 2.6), stone)
    room.box((-1.3, 1.2, 1.95), (1.3, 1.28, 2.6), DARK_WOOD)
    room.box((-0.9, 0.0, 1.7), (0.9, 0.05, 2.05), stone)
    fire = room.box((-0.5, 0.10, 2.32), (0.5, 0.95, 2.34), Material((0.02, 0.02, 0.02)))
    flame = 60.0 * balanced(2000.0, 3200.0)
    room.glow("z-", (-0.42, 0.42), (0.12, 0.80), flame, fire, pattern=flames)
    for x in (-0.3, 0.02, 0.25):
        room.cylinder((x, 0.02, 2.2), 0.06, 0.14, Material((0.05, 0.03, 0.02), wood))
    for z in (-1.6, 0.0, 1.4):
        room.box((-2.8, 2.35, z), (2.8, 2.5, z + 0.16), DARK_WOOD)
    room.box((-2.5, 0.0, -0.6), (-1.7, 0.4, 1.2), Material((0.25, 0.07, 0.05), fabric))
    room.box((-2.75, 0.4, -0.6), (-2.45, 0.85, 1.2), Material((0.25, 0.07, 0.05), fabric))
    room.box((2.2, 0.0, -1.5), (2.8, 0.8, 0.2), DARK_WOOD)
    room.box((-0.9, 0.0, -0.2), (0.9, 0.03, 1.3), Material((0.32, 0.20, 0.12), fabric))
    room.globe((2.5, 1.02, -0.6), 0.07, 40.0 * balanced(2500.0, 3200.0))
    room.window("x-", (-1.9, -1.1), (1.0, 1.9), (2, 2), frame=(0.2, 0.12, 0.07))
    return room.place((0.2, 1.35, 0.3), night_window, spacing=0.2).picture()


@embedded_map("office-tubes", "interior")
def office_tubes() -> Picture:
    """An open-plan office under rows of slender tubes at night."""
    grey = Material((0.62, 0.62, 0.60), plaster)
    room = Builder(
        (-7.0, 0.0, -9.0), (7.0, 2.8, 9.0), grey, Material((0.14, 0.15, 0.17), fabric),
        Material((0.70, 0.70, 0.68), tiles),
    )  # fmt: skip
    tube = 55.0 * blackbody(4300.0)
    for x in (-5.0, -2.0, 1.2, 4.4):
        for z in (-7.0, -4.2, -1.4, 1.4, 4.2, 7.0):
            room.box((x - 0.08, 2.70, z - 0.72), (x + 0.08, 2.76, z + 0.72), grey)
            room.tube((x, 2.68, z - 0.7), (x, 2.68, z + 0.7), 0.013, tube, (0.0, -1.0, 0.0))
    desk, dark = Material((0.45, 0.40, 0.33), wood, gloss=0.2), Material((0.04, 0.04, 0.045))
    for x in (-5.2, -1.8, 2.6, 5.4):
        for z in (-6.4, -3.2, 2.4, 5.6):
            room.box((x - 0.8, 0.71, z - 0.4), (x + 0.8, 0.74, z + 0.4), desk)
            room.box((x - 0.8, 0.0, z + 0.38), (x + 0.8, 1.15, z + 0.42), CLOTH)
            screen = room.box((x - 0.28, 0.85, z + 0.2), (x + 0.28, 1.2, z + 0.23), dark)
            room.glow("z-", (x - 0.26, x + 0.26), (0.87, 1.18), (0.5, 0.6, 0.8), screen)
            room.box((x - 0.25, 0.0, z - 0.9), (x + 0.25, 0.5, z - 0.45), dark)
            room.box((x - 0.25, 0.5, z - 0.95), (x + 0.25, 1.0, z - 0.88), dark)
    for z in (-6.0, -2.0, 2.0, 6.0):
        room.window("x+", (z - 1.7, z + 1.7), (0.9, 2.4), (3, 1))
    room.box((-7.0, 0.0, -5.0), (-6.6, 2.0, -1.0), BOOKS)
    room.box((-0.5, 0.0, 8.95), (0.5, 2.1, 9.0), DARK_WOOD)
    room.painting("x-", (1.0, 3.4), (1.1, 2.1), (0.6, 0.6, 0.6))
    return room.place((0.4, 1.5, -0.6), night_window, spacing=0.65).picture()
