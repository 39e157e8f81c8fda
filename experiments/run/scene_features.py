"""What samplers respond to in a scene: how much of it is glossy, how much of its sky is blocked.

Measured on a small view of the scene, of the same size whatever the scale of a run, so that they
are features of the scene alone: columns `scene_…` of a row, beside the map's `map_…`.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from renderer.direct import shade_directional
from renderer.packet.material_table import pack
from renderer.scene import Scene
from renderer.scene.load import load_scene
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from renderer.view import View, make_view

PREFIX = "scene_"
WIDTH, HEIGHT = 96, 72
"""Of the view, with one sub-pixel."""
DIRECTIONS = 256
FEATURES = {
    "glossy": "share of the visible surface, by pixels, whose highlights are glossy",
    "occlusion": "share of a constant map's light that the scene keeps from its visible surface",
}
"""By name, what each is."""
GLOSSY = 0.5
"""Largest roughness α of a lobe that counts as glossy: its highlights are of a hundred degrees at
most, twice arctan α on either side."""


def scene_features(scene: Scene) -> dict[str, float]:
    """Every feature of a scene by the name of its column; all are finite, in [0, 1]."""
    view = make_view(scene, WIDTH, HEIGHT, 1)
    return {f"{PREFIX}glossy": glossy_share(view), f"{PREFIX}occlusion": occlusion(view)}


@lru_cache(maxsize=64)
def cached_scene_features(scene: str) -> dict[str, float]:
    """The same of a built-in scene, by its name, or of one in a file, by its path."""
    return scene_features(load_scene(scene))


def glossy_share(view: View) -> float:
    """Share of the pixels with a surface whose surface has a specular lobe of α ≤ 1/2.

    Of Ward's two roughnesses it is the geometric mean.
    """
    if not len(view):
        return 0.0
    glossy = np.array([_is_glossy(item.material) for item in view.scene.objects])
    return float(glossy[view.material].mean())


def _is_glossy(material: Material) -> bool:
    match material:
        case Lambert():
            return False
        case Coated() | Conductor():
            return material.roughness <= GLOSSY
        case Ward():
            roughness = math.sqrt(material.roughness_x * material.roughness_y)
            return any(material.specular) and roughness <= GLOSSY


def occlusion(view: View) -> float:
    """Share of the light of a constant map that the scene keeps from its visible surfaces.

    One minus the mean irradiance over that without shadows, by 256 evenly spread lights.
    """
    if not len(view):
        return 0.0
    # White surfaces under lights that stand for equal parts of a map of radiance 1.
    white = replace(view, materials=pack([Lambert((1.0, 1.0, 1.0))] * len(view.scene.objects)))
    direction = spread(DIRECTIONS)
    irradiance = np.full((DIRECTIONS, 3), 4.0 * math.pi / DIRECTIONS)
    seen, _ = shade_directional(white, direction[None], irradiance)
    cosine = np.maximum(view.normal.astype(np.float64) @ direction.T, 0.0)
    whole = cosine.sum() * irradiance[0, 0] / math.pi
    return float(np.clip(1.0 - seen[:, 0].sum(dtype=np.float64) / whole, 0.0, 1.0))


def spread(count: int) -> NDArray[np.float64]:
    """Unit directions (count, 3), on a spiral of equal steps in height and of the golden angle."""
    y = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    radius = np.sqrt(1.0 - y * y)
    return np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], axis=1)
