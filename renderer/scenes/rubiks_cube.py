"""A scrambled Rubik's cube with its top layer half turned, a pawn, a die and a marble.

27 rounded cubies with raised stickers; narrow gaps and a coated plastic. Everything but the ground
and the pawn is semi-glossy.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.modelling import (
    Shape,
    bezier,
    ground,
    lathe,
    merge,
    plate,
    rounded,
    rounded_box,
    shade,
    sphere,
)
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Lambert

STICKERS = {
    "white": (0.78, 0.78, 0.76),
    "yellow": (0.80, 0.62, 0.05),
    "red": (0.55, 0.04, 0.05),
    "orange": (0.80, 0.26, 0.03),
    "blue": (0.03, 0.13, 0.48),
    "green": (0.03, 0.36, 0.12),
}
SIDES = np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]])
SCRAMBLE = "xyXzYxZyxzXYzxyZ"
"""Quarter turns of the layer at +1 (lower case) or -1 (upper case) of each axis."""
TOP_TURN = 27.0
STICKER_RISE = 0.016
PIPS: dict[int, list[tuple[int, int]]] = {
    0: [],
    1: [(0, 0)],
    2: [(-1, -1), (1, 1)],
    3: [(-1, -1), (0, 0), (1, 1)],
    4: [(-1, -1), (-1, 1), (1, -1), (1, 1)],
    5: [(-1, -1), (-1, 1), (0, 0), (1, -1), (1, 1)],
    6: [(-1, -1), (-1, 0), (-1, 1), (1, -1), (1, 0), (1, 1)],
}


def scene() -> Scene:
    cube = _cube()
    objects = [Object("ground", shade(ground(16.0)), Lambert((0.52, 0.49, 0.45)))]
    objects.append(Object("cubies", shade(cube.pop("plastic")), Coated((0.06, 0.06, 0.065), 0.25)))
    for color, shape in cube.items():
        objects.append(Object(color, shade(shape), Coated(STICKERS[color], 0.15)))
    die, pips = _die(0.86)
    die, pips = (shape.turned("y", 24.0).moved(-0.55, 0.43, 3.1) for shape in (die, pips))
    objects += [
        Object("pawn", shade(_pawn().moved(2.85, 0.0, 0.85)), Lambert((0.56, 0.34, 0.17))),
        Object("die", shade(die), Coated((0.78, 0.75, 0.68), 0.1)),
        Object("pips", shade(pips), Coated((0.05, 0.05, 0.06), 0.2)),
        Object(
            "marble",
            shade(sphere(0.45, 40).resting().moved(1.35, 0.0, 2.55)),
            Coated((0.10, 0.35, 0.38), 0.05),
        ),
    ]
    camera = Camera(eye=(1.9, 4.3, 9.6), target=(0.35, 1.2, 0.4), field_of_view=32.0)
    return Scene("rubiks-cube", tuple(objects), camera)


def _cube() -> dict[str, Shape]:
    """Shapes by sticker colour, and "plastic"; the cube of side 3 rests on the ground."""
    place = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    cubie = rounded_box((0.985, 0.985, 0.985), 0.09)
    parts: dict[str, list[Shape]] = {"plastic": [_posed(cubie, where) for where in place]}
    sticker = plate(0.80, 0.80, 0.02, 0.14, 0.014, 4).moved(y=0.4925 + STICKER_RISE - 0.02)
    for color, where, side in _scrambled():
        parts.setdefault(color, []).append(_posed(_facing(sticker, side), where))
    return {name: merge(*shapes).turned("y", 32.0) for name, shapes in parts.items()}


def _posed(part: Shape, where: NDArray[np.int_]) -> Shape:
    """A part of the cubie at `where`, with the top layer's turn; the cube rests on stickers."""
    moved = part.moved(*where)
    turned = moved.turned("y", TOP_TURN) if where[1] == 1 else moved
    return turned.moved(y=1.4925 + STICKER_RISE)


def _facing(sticker: Shape, side: NDArray[np.int_]) -> Shape:
    if side[0]:
        return sticker.turned("z", -90.0 * side[0])
    if side[2]:
        return sticker.turned("x", 90.0 * side[2])
    return sticker if side[1] > 0 else sticker.turned("x", 180.0)


def _scrambled() -> list[tuple[str, NDArray[np.int_], NDArray[np.int_]]]:
    """Colour, cubie and side of each of the 54 stickers after the scramble."""
    other = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    stickers = []
    for color, side in zip(STICKERS, SIDES, strict=True):
        axis = int(np.flatnonzero(side)[0])
        for a, b in other:
            where = side.copy()
            where[(axis + 1) % 3], where[(axis + 2) % 3] = a, b
            stickers.append((color, where, side))
    for turn in SCRAMBLE:
        axis, layer = "xyz".index(turn.lower()), 1 if turn.islower() else -1
        quarter = np.rint(_quarter_turn(axis)).astype(np.int_)
        stickers = [
            (color, quarter @ where, quarter @ side) if where[axis] == layer else item
            for item in stickers
            for color, where, side in [item]
        ]
    return stickers


def _quarter_turn(axis: int) -> NDArray[np.float64]:
    return np.roll(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), axis, axis=(0, 1)).astype(float)


def _pawn() -> Shape:
    """A chess pawn, 2.5 high: moulded base, hollowed stem, collar and ball."""
    base = rounded(
        [(0.0, 0.0), (0.72, 0.0), (0.74, 0.2), (0.6, 0.34), (0.6, 0.42), (0.5, 0.5)],
        (0.03, 0.08, 0.06, 0.03),
    )
    stem = bezier([(0.5, 0.5), (0.34, 0.62), (0.24, 1.0), (0.22, 1.52)], 24)
    collar = rounded([(0.22, 1.52), (0.44, 1.58), (0.46, 1.68), (0.24, 1.74)], (0.03, 0.03))
    angle = np.linspace(np.arcsin(0.24 / 0.4), np.pi, 40)
    ball = np.stack([0.4 * np.sin(angle), 1.74 + 0.4 * (0.8 - np.cos(angle))], axis=1)
    ball[0], ball[-1, 0] = (0.24, 1.74), 0.0
    return lathe(np.concatenate([base, stem[1:], collar[1:], ball[1:]]), 96)


def _die(size: float) -> tuple[Shape, Shape]:
    """A die about the origin and its pips, but for the side it lies on."""
    pip = sphere(0.095 * size, 7).scaled(1.0, 0.16, 1.0).moved(y=0.5 * size)
    pips = []
    for count, side in zip((5, 0, 3, 4, 1, 6), SIDES, strict=True):
        for a, b in PIPS[count]:
            pips.append(_facing(pip.moved(0.25 * size * a, 0.0, 0.25 * size * b), side))
    return rounded_box((size, size, size), 0.12 * size, 6), merge(*pips)
