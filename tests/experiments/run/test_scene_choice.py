"""Scenes from the command line, and how the files of a scene count in a key."""

from dataclasses import replace

import pytest
import trimesh

from experiments.maps.sources import EnvironmentSource
from experiments.run.case import Case, choose_scenes, scene_file_digests
from experiments.run.store import IMAGE, Store
from experiments.wu2025.table1 import table1
from samplers import EnvlightError
from tests.experiments.stored import run_plan
from tests.experiments.tiny import TINY

BOX = """v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""
SCENE = """
camera = { eye = [0, 2, 6], target = [0, 0.8, 0] }
materials.chalk = { type = "lambert", albedo = [0.5, 0.5, 0.5] }
objects = [{ mesh = "box.obj", material = "chalk", size = 2 }]
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "box.obj").write_text(BOX)
    path = tmp_path / "mine.toml"
    path.write_text(SCENE)
    return path


def key(path):
    scene_file_digests.cache_clear()
    return Case(path.stem, EnvironmentSource("constant", height=16), TINY, str(path)).reference_key


def test_names_patterns_and_files(scene):
    chosen = choose_scenes(["vase,three-*", str(scene), "vase"])
    assert chosen == ("vase", "three-boxes", str(scene))


def test_what_is_wrong_is_told_before_anything_runs(scene, tmp_path):
    with pytest.raises(EnvlightError, match="no scene matches 'vas'"):
        choose_scenes(["vas"])
    (tmp_path / "box.obj").unlink()
    with pytest.raises(EnvlightError, match=r"mine.toml: .*box.obj: No such file"):
        choose_scenes([str(scene)])


def test_a_file_named_like_another_scene_is_refused(scene, tmp_path):
    (tmp_path / "vase.toml").write_text(SCENE)
    with pytest.raises(EnvlightError, match="two scenes are called 'vase': rename the file"):
        choose_scenes(["vase", str(tmp_path / "vase.toml")])


def test_the_scene_file_and_its_meshes_count_and_their_place_does_not(scene, tmp_path):
    first = key(scene)
    moved = tmp_path / "moved"
    moved.mkdir()
    (moved / "mine.toml").write_text(SCENE)
    (moved / "box.obj").write_text(BOX)
    assert key(moved / "mine.toml") == first
    (moved / "box.obj").write_text(BOX.replace("v 1 0 0", "v 2 0 0"))
    other_mesh = key(moved / "mine.toml")
    scene.write_text(SCENE.replace("size = 2", "size = 3"))
    assert len({first, other_mesh, key(scene)}) == 3


def test_what_a_gltf_file_reads_counts_in_its_key(tmp_path):
    box = trimesh.creation.box()
    for name, content in trimesh.exchange.gltf.export_gltf(box.scene(), merge_buffers=True).items():
        (tmp_path / name).write_bytes(content)
    first = key(tmp_path / "model.gltf")
    (buffer,) = tmp_path.glob("*.bin")
    buffer.write_bytes(buffer.read_bytes() + b"    ")
    assert key(tmp_path / "model.gltf") != first


@pytest.mark.parametrize("name", ["mine.toml", "mine.glb", "mine.stl"])
def test_a_run_measures_on_a_scene_file(scene, grid, tmp_path, name):
    scene = tmp_path / name
    if not scene.exists():
        trimesh.creation.box().export(scene)
    (chosen,) = choose_scenes([str(scene)])
    mine = replace(grid, scenes=(chosen,), environments=grid.environments[2:3])
    measurements = mine.measurements()
    with Store.writing(tmp_path / "run") as store:
        assert run_plan(table1(), store, measurements, lambda *_: None) == 0
        assert {one.result["scene"] for one in store.results(IMAGE)} == {"mine"}
    assert (tmp_path / "run" / "images" / "mine").is_dir()
