"""Highly glossy metals and glazes: a gold knot, a steel ball, a copper jar, two lacquered solids.

GGX α runs from 0.02, nearly a mirror, to 0.15. Few directional lights cannot show what such
surfaces mirror.
"""

import numpy as np

from renderer.modelling import (
    Shape,
    ground,
    lathe,
    rounded_box,
    shade,
    sphere,
    spline,
    tube,
    vessel,
)
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert


def scene() -> Scene:
    jar = _jar().moved(-1.55, 0.0, -1.0)
    ball = sphere(0.85, 48).resting().moved(1.75, 0.0, 0.35)
    bead = sphere(0.55, 40).resting().moved(-2.15, 0.0, 1.15)
    block = rounded_box((1.25, 1.25, 1.25), 0.16, 8).resting().turned("y", 33.0)
    objects = (
        Object("ground", shade(ground(15.0)), Lambert((0.38, 0.38, 0.40))),
        Object("knot", shade(_knot().moved(-0.2, 0.0, 1.55)), Conductor((1.0, 0.77, 0.34), 0.1)),
        Object("ball", shade(ball), Conductor((0.66, 0.65, 0.63), 0.02)),
        Object("jar", shade(jar), Conductor((0.95, 0.64, 0.54), 0.15)),
        Object("block", shade(block.moved(0.75, 0.0, -1.75)), Coated((0.04, 0.12, 0.42), 0.08)),
        Object("bead", shade(bead), Coated((0.50, 0.04, 0.05), 0.04)),
    )
    camera = Camera(eye=(0.6, 4.7, 10.2), target=(-0.1, 0.95, 0.0), field_of_view=28.0)
    return Scene("glossy", objects, camera)


def _knot() -> Shape:
    """A trefoil that rests on three points."""
    t = np.arange(320) * (2.0 * np.pi / 320)
    reach = 0.62 + 0.3 * np.cos(3.0 * t)
    path = np.stack([reach * np.cos(2.0 * t), 0.3 * np.sin(3.0 * t), reach * np.sin(2.0 * t)], 1)
    return tube(path, 0.17, 40, closed=True).resting()


def _jar() -> Shape:
    side = spline(
        [(0.5, 0), (0.85, 0.4), (1.0, 1.0), (0.8, 1.65), (0.5, 2.0), (0.5, 2.25), (0.68, 2.5)], 72
    )
    return lathe(vessel(side, 0.06, 0.1, foot=0.03), 128)
