"""The Utah teapot with a cup of tea on its saucer and three lumps of sugar.

Long curved shadows, a handle that shadows the body, and concave insides. The porcelain is coated,
the sugar diffuse.
"""

import numpy as np

from renderer.modelling import (
    Points,
    Shape,
    bezier,
    ground,
    lathe,
    merge,
    rounded_box,
    shade,
    spline,
    sweep,
    vessel,
)
from renderer.modelling.teapot import teapot
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Lambert

CUP_FOOT = 0.42
CUP_WALL = 0.07
TEA_LEVEL = 0.98


def scene() -> Scene:
    saucer = vessel(
        spline([(0.62, 0), (0.72, 0.07), (1.1, 0.13), (1.5, 0.3)], 28), 0.06, 0.08, foot=0.02
    )
    bottom = _height_inside(saucer, CUP_FOOT)
    cup, tea = (part.turned("y", -62.0).moved(1.35, bottom, 2.35) for part in _cup())
    porcelain = Coated((0.72, 0.70, 0.64), 0.12)
    objects = (
        Object("ground", shade(ground(17.0)), Lambert((0.42, 0.35, 0.30))),
        Object(
            "teapot",
            shade(teapot(22).turned("y", 24.0).moved(-0.75, 0.0, -0.5)),
            Coated((0.16, 0.34, 0.40), 0.15),
        ),
        Object("saucer", shade(lathe(saucer, 144).moved(1.35, 0.0, 2.35)), porcelain),
        Object("cup", shade(cup), porcelain),
        Object("tea", shade(tea), Coated((0.30, 0.09, 0.02), 0.05, 1.33)),
        Object("sugar", shade(_sugar().moved(-1.6, 0.0, 2.85)), Lambert((0.80, 0.78, 0.74))),
    )
    camera = Camera(eye=(1.3, 5.0, 11.5), target=(-0.25, 1.25, 0.4), field_of_view=31.0)
    return Scene("teapot", objects, camera)


def _height_inside(profile: Points, radius: float) -> float:
    """Height of a vessel's inner floor at a distance from its axis."""
    inside = profile[np.argmax(profile[:, 1]) :][::-1]
    return float(np.interp(radius, inside[:, 0], inside[:, 1]))


def _cup() -> tuple[Shape, Shape]:
    """The cup with its handle towards +X, and the tea in it."""
    side = spline([(CUP_FOOT, 0), (CUP_FOOT, 0.08), (0.66, 0.3), (0.86, 0.75), (0.95, 1.25)], 44)
    profile = vessel(side, CUP_WALL, 0.12, foot=0.02)
    low, high = ((np.interp(y, side[:, 1], side[:, 0]) - 0.5 * CUP_WALL, y) for y in (0.48, 1.02))
    path = bezier([high, (1.65, 1.3), (1.7, 0.5), low], 40)
    angle = np.arange(20) * (2.0 * np.pi / 20)
    section = np.stack([0.055 * np.cos(angle), 0.1 * np.sin(angle)], axis=1)
    handle = sweep(np.insert(path, 2, 0.0, axis=1), section, up=(0.0, 0.0, 1.0))

    inside = profile[np.argmax(profile[:, 1]) :][::-1]
    under = inside[inside[:, 1] < TEA_LEVEL]
    edge = np.interp(TEA_LEVEL, inside[:, 1], inside[:, 0])
    tea = np.concatenate([under, [(edge, TEA_LEVEL), (0.0, TEA_LEVEL)]])
    return merge(lathe(profile, 128), handle), lathe(tea, 128)


def _sugar() -> Shape:
    """Three lumps; the third lies on the other two."""
    lump = rounded_box((0.62, 0.44, 0.44), 0.045, 5).resting()
    return merge(
        lump.turned("y", 15.0),
        lump.turned("y", 100.0).moved(0.68, 0.0, 0.12),
        lump.turned("y", -32.0).moved(0.36, 0.44, 0.04),
    )
