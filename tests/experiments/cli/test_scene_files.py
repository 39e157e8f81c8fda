"""What `envlight scene`, `new-scene` and `new-map` write, and what they say about it."""

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from experiments.cli.lights import new_scene
from experiments.cli.main import app
from renderer.image import write_exr
from renderer.scene.load import load_scene
from samplers import EnvironmentMap, EnvlightError
from tests.renderer import lab


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


def test_a_new_scene_stands_beside_its_mesh(tmp_path, capsys):
    mesh, there = tmp_path / "in" / "box.ply", tmp_path / "out" / "mine.toml"
    mesh.parent.mkdir()
    trimesh.creation.box().export(mesh)
    new_scene(mesh)
    assert load_scene(mesh.with_suffix(".toml")).digest == load_scene(mesh).digest
    new_scene(mesh, there)
    assert f"copied: {there.with_name('box.ply')}" in capsys.readouterr().out
    assert load_scene(there).digest == load_scene(mesh).digest
    with pytest.raises(EnvlightError, match=r"mine\.toml: it is there already"):
        new_scene(mesh, there)
    there.with_name("box.ply").write_bytes(b"other")
    with pytest.raises(EnvlightError, match=r"box\.ply: another file is there"):
        new_scene(mesh, there.with_name("more.toml"))


MITSUBA = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0,2,5" target="0,0,0" up="0,1,0"/></transform></sensor>
<shape type="sphere"/><shape type="cube" id="box"><bsdf type="conductor"/></shape></scene>"""


def test_a_new_scene_of_solids_stands_beside_their_meshes(tmp_path):
    file = tmp_path / "solids.xml"
    file.write_text(MITSUBA, encoding="utf-8")
    new_scene(file)
    was, now = load_scene(file), load_scene(tmp_path / "solids.toml")
    assert {item.name: item.material for item in now.objects} == {
        item.name: item.material for item in was.objects
    }
    assert lab.triangle_count(now) == lab.triangle_count(was)
    assert now.camera.eye == pytest.approx(was.camera.eye)
    with pytest.raises(EnvlightError, match=r"more\.glb: it is there already"):
        file.with_name("more.glb").touch()
        new_scene(file, file.with_name("more.toml"))


def test_a_new_map_is_read_where_the_picture_was_not(tmp_path):
    odd, made = tmp_path / "odd.exr", tmp_path / "made.exr"
    write_exr(odd, np.ones((47, 96, 3), np.float32))
    with pytest.raises(EnvlightError, match=r"96×47 pixels; .*`envlight new-map` makes one"):
        EnvironmentMap.from_file(odd)
    result = CliRunner().invoke(app, ["new-map", str(odd), str(made), "--height", "16"])
    assert (result.exit_code, result.output) == (0, f"{made}: 32×16 pixels\n")
    assert EnvironmentMap.from_file(made).total_flux == pytest.approx(4.0 * np.pi, rel=1e-6)
    again = CliRunner().invoke(app, ["new-map", str(odd), str(odd)])
    assert "this command reads that file" in str(again.exception)
