"""The built-in scenes: found by name, closed, finite, on the ground and inside the picture."""

from functools import cache

import numpy as np
import pytest
import trimesh

from renderer import scenes
from renderer.modelling import Shape, weld
from renderer.scene import Scene
from renderer.scene.materials import Coated, Lambert, Ward
from samplers.errors import EnvlightError
from tests.renderer import lab

TEST_SCENES = ("rubiks-cube", "vase", "teapot", "birdcage")
STANDING = {
    "birdcage": ("tray", "pot"), "column": ("column",),
    "glossy": ("knot", "ball", "jar", "block", "bead"), "insect": ("legs",),
    "rubiks-cube": ("pawn", "die", "marble"),
    "spheres": ("pink-fabric", "blue-metallic-paint", "chrome-steel"),
    "teapot": ("teapot", "saucer", "sugar"), "three-boxes": ("tall", "cube", "flat"),
    "vase": ("vase", "bottle", "bowl"), "ward-teapot": ("teapot",),
}  # fmt: skip
NAMES = tuple(STANDING)
OPEN_GROUND = ("three-boxes", "column")


@cache
def made(name: str) -> Scene:
    return scenes.make(name)


@pytest.fixture(scope="module", params=NAMES)
def scene(request) -> Scene:
    return made(request.param)


def test_all_scenes_are_found():
    assert scenes.names() == list(NAMES)


def test_an_unknown_scene_is_refused_with_the_nearest_names():
    with pytest.raises(EnvlightError, match=r"'teapots'.*teapot"):
        scenes.make("teapots")


@pytest.mark.parametrize("name", NAMES)
def test_scenes_are_named_as_they_are_found_and_the_same_each_time(name):
    assert made(name).name == name
    assert made(name).objects[0].name == "ground"
    assert scenes.make(name).digest == made(name).digest


def test_objects_are_closed_and_turned_outwards(scene):
    for item in scene.objects:
        if item.name == "ground" and scene.name in OPEN_GROUND:
            continue
        shape = weld(Shape(item.mesh.vertex.astype(np.float64), item.mesh.triangle))
        mesh = trimesh.Trimesh(shape.vertex, shape.triangle, process=False)
        assert mesh.is_winding_consistent, item.name
        assert mesh.is_watertight, item.name
        assert mesh.volume > 0.0, item.name


def test_normals_are_unit_and_on_the_outer_side_of_every_triangle(scene):
    for item in scene.objects:
        lab.assert_normals_face_outwards(item.mesh)


def test_the_ground_is_at_zero_and_what_stands_on_it_touches_it(scene):
    lowest = {item.name: float(item.mesh.vertex[:, 1].min()) for item in scene.objects}
    assert float(scene.objects[0].mesh.vertex[:, 1].max()) == 0.0
    assert lowest.pop("ground") <= 0.0
    # Sums of a few positions of size 1 to 4 before they are rounded to float32.
    assert min(lowest.values()) > -1e-6
    for name in STANDING[scene.name]:
        assert abs(lowest[name]) < 1e-6, name


def test_the_cube_rests_on_its_stickers():
    colors = ("white", "yellow", "red", "orange", "blue", "green")
    lowest = [
        item.mesh.vertex[:, 1].min() for item in made("rubiks-cube").objects if item.name in colors
    ]
    assert abs(min(lowest)) < 1e-6


def test_objects_are_inside_a_picture_of_four_to_three(scene):
    camera = scene.camera
    eye = np.asarray(camera.eye)
    forward = np.subtract(camera.target, eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    half = np.tan(np.radians(0.5 * camera.field_of_view))
    for item in scene.objects[1:]:
        seen = item.mesh.vertex - eye
        depth = seen @ forward
        assert depth.min() > 0.0
        assert np.abs(seen @ above / depth).max() < half, item.name
        assert np.abs(seen @ right / depth).max() < half * 4.0 / 3.0, item.name


@pytest.mark.parametrize("name", TEST_SCENES)
def test_test_scenes_are_finely_tessellated_and_diffuse_to_semi_glossy(name):
    assert 30_000 <= lab.triangle_count(made(name)) <= 150_000
    materials = [item.material for item in made(name).objects]
    assert sum(isinstance(material, Lambert) for material in materials) >= 2
    assert any(isinstance(material, Coated) for material in materials)
    assert not any(isinstance(material, Ward) for material in materials)


def test_polygon_counts_are_the_papers():
    assert lab.triangle_count(made("three-boxes")) == 38
    assert lab.triangle_count(made("column")) == 440
