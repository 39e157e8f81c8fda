"""Written scenes: geometry, camera, map and materials arrive where the renderer's own formulas read
them. No renderer is needed: its conventions stand here as formulas."""

import json
import math
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from experiments.questions.production_renderers import to_blender, to_luxcore, to_mitsuba
from experiments.questions.production_renderers.shots import WRITERS
from experiments.questions.production_renderers.written_scene import (
    MATERIALS,
    Picture,
    with_materials,
    write_ply,
)
from renderer.modelling import shade, sphere, square
from renderer.primary import camera_axes
from renderer.scene import Camera, Object, Scene
from renderer.scene.blender_frame import UP_TO_Z
from renderer.scene.materials import Coated, Conductor, Lambert, Ward
from samplers import EnvironmentMap, EnvlightError
from samplers.files.image_file import read_radiance
from samplers.sphere import pixel_of_direction

PICTURE = Picture(24, 18, 4)
HEIGHT = 64
CAMERA = Camera((3.0, 2.0, 5.0), (0.5, 0.7, -0.2), 37.0, (0.1, 1.0, 0.0))
MIXED = (
    Lambert((0.5, 0.4, 0.3)), Coated((0.2, 0.5, 0.4), 0.2), Conductor((0.9, 0.6, 0.3), 0.3),
    Ward((0.3, 0.2, 0.1), (0.1, 0.1, 0.1), 0.1, 0.2),
)  # fmt: skip


@pytest.fixture(scope="module")
def scene() -> Scene:
    shape = sphere(1.0, 6)
    objects = [Object("ground", shade(square(8.0), 0.0), MIXED[0])]
    objects += [
        Object(f"ball/{k}", shade(shape.moved(2.5 * k), 180.0), material)
        for k, material in enumerate(MIXED)
    ]
    return Scene("balls", tuple(objects), CAMERA)


@pytest.fixture(scope="module")
def environment() -> EnvironmentMap:
    radiance = np.random.default_rng(3).random((8, 16, 3))
    return EnvironmentMap.from_array(radiance, "noise")


@pytest.fixture(scope="module")
def directions() -> NDArray[np.float64]:
    d = np.random.default_rng(5).normal(size=(4000, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def texel(u: NDArray, v: NDArray) -> tuple[NDArray, NDArray]:
    """Row and column of a map of HEIGHT rows, where the upper left corner is u = v = 0."""
    return (v * HEIGHT).astype(int), ((u % 1.0) * 2 * HEIGHT).astype(int)


def agree(found: tuple[NDArray, NDArray], directions: NDArray) -> bool:
    """All but what rounding puts on the other side of a texel's edge."""
    row, column = pixel_of_direction(directions, HEIGHT)
    return float(np.mean((found[0] == row) & (found[1] == column))) > 0.999


def test_blender_reads_the_map_where_it_is(scene, directions):
    """Equirectangular texture: u = ½ − atan2(y, x) / 2π, v = ½ + asin(z) / π from below."""
    (x, y, z) = to_blender.in_blender(directions).astype(np.float64).T
    turn = to_blender.describe(with_materials(scene, "lambert"), PICTURE)["map"]["rotation"]
    assert turn[:2] == [0.0, 0.0]
    c, s = math.cos(turn[2]), math.sin(turn[2])
    x, y = c * x - s * y, s * x + c * y
    u = 0.5 - np.arctan2(y, x) / (2.0 * np.pi)
    v = 0.5 + np.arcsin(np.clip(z, -1.0, 1.0)) / np.pi
    assert agree(texel(u, 1.0 - v), directions)


def test_luxcore_reads_the_map_where_it_is(scene, directions):
    """Direction in the map's frame: u = atan2(y, x) / 2π, v = acos(z) / π from above."""
    properties = to_luxcore.describe(with_materials(scene, "lambert"), PICTURE)
    matrix = np.reshape(properties["scene.lights.map.transformation"], (4, 4)).T[:3, :3]
    x, y, z = np.linalg.inv(matrix) @ directions.T
    u, v = np.arctan2(y, x) / (2.0 * np.pi), np.arccos(np.clip(z, -1.0, 1.0)) / np.pi
    assert agree(texel(u, v), directions)


def test_mitsuba_interpolates_to_the_energy_of_every_row():
    """Its rows lie at v = j / (h − 1): the trapezoidal rule is exact for what it interpolates."""
    radiance = np.random.default_rng(1).random((8, 16, 3)).astype(np.float32)
    edges = to_mitsuba.on_edges(radiance).astype(np.float64)
    assert edges.shape == (9, 16, 3)
    whole = (0.5 * (edges[0] + edges[-1]) + edges[1:-1].sum(axis=0)) / 8.0
    # Each edge is rounded to float32 once.
    np.testing.assert_allclose(whole, radiance.mean(axis=0, dtype=np.float64), rtol=2.0**-23)
    np.testing.assert_allclose(edges[3], radiance[2:4].mean(axis=0, dtype=np.float64), rtol=1e-6)


def test_blender_camera_looks_where_the_scene_camera_does(scene):
    matrix = to_blender.camera_matrix(CAMERA)
    right, up, forward = camera_axes(CAMERA)
    for axis, world in (((1, 0, 0), right), ((0, 1, 0), up), ((0, 0, -1), forward)):
        seen = matrix[:3, :3] @ np.array(axis, np.float64)
        np.testing.assert_allclose(seen, UP_TO_Z @ world, atol=1e-12)
    np.testing.assert_allclose(matrix[:3, 3], UP_TO_Z @ np.array(CAMERA.eye))
    # A rotation: a mirrored frame would show the picture's left on its right.
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
    assert np.linalg.det(UP_TO_Z) == pytest.approx(1.0)


def test_luxcore_window_puts_pixels_where_they_are(scene):
    """Its raster: across = film x, down = rows − film y − 1, for film y from the lowest row up."""
    properties = to_luxcore.describe(with_materials(scene, "lambert"), PICTURE)
    left, right, bottom, top = properties["scene.camera.screenwindow"]
    for row in (0, 5, PICTURE.height - 1):
        film_y = PICTURE.height - 1 - row + 0.5  # the middle of that row, counted from below
        down = (PICTURE.height - film_y - 1.0) / PICTURE.height
        assert top + down * (bottom - top) == pytest.approx(
            1.0 - (row + 0.5) * 2.0 / PICTURE.height
        )
    aspect = PICTURE.width / PICTURE.height
    assert (left, right) == pytest.approx((-aspect, aspect))


def test_meshes_arrive_with_their_normals(scene, tmp_path):
    mesh = scene.objects[1].mesh
    write_ply(tmp_path / "a.ply", mesh)
    read = trimesh.load(tmp_path / "a.ply", process=False)
    np.testing.assert_array_equal(read.vertices, mesh.vertex)
    np.testing.assert_array_equal(read.faces, mesh.triangle)
    np.testing.assert_allclose(read.vertex_normals, mesh.normal, atol=1e-6)


@pytest.mark.parametrize("materials", MATERIALS)
def test_written_folders_are_whole(scene, environment, tmp_path, materials):
    given = with_materials(scene, materials)
    for name, write in WRITERS.items():
        folder = tmp_path / name
        command = write(given, environment, PICTURE, folder)
        assert str(PICTURE.samples) in command
        assert (folder / "render.py").is_file() and (folder / "session.py").is_file()
        compile((folder / "render.py").read_text(encoding="utf-8"), "render.py", "exec")
        assert len(list((folder / "meshes").iterdir())) == len(scene.objects)
        written = read_radiance(folder / "map.exr")
        expected = environment.radiance
        expected = to_mitsuba.on_edges(expected) if name == "mitsuba" else expected
        np.testing.assert_array_equal(written, expected)
    root = ElementTree.parse(tmp_path / "mitsuba" / "scene.xml").getroot()
    assert [shape.get("type") for shape in root.iter("shape")] == ["ply"] * len(scene.objects)
    look = root.find("sensor/transform/lookat")
    assert look is not None
    for key in ("origin", "target", "up"):
        values = getattr(CAMERA, {"origin": "eye"}.get(key, key))
        assert tuple(map(float, look.get(key, "").split(","))) == values
    described = json.loads((tmp_path / "blender" / "scene.json").read_text(encoding="utf-8"))
    assert [item["name"] for item in described["objects"]] == [o.name for o in scene.objects]
    with np.load(tmp_path / "blender" / described["objects"][1]["mesh"]) as arrays:
        x, y, z = scene.objects[1].mesh.vertex.T
        np.testing.assert_allclose(arrays["vertex"], np.stack([x, -z, y], axis=1))
    lines = (tmp_path / "luxcore" / "render.cfg").read_text(encoding="utf-8").splitlines()
    assert f"film.width = {PICTURE.width}" in lines
    assert "sampler.sobol.adaptive.strength = 0.0" in lines


def test_materials_are_those_that_all_renderers_have(scene):
    diffuse = [item.material for item in with_materials(scene, "lambert").objects[1:]]
    albedos = [(0.5, 0.4, 0.3), (0.2, 0.5, 0.4), (0.9, 0.6, 0.3), (0.4, 0.3, 0.2)]
    assert all(isinstance(material, Lambert) for material in diffuse)
    np.testing.assert_allclose([material.albedo for material in diffuse], albedos)
    metals = {item.material for item in with_materials(scene, "conductor").objects}
    assert len(metals) == 1 and metals.pop().reflectance == (1.0, 1.0, 1.0)
    with pytest.raises(EnvlightError, match="lambert or conductor"):
        with_materials(scene, "glass")


@pytest.mark.parametrize("name", WRITERS)
def test_other_materials_are_refused_before_anything_is_written(scene, environment, tmp_path, name):
    with pytest.raises(EnvlightError, match=r"ball/1.*Coated.*--materials"):
        WRITERS[name](scene, environment, PICTURE, tmp_path / name)
    assert not (tmp_path / name).exists()
