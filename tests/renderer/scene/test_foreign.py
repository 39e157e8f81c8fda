"""Meshes and glTF scenes as scenes: what stands where, of which material, seen by which camera."""

import json
import math
import warnings

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual.material import PBRMaterial

from renderer.primary import camera_axes
from renderer.scene.foreign import description
from renderer.scene.load import load_scene
from renderer.scene.materials import Coated, Conductor, Lambert
from samplers.errors import EnvlightError


def gltf(path, change=lambda tree: None, materials=()):
    """A file of boxes, one for each material, which trimesh writes and a function changes."""
    scene = trimesh.Scene()
    for index, material in enumerate(materials or (None,)):
        box = trimesh.creation.box()
        if material is not None:
            box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=material)
        scene.add_geometry(box, node_name=f"box {index}", geom_name=f"box {index}")
    export = trimesh.exchange.gltf
    if path.suffix == ".glb":
        path.write_bytes(export.export_glb(scene, tree_postprocessor=change))
    else:
        tree = json.loads(export.export_gltf(scene, embed_buffers=True)["model.gltf"])
        change(tree)
        path.write_text(json.dumps(tree), encoding="utf-8")
    return path


def objects_of(path):
    return {item.name: item for item in load_scene(path).objects}


TURN = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]
"""A quarter turn about +Y: +Z to +X."""


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_nodes_and_the_camera_stand_where_the_file_says(tmp_path, suffix):
    def nest(tree):
        tree["cameras"] = [
            {"type": "orthographic", "orthographic": {}},
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}},
        ]
        tree["nodes"] = [
            {"translation": [0, 0, 10], "rotation": TURN, "children": [1, 2, 4]},
            {"camera": 1, "translation": [0, 2, 5]},
            {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1]},
            {"camera": 0},
            {"mesh": 0, "scale": [-1, 1, 1], "translation": [0, 0, 20]},
        ]
        tree["scenes"] = [{"nodes": [3, 0]}]

    scene = load_scene(gltf(tmp_path / f"a{suffix}", nest))
    # The frame is turned, then moved: x is where −z was, z where x was.
    assert scene.camera.eye == pytest.approx((5.0, 2.0, 10.0))
    right, up, forward = camera_axes(scene.camera)
    assert np.allclose([right, up, forward], [[0, 0, -1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)
    assert scene.camera.field_of_view == pytest.approx(math.degrees(0.5))
    boxes = sorted(scene.objects, key=lambda item: item.name)
    assert [item.name for item in boxes] == ["box 0", "box 0 2"]
    bounds = sorted((b.mesh.vertex.min(0).tolist(), b.mesh.vertex.max(0).tolist()) for b in boxes)
    wanted = [[[-0.5, -0.5, 6.0], [0.5, 0.5, 8.0]], [[19.5, -0.5, 9.5], [20.5, 0.5, 10.5]]]
    assert np.allclose(bounds, wanted, atol=1e-5)
    for item in boxes:  # a mirror turns nothing inside out
        corner = item.mesh.vertex[item.mesh.triangle].astype(float)
        assert np.linalg.det(corner - item.mesh.vertex.mean(axis=0)).sum() > 0.0


def test_materials_are_the_nearest_of_ours(tmp_path):
    picture = Image.new("RGB", (2, 1))
    picture.putpixel((1, 0), (255, 255, 188))
    materials = [
        PBRMaterial(name="a", baseColorFactor=[0.5, 0.25, 1.0, 1.0], metallicFactor=0.4,
                    roughnessFactor=0.3),
        PBRMaterial(name="a", baseColorFactor=[0.5, 0.25, 1.0, 1.0], metallicFactor=0.6,
                    roughnessFactor=0.3),
        PBRMaterial(name="b", baseColorTexture=picture, metallicFactor=0.0, roughnessFactor=1.0),
        PBRMaterial(name="c", metallicFactor=0.0, emissiveFactor=[1.0, 0.0, 0.0]),
    ]  # fmt: skip

    def extend(tree):
        tree["materials"][0]["extensions"] = {"KHR_materials_ior": {"ior": 1.2}}
        tree["materials"][2]["extensions"] = {"KHR_materials_specular": {"specularFactor": 0.0}}
        tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.25, 1.0, 1.0]
        tree["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.25, 1.0, 1.0]

    path = gltf(tmp_path / "a.glb", extend, materials)
    with pytest.warns(UserWarning, match="material c this is left aside: emissiveFactor"):
        found = objects_of(path)
    alpha = pytest.approx(0.09)
    coated, metal, paper = (found[f"box {index}"].material for index in range(3))
    assert coated == Coated((0.5, 0.25, 1.0), coated.roughness, 1.2) and coated.roughness == alpha
    assert metal == Conductor((0.5, 0.25, 1.0), metal.roughness) and metal.roughness == alpha
    # Half black, half white, and of blue sRGB's 188: half of 0.5, to half a step of 0.006, halved.
    assert isinstance(paper, Lambert)
    assert paper.albedo == pytest.approx((0.5, 0.5, 0.25), abs=1.5e-3)


def test_what_has_no_material_is_grey_and_of_a_default_one_metal(tmp_path):
    assert objects_of(gltf(tmp_path / "a.glb"))["a"].material == Lambert((0.6, 0.6, 0.6))

    def empty(tree):
        tree["materials"] = [{}]

    path = gltf(tmp_path / "b.glb", empty, [PBRMaterial(name="x")])
    assert objects_of(path)["b"].material == Conductor((1.0, 1.0, 1.0), 1.0)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".glb"])
def test_a_mesh_gets_a_ground_and_is_all_in_view(tmp_path, suffix):
    path = tmp_path / f"long{suffix}"
    trimesh.creation.box((0.003, 0.001, 0.002), transform=np.eye(4)).export(path)
    scene = load_scene(path)
    ground, box = scene.objects
    assert ground.mesh.vertex[:, 1].max() == 0.0
    low, high = box.mesh.vertex.min(axis=0), box.mesh.vertex.max(axis=0)
    assert low == pytest.approx([-1.0, 0.0, -2 / 3], abs=1e-6)
    assert high == pytest.approx([1.0, 2 / 3, 2 / 3], abs=1e-6)
    right, up, forward = camera_axes(scene.camera)
    seen = box.mesh.vertex - np.array(scene.camera.eye)
    half = math.tan(math.radians(0.5 * scene.camera.field_of_view)) * (seen @ forward)
    assert (np.abs(seen @ up) < half).all() and (np.abs(seen @ right) < half).all()
    # A scene file that says the same is the same scene.
    path.with_suffix(".toml").write_text(description(path), encoding="utf-8")
    assert load_scene(path.with_suffix(".toml")).digest == scene.digest


def test_several_meshes_without_a_camera_keep_their_places(tmp_path):
    def apart(tree):
        tree["nodes"][1]["translation"] = [0.0, 3.0, 0.0]

    path = gltf(tmp_path / "a.glb", apart, [PBRMaterial(name="a"), PBRMaterial(name="b")])
    found = objects_of(path)
    heights = sorted(float(found[f"box {i}"].mesh.vertex[:, 1].min()) for i in range(2))
    assert heights == pytest.approx([0.0, 1.5], abs=1e-6)  # 4 high becomes 2


def cut(tree):
    tree["nodes"] = [{"mesh": 7}]


def lost(tree):
    tree["buffers"] = [{"uri": "../other.bin", "byteLength": 10}]


def no_color(tree):
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": "red"}}]


def nowhere(tree):
    tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5}}]
    tree["nodes"].append({"camera": 0, "scale": [0, 0, 0]})
    tree["scenes"][0]["nodes"].append(len(tree["nodes"]) - 1)


@pytest.mark.parametrize("change", [cut, lost, no_color, nowhere])
def test_files_that_make_no_scene_end_in_a_sentence(tmp_path, change):
    path = gltf(tmp_path / "a.gltf", change, [PBRMaterial(name="a")])
    with pytest.raises(EnvlightError, match=r"a\.gltf: ") as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.glb", "No such file or directory; check the path"),
        ("none.xml", "No such file or directory; check the path"),
        ("none.pbrt", "No such file or directory; check the path"),
        ("box.blend", "scenes of Blender are not read; give a scene's .toml file"),
        ("ball.fbx", r"'.fbx' is not read; give a scene's .toml file, or one of .ply, .obj"),
        ("list.gltf", "it has no JSON; export again|not a readable mesh"),
        ("points.ply", "no triangles|not a readable mesh"),
    ],
)
def test_what_is_no_scene_is_refused(tmp_path, name, said):
    (tmp_path / "list.gltf").write_text(json.dumps([1]))
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "points.ply")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(EnvlightError, match=said):
            load_scene(tmp_path / name)
