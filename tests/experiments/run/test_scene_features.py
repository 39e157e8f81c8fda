"""Features of scenes: closed forms of what walls hide, and of how much is glossy."""

import math
from dataclasses import replace

import pytest

from experiments.run.scene_features import (
    FEATURES,
    PREFIX,
    cached_scene_features,
    glossy_share,
    occlusion,
    scene_features,
)
from renderer import scenes
from renderer.modelling import box, shade, sphere, square
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Ward
from renderer.view import make_view

GREY = Lambert((0.5, 0.5, 0.5))
FROM_ABOVE = Camera((0.0, 20.0, 0.01), (0.0, 0.0, 0.0), 2.0, (0.0, 0.0, -1.0))
"""Sees a patch of the floor of 0.7 in the middle."""


def scene(*objects, camera=FROM_ABOVE) -> Scene:
    return Scene("made", tuple(objects), camera)


def floor(material=GREY) -> Object:
    return Object("floor", shade(square(4000.0), 0.0), material)


def test_nothing_is_hidden_from_a_plane():
    # Light arrives from every direction that the shading's cosine counts, in float32.
    assert occlusion(make_view(scene(floor()), 24, 18, 1)) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("away", [1.0, 3.0])
def test_a_long_wall_hides_its_share(away):
    """A wall of height h at distance d: (1 − d/√(d² + h²)) / 2 of a floor's irradiance."""
    height = 3.0
    wall = box((4000.0, height, 1.0)).resting().moved(0.0, 0.0, -away - 0.5)
    found = occlusion(make_view(scene(floor(), Object("wall", shade(wall, 0.0), GREY)), 24, 18, 1))
    expected = 0.5 * (1.0 - away / math.hypot(away, height))
    # 128 directions above the floor, of which the wall's edge may misplace about one in twelve
    # (those within a spacing of it), each by half; and the patch is 0.35 to either side.
    assert found == pytest.approx(expected, abs=0.03)


def test_glossy_surfaces_are_those_with_a_sharp_lobe():
    view = make_view(scene(floor()), 24, 18, 1)
    glossy = {
        Coated((0.5, 0.5, 0.5), 0.2): 1.0,
        Coated((0.5, 0.5, 0.5), 0.8): 0.0,
        Conductor((0.9, 0.9, 0.9), 0.5): 1.0,
        Ward((0.2, 0.2, 0.2), (0.3, 0.3, 0.3), 0.1, 0.9): 1.0,
        Ward((0.2, 0.2, 0.2), (0.0, 0.0, 0.0), 0.1, 0.1): 0.0,
        GREY: 0.0,
    }
    for material, share in glossy.items():
        assert glossy_share(replace(view, scene=scene(floor(material)))) == share


def test_half_of_the_picture_is_glossy():
    ball = Object("ball", shade(sphere(0.2, 24), 0.0), Conductor((1.0, 1.0, 1.0), 0.1))
    view = make_view(scene(floor(), ball), 96, 72, 1)
    # A disc of radius 0.2, a hundredth nearer, in a patch of 20 · 2 tan 1° high and 4/3 as wide.
    patch = (20.0 * 2.0 * math.tan(math.radians(1.0))) ** 2 * 4.0 / 3.0
    assert glossy_share(view) == pytest.approx(math.pi * 0.04 / patch, rel=0.05)


def test_every_scene_has_all_features():
    for name in scenes.names():
        found = cached_scene_features(name)
        assert list(found) == [PREFIX + feature for feature in FEATURES]
        assert all(0.0 <= value <= 1.0 for value in found.values())
    nothing = scene(floor(), camera=Camera((0.0, 1.0, 0.0), (0.0, 2.0, 0.01), 20.0))
    assert set(scene_features(nothing).values()) == {0.0}
