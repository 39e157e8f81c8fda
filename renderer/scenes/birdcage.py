"""A wire birdcage with a bird on its swing, beside a potted plant.

Wires and leaves are thin and shadow themselves and the ground: the hard case for few lights.
"""

from itertools import pairwise

import numpy as np

from renderer.modelling import (
    Points,
    Shape,
    bezier,
    ground,
    lathe,
    merge,
    rounded,
    shade,
    sphere,
    spline,
    sweep,
    torus,
    tube,
    vessel,
)
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert

WIRES = 32
WIRE = 0.021
CAGE = 1.28
SHOULDER = 2.35
LEAVES = 34
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def scene() -> Scene:
    bird, beak = (part.turned("y", 35.0).moved(-1.15, 1.42, 0.0) for part in _bird())
    objects = (
        Object("ground", shade(ground(15.0)), Lambert((0.50, 0.48, 0.44))),
        Object("tray", shade(_tray().moved(-1.15)), Coated((0.32, 0.17, 0.09), 0.3)),
        Object("cage", shade(_cage().moved(-1.15)), Conductor((0.86, 0.68, 0.38), 0.3)),
        Object("bird", shade(bird), Lambert((0.72, 0.55, 0.10))),
        Object("beak", shade(beak), Lambert((0.45, 0.16, 0.08))),
        Object(
            "pot", shade(lathe(_pot(), 112).moved(1.75, 0.0, 0.65)), Lambert((0.58, 0.27, 0.17))
        ),
        Object("soil", shade(_soil().moved(1.75, 0.0, 0.65)), Lambert((0.12, 0.09, 0.07))),
        Object("leaves", shade(_leaves().moved(1.75, 0.0, 0.65)), Coated((0.12, 0.33, 0.09), 0.35)),
    )
    camera = Camera(eye=(1.6, 3.9, 10.4), target=(0.15, 1.8, 0.0), field_of_view=30.0)
    return Scene("birdcage", objects, camera)


def _tray() -> Shape:
    outline = [
        (0.0, 0.0),
        (1.32, 0.0),
        (1.32, 0.08),
        (1.44, 0.14),
        (1.44, 0.3),
        (1.34, 0.34),
        (1.30, 0.2),
        (0.0, 0.2),
    ]
    return lathe(rounded(outline, (0.03, 0.03, 0.05, 0.05, 0.015, 0.03), 4), 144)


def _cage() -> Shape:
    """Upright wires that meet in a dome, hoops, the hanging ring and the swing."""
    dome = bezier([(CAGE, SHOULDER), (CAGE, 3.1), (0.62, 3.25), (0.0, 3.62)], 26)
    upright = np.stack([np.full(12, CAGE), np.linspace(0.21, SHOULDER, 12, endpoint=False)], axis=1)
    path = np.insert(np.concatenate([upright, dome[:-1]]), 2, 0.0, axis=1)
    wire = tube(path, WIRE, 10)
    wires = [wire.turned("y", 360.0 * (i + 0.5) / WIRES) for i in range(WIRES)]
    hoops = [torus(CAGE, 1.5 * WIRE, 144, 12).moved(y=y) for y in (0.27, 0.85, SHOULDER)]
    knob = lathe(
        rounded([(0, 3.5), (0.13, 3.5), (0.16, 3.6), (0.05, 3.7), (0.0, 3.7)], (0.03, 0.05, 0.02)),
        40,
    )
    ring = torus(0.17, 0.028, 64, 14).turned("x", 90.0).turned("y", 20.0).moved(y=3.7 + 0.17)
    sides = [tube([(0.0, 3.52, 0.0), (0.0, 1.22, 0.45 * side)], 0.012, 10) for side in (-1.0, 1.0)]
    perch = tube([(0.0, 1.22, -0.52), (0.0, 1.22, 0.52)], 0.036, 16)
    swing = merge(*sides, perch).turned("y", 35.0)
    return merge(*wires, *hoops, knob, ring, swing)


def _bird() -> tuple[Shape, Shape]:
    """A bird that looks towards +X, and its beak; the perch runs along z below it."""
    path = spline(
        [(-0.36, -0.13, 0), (-0.22, -0.06, 0), (0.0, 0.05, 0), (0.13, 0.24, 0), (0.2, 0.42, 0)], 40
    )
    width = spline(
        [(0, 0.03), (0.22, 0.14), (0.48, 0.225), (0.72, 0.17), (0.88, 0.155), (1, 0.06)], 40
    )
    angle = np.arange(32) * (2.0 * np.pi / 32)
    section = np.stack([0.9 * np.cos(angle), np.sin(angle)], axis=1)
    body = sweep(path, section, width[:, 1])
    head = sphere(0.152, 14).moved(0.17, 0.4, 0.0)
    feather = np.stack([np.cos(angle[::2]), 0.12 * np.sin(angle[::2])], axis=1)
    tail = sweep(
        [(-0.2, -0.05, 0), (-0.4, -0.16, 0), (-0.6, -0.28, 0), (-0.8, -0.4, 0)],
        feather,
        (0.08, 0.09, 0.085, 0.05),
    )
    wings = [
        sweep(
            spline([(0.06, 0.16, 0.19 * s), (-0.1, 0.06, 0.22 * s), (-0.5, -0.2, 0.1 * s)], 20),
            feather,
            0.13 * np.sin(np.linspace(0.25, 0.97, 21) * np.pi) ** 0.7,
            up=(0.0, 0.25, s),
        )
        for s in (-1.0, 1.0)
    ]
    legs = [tube([(0.0, -0.14, 0.08 * s), (0.02, -0.2, 0.08 * s)], 0.014, 8) for s in (-1.0, 1.0)]
    beak = tube([(0.28, 0.4, 0.0), (0.36, 0.375, 0.0), (0.42, 0.35, 0.0)], (0.05, 0.028, 0.006), 14)
    return merge(body, head, tail, *wings), merge(beak, *legs)


def _pot() -> Points:
    side = rounded([(0.5, 0), (0.66, 0.78), (0.76, 0.8), (0.8, 1.04)], (0.03, 0.03), 5)
    fine = np.concatenate(
        [np.linspace(a, b, 4, endpoint=False) for a, b in pairwise(side)] + [side[-1:]]
    )
    return vessel(fine, 0.07, 0.1, foot=0.03)


def _soil() -> Shape:
    return lathe([(0.0, 0.5), (0.55, 0.5), (0.66, 0.9), (0.4, 0.93), (0.0, 0.96)], 64)


def _leaves() -> Shape:
    """Folded blades that arch outwards, the inner ones steeper; set at the golden angle."""
    x = np.concatenate([np.linspace(-1.0, 1.0, 9), np.linspace(1.0, -1.0, 9)[1:-1]])
    thick = np.concatenate([-0.035 * np.ones(9), 0.035 * np.ones(7)]) * (1.0 - x * x)
    section = np.stack([x, 0.35 * np.abs(x) + thick], axis=1)
    t = np.linspace(0.0, 1.0, 29)
    width = 0.17 * np.clip(np.sin(np.pi * (0.07 + 0.93 * t**0.8)), 0.0, 1.0) ** 0.8
    blades = []
    for i in range(LEAVES):
        outer = i / (LEAVES - 1)
        length, lift = 1.6 - 0.35 * outer, np.radians(82.0 - 42.0 * outer)
        bend = np.radians(40.0 + 75.0 * outer) * t
        step = length / (len(t) - 1)
        path = np.stack(
            [
                0.05 + 0.2 * outer + np.cumsum(step * np.cos(lift - bend)),
                0.92 + np.cumsum(step * np.sin(lift - bend)),
                np.zeros(len(t)),
            ],
            axis=1,
        )
        blade = sweep(path, section, np.maximum(width, 1e-3), up=(-1.0, 0.3, 0.0))
        blades.append(blade.turned("y", np.degrees(GOLDEN_ANGLE * i)))
    return merge(*blades)
