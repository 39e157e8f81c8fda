"""Scene files: what they say is what the scene is; mistakes are named with file, key and remedy."""

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import trimesh

from renderer.modelling import box, sphere
from renderer.scene.materials import Conductor, Lambert
from renderer.scene.scene_file import MATERIALS, read_scene
from samplers.errors import EnvlightError
from tests.renderer.scene.material_pictures import FOLDER, blocks, materials

GOOD = """
name = "test"
[camera]
eye = [0.0, 2.0, 6]
target = [0, 1, 0]
field_of_view = 35
[ground]
radius = 8.0
material = "chalk"
[materials.chalk]
type = "lambert"
albedo = [0.5, 0.5, 0.5]
[materials.gold]
type = "conductor"
reflectance = [1, 0.77, 0.34]
roughness = 0.2
[[objects]]
name = "brick"
mesh = "parts/brick.ply"
material = "gold"
up = "z"
size = 2.0
turn = 90
rest = true
position = [1.0, 0.5, 0.0]
[[objects]]
mesh = "ball.obj"
material = "chalk"
crease = 180
"""


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "scene" / "parts").mkdir(parents=True)
    brick, ball = box((1.0, 2.0, 4.0)).moved(7.0, 8.0, 9.0), sphere(1.0, 6)
    for shape, name in ((brick, "scene/parts/brick.ply"), (ball, "scene/ball.obj")):
        trimesh.Trimesh(shape.vertex, shape.triangle, process=False).export(tmp_path / name)
    trimesh.Trimesh(ball.vertex, ball.triangle).export(tmp_path / "outside.ply")
    return tmp_path / "scene"


def load(folder: Path, text: str = GOOD):
    (folder / "mine.toml").write_text(text, "utf-8")
    return read_scene(folder / "mine.toml")


def test_objects_materials_and_camera_are_as_written(folder):
    scene = load(folder)
    assert scene.name == "test"
    assert [item.name for item in scene.objects] == ["ground", "brick", "ball"]
    assert scene.objects[1].material == Conductor((1.0, 0.77, 0.34), 0.2)
    assert scene.objects[2].material == Lambert((0.5, 0.5, 0.5))
    assert scene.camera.eye == (0.0, 2.0, 6.0)
    assert scene.camera.field_of_view == 35.0
    assert scene.camera.up == (0.0, 1.0, 0.0)


def test_meshes_are_placed_in_the_order_of_the_manual(folder):
    # The brick's 4 along z stand up and are scaled to 2, its 1 × 2 across become 0.5 × 1 and
    # change places by the quarter turn; it rests at the height it is moved to. Float32 throughout.
    vertex = load(folder).objects[1].mesh.vertex
    assert vertex.min(axis=0) == pytest.approx((1.0 - 0.5, 0.5, -0.25), abs=1e-6)
    assert vertex.max(axis=0) == pytest.approx((1.0 + 0.5, 2.5, 0.25), abs=1e-6)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_the_upward_axis_points_up(folder, axis):
    spike = np.zeros((4, 3))
    spike[0, "xyz".index(axis)] = 3.0
    spike[2:] = np.eye(3)[["xyz".index(other) for other in "xyz" if other != axis]]
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    trimesh.Trimesh(spike, faces, process=False).export(folder / "ball.obj")
    mesh = load(folder, GOOD + f'up = "{axis}"\n').objects[2].mesh
    assert mesh.vertex[:, 1].max() == pytest.approx(3.0)
    assert mesh.vertex[:, 1].min() == pytest.approx(0.0, abs=1e-6)


def test_an_object_without_placement_stays_where_its_file_has_it(folder):
    mesh = load(folder).objects[2].mesh
    assert np.linalg.norm(mesh.vertex, axis=1) == pytest.approx(1.0, abs=1e-6)


def test_creases_are_kept_unless_the_file_says_otherwise(folder):
    assert len(load(folder).objects[1].mesh.vertex) == 24
    smooth = GOOD.replace("turn = 90", "turn = 90\ncrease = 180")
    assert len(load(folder, smooth).objects[1].mesh.vertex) == 8


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("eye = [0.0, 2.0, 6]", "", r"\[camera\]: eye: it is missing"),
        ("eye = [0.0, 2.0, 6]", "eye = [0.0, 2.0]", r"\[camera\]: eye: .*three finite numbers"),
        ("eye = [0.0, 2.0, 6]", "eye = [0, 2, nan]", r"\[camera\]: eye: .*three finite numbers"),
        ("eye = [0.0, 2.0, 6]", "eye = [0, 1, 0]", r"\[camera\]: .*same point"),
        ("field_of_view = 35", "field_of_view = 190", r"\[camera\]: .*between 0 and 180"),
        ("field_of_view = 35", "field_of_veiw = 35", r"field_of_veiw: .*'field_of_view'"),
        ("radius = 8.0", "radius = -1", r"\[ground\]: radius: .*above 0"),
        ("radius = 8.0", 'radius = "8"', r"\[ground\]: radius: .*not a finite number"),
        ("radius = 8.0", "radius = 1" + "0" * 400, r"\[ground\]: radius: .*not a finite number"),
        ('type = "lambert"', 'type = "lambart"', r"\[materials\.chalk\]: type: .*'lambert'"),
        ('type = "lambert"', "type = 3", r"\[materials\.chalk\]: type: "),
        ("albedo =", "albdeo =", r"\[materials\.chalk\]: albedo: it is missing"),
        ("albedo = [0.5,", "albedo = [1.5,", r"\[materials\.chalk\]: .*albedo.*\[0, 1\]"),
        ("roughness = 0.2", "roughness = nan", r"\[materials\.gold\]: .*roughness"),
        ("roughness = 0.2", "roughness = 0.2\nior = 2", r"\[materials\.gold\]: ior: .*not known"),
        ('material = "gold"', 'material = "glod"', r"number 1: material: 'glod'.*'gold'"),
        ('mesh = "parts/brick.ply"', "", r"number 1: mesh: it is missing"),
        ("parts/brick.ply", "parts/brik.ply", r"number 1: .*brik\.ply: .*check the path"),
        ("parts/brick.ply", "../outside.ply", r"number 1: mesh: .*outside the scene's folder"),
        ("parts/brick.ply", "parts/../../outside.ply", "outside the scene's folder"),
        ("parts/brick.ply", "a\\u0000.ply", "mesh: .*not a path"),
        ("ball.obj", "ball.blend", r"number 2: .*'\.blend'.*convert"),
        ("size = 2.0", "size = 0", r"number 1: size: .*above 0"),
        ("size = 2.0", "size = 2.0\nscale = 3.0", r"number 1: scale: .*one of the two"),
        ("size = 2.0", "scale = 1e200", r"number 1: .*NaN or infinite"),
        ('up = "z"', 'up = "w"', r"number 1: up: 'w'.*'x' or 'y' or 'z'"),
        ("rest = true", 'rest = "yes"', r"number 1: rest: .*true or false"),
        ("turn = 90", "rotate = 90", r"number 1: rotate: it is not known"),
        ('name = "brick"', 'name = "ball"', "two objects are called 'ball'"),
        ('name = "brick"', 'name = ""', r"number 1: name: .*not a text"),
        ("[ground]", "[grounds]", "grounds: it is not known; use .*'ground'"),
        ("[ground]", "[ground", "not valid TOML"),
        ("[ground]", f"a = {'[' * 9999}", "not valid TOML"),
        ("[[objects]]", "[[things]]", "things: it is not known"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
def test_mistakes_are_named_with_file_key_and_remedy(folder, old, new, message):
    assert old in GOOD
    with pytest.raises(EnvlightError, match=message) as caught:
        load(folder, GOOD.replace(old, new))
    assert "mine.toml" in str(caught.value)


def test_absolute_paths_are_refused_even_inside_the_folder(folder):
    inside = (folder / "ball.obj").as_posix()
    with pytest.raises(EnvlightError, match="outside the scene's folder"):
        load(folder, GOOD.replace("ball.obj", inside))


def test_links_that_lead_out_of_the_folder_are_refused(folder):
    try:
        (folder / "link.ply").symlink_to(folder.parent / "outside.ply")
    except OSError:
        pytest.skip("this system lets tests make no symbolic links")
    with pytest.raises(EnvlightError, match="outside the scene's folder"):
        load(folder, GOOD.replace("ball.obj", "link.ply"))


def test_files_that_are_no_scenes_are_refused(folder):
    with pytest.raises(EnvlightError, match=r"none\.toml.*check the path"):
        read_scene(folder / "none.toml")
    (folder / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(EnvlightError, match="UTF-8"):
        read_scene(folder / "binary.toml")
    with pytest.raises(EnvlightError, match="camera: it is missing"):
        load(folder, "")
    with pytest.raises(EnvlightError, match="no objects"):
        load(folder, "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n")


def test_the_page_shows_a_file_and_every_material(tmp_path):
    """Its blocks are read as they stand and name every field; the pictures are there, and small."""
    cube = trimesh.creation.box()
    cube.export(tmp_path / "bunny.ply")
    trimesh.Scene({"Cube": cube}).export(tmp_path / "table.glb")
    whole, *tables = blocks()
    scene = load(tmp_path, whole)
    assert [item.name for item in scene.objects] == ["ground", "bunny", "Cube"]
    assert load(tmp_path, whole).digest == scene.digest
    unnamed = whole.partition("\n")[2]
    assert load(tmp_path, unnamed).name == "mine" and scene.name == "bunny-on-a-table"
    shown = dict(materials())
    assert {kind: type(one) for kind, one in shown.items()} == MATERIALS
    for block, material in zip(tables, shown.values(), strict=True):
        assert all(f"\n{field.name} = " in block for field in fields(material))
        (name,) = re.findall(r"\[materials\.(\w+)\]", block)
        text = whole.replace('material = "chalk"', f'material = "{name}"') + block
        assert load(tmp_path, text).objects[0].material == material
    sizes = [(FOLDER / "pictures" / f"{kind}.webp").stat().st_size for kind in shown]
    assert min(sizes) > 2_000 and sum(sizes) < 150_000
