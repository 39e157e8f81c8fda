"""`envlight scene` writes a scene with its map, and says how to render it."""

import pytest
from typer.testing import CliRunner

from experiments.cli.main import app
from samplers import EnvlightError


def test_scene_is_written_with_the_command_that_renders_it(tmp_path, maps_folder):
    folder = tmp_path / "out"
    words = ["scene", "three-boxes", "--to", "luxcore", str(folder), "--width", "40"]
    words += ["--height", "30", "--samples", "5", "--environment", str(maps_folder / "sun.exr")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "there: luxcoreconsole -D batch.haltspp 5 render.cfg" in result.output
    assert "film.width = 40\n" in (folder / "render.cfg").read_text(encoding="utf-8")
    assert (folder / "map.exr").is_file()
    again = CliRunner().invoke(app, words)
    assert isinstance(again.exception, EnvlightError) and "holds something" in str(again.exception)


def test_unknown_programs_are_refused(tmp_path):
    result = CliRunner().invoke(app, ["scene", "vase", "--to", "arnold", str(tmp_path / "a")])
    assert isinstance(result.exception, EnvlightError)
    assert str(result.exception) == "--to arnold: use mitsuba, blender, luxcore"
    with pytest.raises(FileNotFoundError):
        (tmp_path / "a").stat()
