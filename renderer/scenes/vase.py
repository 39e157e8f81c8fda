"""A vase with spiral ribs, a bottle with turned grooves and a bowl with three plums.

The ribs shade themselves; the vessels are hollow, with walls. Glazes are coated, the clay of the
bottle is diffuse.
"""

import numpy as np

from renderer.modelling import Points, Shape, ground, lathe, merge, shade, sphere, spline, vessel
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Lambert

RIBS = 20
RIB_HEIGHT = 0.065
TURNS = 0.3
"""Turns of a rib about the axis from the bottom to the top, as a share of a full turn."""

PLUM = 0.45


def scene() -> Scene:
    objects = (
        Object("ground", shade(ground(15.0)), Lambert((0.47, 0.45, 0.43))),
        Object("vase", shade(_vase().moved(-0.2, 0.0, -0.9)), Coated((0.22, 0.47, 0.40), 0.18)),
        Object("bottle", shade(_bottle().moved(-2.35, 0.0, 0.45)), Lambert((0.66, 0.36, 0.24))),
        Object(
            "bowl",
            shade(lathe(_bowl_profile(), 112).moved(1.85, 0.0, 1.05)),
            Coated((0.16, 0.23, 0.45), 0.3),
        ),
        Object("plums", shade(_plums().moved(1.85, 0.0, 1.05)), Coated((0.38, 0.10, 0.20), 0.35)),
    )
    camera = Camera(eye=(1.2, 4.6, 11.0), target=(-0.1, 1.75, 0.0), field_of_view=31.0)
    return Scene("vase", objects, camera)


def _vase() -> Shape:
    side = spline(
        [(0.62, 0), (0.8, 0.45), (1.28, 1.5), (1.22, 2.4), (0.66, 3.3), (0.52, 3.75), (0.74, 4.3)],
        72,
    )
    profile = vessel(side, wall=0.08, floor=0.15, foot=0.02)
    height = profile[:, 1] / 4.3
    fade = np.clip(height / 0.12, 0.0, 1.0) * np.clip((0.86 - height) / 0.2, 0.0, 1.0)
    fade[len(side) + 6 :] = 0.0
    segments = 10 * RIBS
    rib = np.abs(np.cos(np.pi * RIBS / segments * np.arange(segments))) - 1.0
    relief = RIB_HEIGHT * np.outer(fade * fade * (3.0 - 2.0 * fade), rib)
    return lathe(profile, segments, relief, 360.0 * TURNS * height)


def _bottle() -> Shape:
    side = spline(
        [
            (0.58, 0),
            (0.82, 0.35),
            (0.86, 0.95),
            (0.5, 1.65),
            (0.2, 2.2),
            (0.17, 2.75),
            (0.28, 3.05),
        ],
        84,
    )
    height = side[:, 1]
    groove = np.clip(np.minimum(height - 0.3, 1.35 - height) / 0.1, 0.0, 1.0)
    side[:, 0] -= 0.02 * groove * (0.5 - 0.5 * np.cos(2.0 * np.pi * height / 0.15)) ** 2
    return lathe(vessel(side, wall=0.06, floor=0.12, foot=0.02), 84)


def _bowl_profile() -> Points:
    side = spline([(0.55, 0), (0.56, 0.14), (0.85, 0.3), (1.3, 0.75), (1.48, 1.25)], 32)
    return vessel(side, wall=0.07, floor=0.2, foot=0.02)


def _plums() -> Shape:
    """Three plums that touch the inside of the bowl, and nearly one another."""
    plum = sphere(PLUM, 18)
    away = 1.01 * 2.0 / np.sqrt(3.0) * PLUM
    radius, height = _bowl_profile().T
    inside = np.arange(len(radius)) > np.argmax(height)
    under = inside & (np.abs(radius - away) < PLUM)
    center = np.max(height[under] + np.sqrt(PLUM**2 - (radius[under] - away) ** 2))
    angle = np.radians([20.0, 140.0, 260.0])
    return merge(*(plum.moved(away * np.cos(a), center, -away * np.sin(a)) for a in angle))
