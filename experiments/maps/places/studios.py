"""Maps of photo studios and of a stage: few strong lights in dark rooms."""

import math

from numpy.typing import ArrayLike

from experiments.maps.places.building import Builder
from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.colours import balanced, blackbody
from experiments.maps.places.materials import Material, boards, concrete, drapes, fabric, plaster
from experiments.maps.places.raster import Picture

BLACK = Material((0.035, 0.035, 0.037), fabric)
METAL = Material((0.08, 0.08, 0.085), plaster)


def _softbox(
    room: Builder, face: str, centre: tuple[float, float, float], half: tuple[float, float],
    radiance: ArrayLike, soft: float = 0.7,
) -> None:  # fmt: skip
    """A soft box on a stand whose cloth faces along an axis."""
    x, y, z = centre
    axis, sign = "xyz".index(face[0]), 1.0 if face[1] == "+" else -1.0
    size = [half[0], half[1], half[0]]
    size[axis] = 0.12
    dx, dy, dz = size
    box = room.box((x - dx, y - dy, z - dz), (x + dx, y + dy, z + dz), METAL)
    middle = z if axis == 0 else x
    along = (middle - 0.97 * half[0], middle + 0.97 * half[0])
    up = (y - 0.97 * half[1], y + 0.97 * half[1])
    room.glow(face, along, up, radiance, box, soft)
    stand = [x, 0.0, z]
    stand[axis] -= 0.2 * sign
    room.cylinder((stand[0], 0.0, stand[2]), 0.03, y, METAL)


@embedded_map("studio-two-softboxes", "studio")
def studio_two_softboxes() -> Picture:
    """A dark studio: a large key light, a smaller fill, a paper background."""
    room = Builder(
        (-4.0, 0.0, -4.5), (4.0, 3.6, 4.5), Material((0.16, 0.16, 0.165), plaster),
        Material((0.11, 0.11, 0.11), concrete, gloss=0.3), BLACK,
    )  # fmt: skip
    _softbox(room, "x-", (2.6, 2.0, 0.6), (0.75, 1.0), 42.0 * blackbody(5600.0))
    _softbox(room, "x+", (-2.9, 1.6, -0.4), (0.45, 0.6), 18.0 * blackbody(5200.0))
    paper = Material((0.55, 0.52, 0.50), plaster)
    room.box((-1.5, 0.02, 3.9), (1.5, 3.0, 3.95), paper)
    room.box((-1.5, 0.0, 1.4), (1.5, 0.03, 3.95), paper)
    room.box((-0.3, 0.0, 2.2), (0.3, 0.65, 2.7), Material((0.30, 0.20, 0.12)))
    room.box((-3.9, 0.0, -4.2), (-2.0, 1.0, -3.5), METAL)
    room.box((1.2, 0.0, -4.4), (2.4, 2.0, -4.3), Material((0.5, 0.5, 0.5)))
    room.globe((-3.4, 1.2, -3.8), 0.04, 30.0 * blackbody(2700.0))
    return room.place((0.0, 1.5, -0.6)).picture()


@embedded_map("studio-strips-and-beauty-dish", "studio")
def studio_strips() -> Picture:
    """Two tall strip lights, a hard dish overhead, coloured fill: contrast from many sizes."""
    room = Builder(
        (-3.6, 0.0, -3.8), (3.6, 3.4, 3.8), BLACK, Material((0.06, 0.06, 0.06), boards, gloss=0.7),
        BLACK,
    )  # fmt: skip
    _softbox(room, "x-", (2.3, 1.5, 1.5), (0.16, 1.05), 60.0 * blackbody(5600.0), 0.3)
    _softbox(room, "x+", (-2.3, 1.5, 1.5), (0.16, 1.05), 60.0 * blackbody(5600.0), 0.3)
    _softbox(room, "z+", (1.0, 2.2, -2.8), (0.5, 0.35), (1.5, 5.0, 14.0), 0.5)
    _softbox(room, "z+", (-1.6, 1.2, -2.8), (0.3, 0.3), (14.0, 2.0, 4.0), 0.5)
    room.spotlight((0.0, 3.0, 0.5), 0.14, 380.0 * blackbody(5400.0), (0.0, 0.5, 1.6), 6.0)
    room.cylinder((0.0, 3.16, 0.5), 0.32, 0.05, METAL)
    room.box((-1.8, 0.0, 3.6), (1.8, 3.0, 3.7), Material((0.30, 0.30, 0.32), drapes))
    room.box((-0.35, 0.0, 1.7), (0.35, 0.8, 2.3), METAL)
    room.box((2.6, 0.0, -3.2), (3.4, 1.1, -1.0), METAL)
    return room.place((0.1, 1.5, -0.3)).picture()


@embedded_map("concert-stage", "studio")
def concert_stage() -> Picture:
    """A stage seen from its middle: rows of coloured spotlights, curtains, a dark house."""
    house = Builder(
        (-11.0, 0.0, -19.0), (11.0, 9.0, 7.0), Material((0.07, 0.05, 0.05), plaster),
        Material((0.06, 0.04, 0.035), boards, gloss=0.4), Material((0.05, 0.05, 0.05)),
    )  # fmt: skip
    curtain = Material((0.30, 0.02, 0.03), drapes)
    house.box((-9.0, 0.0, 6.3), (9.0, 8.0, 6.5), Material((0.20, 0.20, 0.23), drapes))
    for x in (-9.0, 6.6):
        house.box((x, 0.0, -1.6), (x + 2.4, 8.0, -1.3), curtain)
        house.box((x, 0.0, 2.6), (x + 2.4, 8.0, 2.9), curtain)
    house.box((-11.0, 6.8, -1.7), (11.0, 9.0, -1.3), curtain)
    hues = (
        (1.0, 0.12, 0.06),
        (0.12, 0.25, 1.0),
        (0.9, 0.2, 0.9),
        (0.1, 0.85, 0.5),
        (1.0, 0.7, 0.3),
    )
    for row, (y, z) in enumerate(((6.4, 4.6), (6.8, 1.4))):
        house.box((-7.5, y + 0.15, z - 0.08), (7.5, y + 0.3, z + 0.08), METAL)
        for k in range(9):
            x = -6.4 + 1.6 * k
            hue = [4000.0 * c for c in hues[(k + 2 * row) % 5]]
            target = (0.55 * x, 0.0, 1.6 if row else 3.6)
            house.spotlight((x, y, z), 0.085, hue, target, 14.0)
    white = 6000.0 * balanced(3200.0, 3600.0)
    for x in (-4.0, 0.0, 4.0):
        house.spotlight((x, 7.6, -9.0), 0.09, white, (0.4 * x, 1.0, 1.0), 60.0)
    for z in range(8):
        depth = -4.0 - 1.7 * z
        house.box((-7.0, 0.0, depth - 0.6), (7.0, 0.5 + 0.25 * z, depth),
                  Material((0.16, 0.03, 0.03), fabric))  # fmt: skip
    for x in (-4.6, 3.8):
        house.box((x, 0.0, 4.0), (x + 1.0, 1.5, 4.7), Material((0.03, 0.03, 0.03)))
        house.box((x * 1.1, 0.0, -0.9), (x * 1.1 + 0.7, 0.35, -0.4), Material((0.03, 0.03, 0.03)))
    house.cylinder((0.5, 0.5, 3.4), 0.35, 0.5, Material((0.5, 0.08, 0.05), gloss=0.6))
    house.cylinder((-0.5, 0.4, 3.3), 0.25, 0.4, Material((0.5, 0.08, 0.05), gloss=0.6))
    for k in range(10):
        turn = math.pi * k / 9.0
        house.globe(
            (-10.8, 3.0, -17.0 + 1.5 * k), 0.03 + 0.005 * math.sin(turn), 25.0 * blackbody(2500.0)
        )
    return house.place((0.3, 1.7, 0.4), spacing=0.5).picture()
