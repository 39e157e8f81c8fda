"""The pages from the docstrings: built without a warning, every module and public name on them."""

import pytest

pytest.importorskip("pdoc", reason="pdoc is not installed: the extra 'docs' holds it")

from experiments.cli.api_pages import write_pages
from samplers import EnvlightError


def test_pages_are_built_without_a_warning_and_never_over_something(tmp_path):
    folder = tmp_path / "api"
    write_pages(folder, ("renderer",))
    assert "load_scene" in (folder / "renderer.html").read_text(encoding="utf-8")
    assert (folder / "renderer" / "scene" / "scene_file.html").is_file()
    with pytest.raises(EnvlightError, match="it holds something already"):
        write_pages(folder, ("metrics",))
