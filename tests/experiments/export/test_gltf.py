"""glTF files of lights in programs of others: Khronos's validator, Blender and three.js.

ENVLIGHT_NODE names a folder in which `npm install three gltf-validator` was run.
"""

import json
import math
import os
import subprocess
from dataclasses import astuple

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from experiments.export.gltf import LIGHTS, as_gltf
from experiments.export.light_set import light_set
from experiments.questions.production_renderers.written_scene import installed, renderers_python
from renderer.primary import camera_axes
from renderer.render import render
from renderer.scene.blender_frame import UP_TO_Z
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import DirectionalLights, EnvironmentMap, EnvlightError, make_sampler
from samplers.conformance.stress_maps import stress_map
from samplers.sphere import cap_solid_angle
from tests.experiments.export import threejs


def tree_of(content):
    """The JSON of a .glb or .gltf file."""
    if content[:4] != b"glTF":
        return json.loads(content)
    assert int.from_bytes(content[8:12], "little") == len(content)
    return json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])


def lights_of(sampler, map_name="sun-and-sky", count=16):
    environment = stress_map(map_name)
    lighting = make_sampler(sampler).prepare(environment, count, np.random.default_rng(0))
    return light_set(lighting, environment, sampler, count, 0)


@pytest.mark.parametrize("scene", [None, "three-boxes", "teapot"])
@pytest.mark.parametrize("sampler", ["ours", "center-surround"])
def test_files_keep_the_rules_of_the_extension(sampler, scene):
    lights = lights_of(sampler)
    for binary in (True, False):
        tree = tree_of(as_gltf(lights, load_scene(scene) if scene else None, binary))
        assert tree["extensionsUsed"] == sorted(set(tree["extensionsUsed"]))
        made = tree["extensions"][LIGHTS]["lights"]
        assert len(made) == len(lights)
        for light in made:
            assert set(light) == {"type", "name", "intensity", "color"}
            assert light["intensity"] >= 0.0
            assert min(light["color"]) >= 0.0 and max(light["color"]) <= 1.0
        nodes = tree["nodes"]
        placed = [n["extensions"][LIGHTS]["light"] for n in nodes if "extensions" in n]
        assert placed == list(range(len(made)))
        for node in nodes:
            assert abs(math.hypot(*node.get("rotation", [1.0])) - 1.0) < 1e-12
        # Every node is a root or the child of one other.
        below = [child for node in nodes for child in node.get("children", ())]
        assert sorted([*tree["scenes"][0]["nodes"], *below]) == list(range(len(nodes)))
        assert [] not in tree.values()  # glTF has no empty lists


@pytest.mark.parametrize("name", ["three-boxes", "teapot", "glossy"])
def test_a_scene_comes_back(tmp_path, name):
    scene, file = load_scene(name), tmp_path / "scene.glb"
    file.write_bytes(as_gltf(lights_of("median-cut"), scene))
    back = load_scene(file)
    found = {item.name: item for item in back.objects}
    assert set(found) == {item.name for item in scene.objects}
    for item in scene.objects:
        other = found[item.name]
        corners = [np.sort(one.mesh.vertex, axis=0) for one in (item, other)]
        assert np.array_equal(corners[0].min(axis=0), corners[1].min(axis=0))
        assert np.array_equal(corners[0].max(axis=0), corners[1].max(axis=0))
        assert type(other.material) is type(item.material)
        for was, now in zip(astuple(item.material), astuple(other.material), strict=True):
            assert now == pytest.approx(was, rel=1e-15)  # a root and its square
    # Of a camera its place and the way it looks count, not how far.
    for was, now in zip(camera_axes(scene.camera), camera_axes(back.camera), strict=True):
        assert np.allclose(now, was, atol=1e-12)
    assert back.camera.eye == pytest.approx(scene.camera.eye)
    assert back.camera.field_of_view == pytest.approx(scene.camera.field_of_view)


def test_numbers_of_a_light_stand_in_its_node():
    lights = lights_of("median-cut")
    extras = [n["extras"] for n in tree_of(as_gltf(lights))["nodes"] if "extras" in n]
    # Lights of median cut carry the whole map.
    assert sum(one["share_of_energy"] for one in extras) == pytest.approx(1.0, abs=1e-6)
    for one, angle in zip(extras, lights.layers[0].angle, strict=True):
        assert one["solid_angle"] == pytest.approx(cap_solid_angle(angle), rel=1e-12)


def test_a_map_without_light_is_a_file_without_lights():
    black = EnvironmentMap.from_array(np.zeros((4, 8, 3)), "black")
    tree = tree_of(as_gltf(light_set(DirectionalLights.none(), black, "none", 4, 0)))
    assert set(tree) == {"asset", "scene", "scenes"}
    assert "0 of 4 asked" in tree["scenes"][0]["extras"]["title"]


def test_khronos_has_nothing_against_the_files(tmp_path):
    try:
        validator = threejs.node_package("gltf-validator")
    except EnvlightError as missing:
        pytest.skip(str(missing))
    script = (
        f"const v = require({json.dumps(str(validator))}), fs = require('fs');"
        "Promise.all(process.argv.slice(1).map(f => v.validateBytes(new Uint8Array("
        "fs.readFileSync(f))).then(r => r.issues))).then(r => console.log(JSON.stringify(r)))"
    )
    files = []
    for sampler in ("ours", "center-surround"):
        for scene in (None, "three-boxes", "ward-teapot"):
            for suffix in ("glb", "gltf"):
                file = tmp_path / f"{sampler}-{scene}.{suffix}"
                loaded = load_scene(scene) if scene else None
                file.write_bytes(as_gltf(lights_of(sampler), loaded, suffix == "glb"))
                files.append(str(file))
    found = json.loads(subprocess.check_output(["node", "-e", script, *files]))
    for file, issues in zip(files, found, strict=True):
        counts = [issues[kind] for kind in ("numErrors", "numWarnings", "numInfos")]
        assert counts == [0, 0, 0], f"{file}: {issues['messages'][:3]}"


IMPORT = """
import json, sys
import bpy
found = {}
for mode in ("RAW", "SPEC"):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=sys.argv[1], export_import_convert_lighting_mode=mode)
    bpy.context.view_layer.update()
    suns = [one for one in bpy.context.scene.objects if one.type == "LIGHT"]
    found[mode] = {
        one.name: (one.data.type, one.matrix_world.col[2][:3], one.data.energy, one.data.color[:],
                   one["solid_angle"])
        for one in suns
    }
print("FOUND", json.dumps(found))
"""


def test_blender_reads_directions_and_energies(tmp_path):
    python = renderers_python()
    if "bpy" not in installed(python, ("bpy",)):
        pytest.skip(
            f"{python} has no bpy; `make renderers` makes one here, ENVLIGHT_RENDERERS names one"
        )
    lights, file = lights_of("ours"), tmp_path / "lights.glb"
    file.write_bytes(as_gltf(lights, load_scene("three-boxes")))
    plain = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    said = subprocess.check_output([python, "-c", IMPORT, file], text=True, env=plain)
    found = json.loads(said.partition("FOUND ")[2].splitlines()[0])
    assert len(found["RAW"]) == len(lights)
    for layer in lights.layers:
        for index, direction in enumerate(layer.direction):
            # What is unitless is the irradiance; else a watt is 683 lumens.
            for mode, watt in (("RAW", 1.0), ("SPEC", 683.0)):
                kind, towards, energy, color, size = found[mode][f"{layer.name} {index:05d}"]
                assert kind == "SUN"
                # Chords, as arc cosines of float32 are off by more.
                apart = np.linalg.norm(UP_TO_Z.T @ towards - direction)
                assert math.degrees(apart) < 0.1
                got = watt * energy * np.array(color)
                assert np.allclose(got, layer.irradiance[index], rtol=1e-3, atol=0.0)
                assert size == pytest.approx(cap_solid_angle(layer.angle[index]), rel=1e-6)


SIZE = 320, 240


def test_shadows_of_threejs_fall_where_ours_do():
    """Boxes under lights are of constant radiance up to edges: of boxes, of faces, of shadows.

    A texel of a shadow map is 2 · 6 / 4096 = 0.003 wide. What is in its shade is known at its
    centre, 0.0021 off at most, and up to a bias of 0.01 along the light, 0.012 in all; on a
    surface that the light meets at 30° or more, twice that. The nearest surface is 6 from the eye,
    where a pixel is 2 · 6 · tan(15.5°) / 240 = 0.0139 wide: an edge may be two pixels off, and a
    third one for where in a pixel it is asked. All else must agree to the rounding of float32 in a
    shader, of a few dozen operations, 1e-4 with room."""
    towards = np.array([[0.5, 1.0, 0.6], [-0.8, 0.9, 0.45], [0.1, 1.0, 0.9]])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    irradiance = np.array([[3.0, 2.0, 1.0], [0.5, 1.0, 2.0], [1.0, 1.0, 1.0]])
    lights = DirectionalLights(towards, irradiance, np.zeros(3))
    grey, scene = stress_map("constant"), load_scene("three-boxes")
    view = make_view(scene, *SIZE, 1)
    ours = render(view, lights, grey).image
    file = as_gltf(light_set(lights, grey, "three", 3, 0), scene)
    try:
        theirs = threejs.render(file, SIZE).picture
    except EnvlightError as missing:
        pytest.skip(str(missing))
    around = (7, 7, 1)
    low, high = minimum_filter(ours, around), maximum_filter(ours, around)
    inner = (high - low <= 1e-4 * high).all(axis=2) & (view.coverage > 0.0)
    assert inner.mean() > 0.6
    assert np.allclose(theirs[inner], ours[inner], rtol=1e-4, atol=0.0)
    # Each light has shadows there: surfaces of one colour in two shades at least.
    assert len(np.unique(ours[inner][:, 0].round(4))) >= 8
    # Passes of one light each add up to that, but for the order of three sums.
    assert np.allclose(threejs.render(file, SIZE, most=1).picture, theirs, rtol=1e-6)
