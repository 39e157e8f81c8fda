"""The pages from the docstrings: built without a warning, every module and public name on them."""

import pytest

pytest.importorskip("pdoc", reason="pdoc is not installed: the extra 'docs' holds it")

from experiments.cli.api_pages import write_pages
from samplers import EnvlightError


def test_pages_are_built_without_a_warning_and_replace_their_own_alone(tmp_path):
    folder = tmp_path / "api"
    write_pages(folder, ("renderer",))
    assert "load_scene" in (folder / "renderer.html").read_text(encoding="utf-8")
    assert (folder / "renderer" / "scene" / "scene_file.html").is_file()
    (folder / "notes.txt").write_text("mine")
    write_pages(folder, ("metrics",))
    assert (folder / "notes.txt").read_text() == "mine" and (folder / "metrics.html").is_file()
    assert not (folder / "renderer.html").exists() and not (folder / "renderer").exists()


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(EnvlightError, match="it holds something, but no envlight-api"):
        write_pages(tmp_path, ("metrics",))
    assert [file.name for file in tmp_path.iterdir()] == ["notes.txt"]
