"""A honey bee on the ground.

Thin legs, feelers and wings whose shadows jump where lights do, after the bee that Wan, Wong and
Leung ("Spherical Q²-tree for sampling dynamic environment sequences", EGSR 2005, figure 10) put
beside a fire.
"""

from itertools import pairwise

import numpy as np

from renderer.modelling import (
    Points,
    Shape,
    ground,
    lathe,
    merge,
    rounded,
    shade,
    sphere,
    sweep,
    tube,
)
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Lambert, Material

BANDS = [(0.10, 0.24), (0.34, 0.48), (0.58, 0.70), (0.79, 0.87)]
"""Where the abdomen's yellow bands begin and end, as shares of its length."""


def scene() -> Scene:
    amber, dark = Coated((0.62, 0.36, 0.06), 0.3), Coated((0.07, 0.05, 0.04), 0.2)
    abdomen, bands = _abdomen()
    parts: list[tuple[str, Shape, Material]] = [
        (
            "thorax",
            sphere(0.42, 32).scaled(1.1, 1.0, 1.0).moved(y=0.86),
            Lambert((0.42, 0.25, 0.09)),
        ),
        ("abdomen", merge(abdomen, _head()), dark),
        ("bands", bands, amber),
        ("eyes", _eyes(), Coated((0.03, 0.02, 0.02), 0.06)),
        ("legs", merge(_legs(), _feelers()).resting(), dark),
        ("wings", _wings(), Coated((0.60, 0.62, 0.60), 0.15)),
    ]
    objects = [Object("ground", shade(ground(12.0)), Lambert((0.52, 0.50, 0.46)))]
    objects += [
        Object(name, shade(shape.turned("y", -38.0)), material) for name, shape, material in parts
    ]
    camera = Camera(eye=(0.9, 3.4, 7.6), target=(0.0, 0.72, 0.0), field_of_view=28.5)
    return Scene("insect", tuple(objects), camera)


def _abdomen() -> tuple[Shape, Shape]:
    """The abdomen behind the thorax (towards −X) and the raised bands around it."""
    t = np.linspace(0.0, 1.0, 65)
    radius = 0.5 * np.sin(np.pi * t**0.8) ** 0.6
    profile = np.stack([radius, 1.55 * t], axis=1)
    profile[[0, -1], 0] = 0.0
    bands = [_band(profile, 1.55 * start, 1.55 * stop) for start, stop in BANDS]
    body, raised = (
        part.turned("z", 104.0).moved(-0.28, 0.9) for part in (lathe(profile, 96), merge(*bands))
    )
    return body, raised


def _band(profile: Points, start: float, stop: float) -> Shape:
    height = np.linspace(start, stop, 15)
    bulge = 0.025 * np.sin(np.linspace(0.0, np.pi, 15)) ** 0.5 - 0.004
    radius = np.interp(height, profile[:, 1], profile[:, 0]) + bulge
    outline = np.stack([radius, height], axis=1)
    return lathe(np.concatenate([[(0.0, start)], outline, [(0.0, stop)]]), 96)


def _head() -> Shape:
    return sphere(0.29, 24).scaled(0.8, 1.05, 1.0).moved(0.62, 0.8, 0.0)


def _eyes() -> Shape:
    eye = sphere(0.17, 20).scaled(0.7, 1.25, 0.65)
    return merge(*(eye.turned("y", -24.0 * s).moved(0.68, 0.86, 0.21 * s) for s in (-1, 1)))


def _legs() -> Shape:
    """Six legs of thigh, shin and a foot that lies on the ground."""
    legs = []
    for side in (-1.0, 1.0):
        for hip, reach, spread in ((0.25, 0.75, 0.72), (0.0, 0.05, 0.95), (-0.2, -0.8, 0.85)):
            foot = 0.024
            corners = [
                (hip, 0.62, 0.2 * side),
                (hip + 0.45 * reach, 0.98, side * (0.2 + 0.55 * spread)),
                (hip + 0.85 * reach, 0.22, side * (0.2 + 0.95 * spread)),
                (hip + 0.95 * reach, foot, side * (0.2 + 1.05 * spread)),
                (hip + 1.2 * reach, foot, side * (0.2 + 1.3 * spread)),
            ]
            legs.append(_limb(corners, 0.09, (0.055, 0.075, 0.03, foot, foot)))
    return merge(*legs)


def _feelers() -> Shape:
    return merge(
        *(
            _limb(
                [(0.8, 0.92, 0.08 * s), (1.05, 1.22, 0.2 * s), (1.45, 1.08, 0.42 * s)],
                0.1,
                (0.022, 0.018, 0.03),
            )
            for s in (-1.0, 1.0)
        )
    )


def _limb(
    corners: list[tuple[float, float, float]], bend: float, width: tuple[float, ...]
) -> Shape:
    """A jointed tube; `width` is its radius at each of the corners."""
    points = np.asarray(corners)
    path = rounded(points, bend, 6)
    fine = np.concatenate(
        [np.linspace(a, b, 4, endpoint=False) for a, b in pairwise(path)] + [path[-1:]]
    )
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    mark = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return tube(fine, np.interp(along / along[-1], mark / mark[-1], width), 16)


def _wings() -> Shape:
    """Two pairs, swept back and a little up, thin as paper."""
    angle = np.arange(40) * (2.0 * np.pi / 40)
    section = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    wings = []
    for side in (-1.0, 1.0):
        for root, tip, width in (
            (0.1, (-1.25, 1.62, 1.35), 0.36),
            (-0.12, (-1.3, 1.2, 0.95), 0.25),
        ):
            end = np.array(tip) * (1.0, 1.0, side)
            start = np.array([root, 1.16, 0.2 * side])
            t = np.linspace(0.0, 1.0, 41)
            path = start + t[:, None] * (end - start)
            path[:, 1] += 0.12 * np.sin(np.pi * t)
            broad = width * np.clip(np.sin(np.pi * (0.06 + 0.94 * t**1.6)), 0.0, 1.0) ** 0.6
            scale = np.stack([np.maximum(broad, 1e-3), np.full(41, 0.008)], axis=1)
            wings.append(sweep(path, section, scale, up=(0.25, 1.0, -0.2 * side)))
    return merge(*wings)
