"""The pages from the docstrings: built without a warning, every module and public name on them."""

import pytest

pytest.importorskip("pdoc", reason="pdoc is not installed: the extra 'docs' holds it")

from experiments.cli.api_pages import write_pages


def test_pages_are_built_without_a_warning(tmp_path):
    write_pages(tmp_path, ("renderer",))
    assert "load_scene" in (tmp_path / "renderer.html").read_text(encoding="utf-8")
    assert (tmp_path / "renderer" / "scene" / "scene_file.html").is_file()
