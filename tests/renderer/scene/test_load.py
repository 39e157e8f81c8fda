"""Scenes by name or by file, and the renderer's names for a library's user."""

import subprocess
import sys

import pytest

from renderer import load_scene, make_view, render
from renderer.render import render as same_render
from samplers import EnvlightError

SCENE = """
camera = { eye = [0, 2, 6], target = [0, 0.8, 0] }
ground = { radius = 3, material = "chalk" }
materials.chalk = { type = "lambert", albedo = [0.5, 0.5, 0.5] }
"""


def test_a_name_gives_the_built_in_scene():
    assert load_scene("three-boxes").name == "three-boxes"


def test_a_path_gives_the_scene_of_the_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(SCENE)
    assert load_scene(path).digest == load_scene(str(path)).digest
    assert len(make_view(load_scene(path), 16, 12)) > 0


def test_unknown_names_and_files_are_told(tmp_path):
    with pytest.raises(EnvlightError, match="no scene is called 'vas'; did you mean vase"):
        load_scene("vas")
    with pytest.raises(EnvlightError, match=r"mine.toml: No such file.*; check the path"):
        load_scene(tmp_path / "mine.toml")


@pytest.mark.parametrize("first", ["", "import renderer.packet.ward"])
def test_render_is_the_function_whatever_was_imported_before(first):
    code = f"{first}\nfrom renderer import render\nfrom renderer.render import render as r\n" + (
        "import renderer.scenes\nfrom renderer import render as again\n"
        "assert render is r is again and callable(render)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert render is same_render


def test_unknown_names_of_the_package_are_told():
    with pytest.raises(ImportError):
        from renderer import no_such_thing  # noqa: F401
