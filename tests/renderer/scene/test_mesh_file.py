"""Mesh files are read alike in all formats; broken ones are refused or cleaned, with a sentence."""

import json
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from renderer.modelling import Shape, rounded_box, shade
from renderer.scene.mesh_file import INSTANCES, read_parts, read_shape
from samplers.errors import EnvlightError
from tests.samplers.maps import data_folder

SHAPE = rounded_box((1.0, 2.0, 3.0), 0.2)


def write(path: Path, shape: Shape = SHAPE) -> Path:
    trimesh.Trimesh(shape.vertex, shape.triangle, process=False).export(path)
    return path


def ply(path: Path, vertices: list[str], faces: list[str]) -> Path:
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    path.write_text("\n".join([*head, *vertices, *faces, ""]))
    return path


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".stl", ".PLY"])
def test_a_solid_comes_back_closed(tmp_path, suffix):
    shape = read_shape(write(tmp_path / f"solid{suffix}"))
    mesh = trimesh.Trimesh(shape.vertex, shape.triangle, process=False)
    assert mesh.is_watertight
    # Positions are rounded to float32, or to OBJ's eight digits.
    assert mesh.volume == pytest.approx(SHAPE_VOLUME, rel=1e-6)


SHAPE_VOLUME = trimesh.Trimesh(SHAPE.vertex, SHAPE.triangle).volume


def test_vertices_that_a_file_splits_are_welded(tmp_path):
    corner = SHAPE.vertex[SHAPE.triangle].reshape(-1, 3)
    split = Shape(corner, np.arange(len(corner)).reshape(-1, 3))
    shape = read_shape(write(tmp_path / "split.ply", split))
    assert len(shape.vertex) == len(SHAPE.vertex)


def test_nodes_of_a_glb_are_placed(tmp_path):
    scene = trimesh.Scene()
    part = trimesh.Trimesh(SHAPE.vertex, SHAPE.triangle, process=False)
    for x in (0.0, 5.0):
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix((x, 0, 0)))
    scene.export(tmp_path / "two.glb")
    shape = read_shape(tmp_path / "two.glb")
    assert np.ptp(shape.vertex[:, 0]) == pytest.approx(6.0, abs=1e-6)
    assert len(shape.triangle) == 2 * len(SHAPE.triangle)


def test_quadrilaterals_become_triangles(tmp_path):
    file = tmp_path / "quad.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nf 1 2 3 4\n")
    assert len(read_shape(file).triangle) == 2


def test_an_obj_opens_no_other_file(tmp_path):
    folder = tmp_path / "inner"
    folder.mkdir()
    (tmp_path / "outer.mtl").write_bytes(b"\xff\xfe not a material")
    file = folder / "mesh.obj"
    file.write_text("mtllib ../outer.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(read_shape(file).triangle) == 1


TRIANGLE = ["0 0 0", "1 0 0", "0 1 0"]


LAYOUTS = [
    (" ", "\t"),
    ("\n", " \n   "),
    ("\n", "\r"),
    ("\n", " # a corner\n"),
    ("v 0 0 0", "\ufeffv 0 0 0"),
]
"""What stands in an OBJ file, and in another's place."""


@pytest.mark.parametrize(("plain", "other"), LAYOUTS)
def test_an_obj_is_read_however_its_lines_are_laid_out(tmp_path, plain, other):
    file, text = tmp_path / "mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    file.write_text(text.replace(plain, other), encoding="utf-8", newline="")
    assert read_shape(file).vertex.sum() == 2.0
    file.write_text(text.replace("f 1", "f 0").replace(plain, other), encoding="utf-8", newline="")
    with pytest.raises(EnvlightError, match="a face names vertex 0, and the first is 1"):
        read_shape(file)


def test_text_that_is_cut_short_anywhere_is_named(tmp_path):
    whole = ply(tmp_path / "m.ply", [*TRIANGLE, "1 1 0"], ["3 0 1 2", "4 1 3 2 0"]).read_text()
    for kept in range(whole.index("end_header") + 12, len(whole) - 2):
        (tmp_path / "m.ply").write_text(whole[:kept])
        with pytest.raises(EnvlightError, match="it is cut short"):
            read_shape(tmp_path / "m.ply")
    solid = trimesh.Trimesh(SHAPE.vertex, SHAPE.triangle).export(file_type="stl_ascii")
    (tmp_path / "m.stl").write_text(solid.rpartition("endsolid")[0])
    with pytest.raises(EnvlightError, match="cut short before its endsolid"):
        read_shape(tmp_path / "m.stl")


def test_triangles_without_area_are_left_out_with_a_warning(tmp_path):
    file = ply(tmp_path / "m.ply", [*TRIANGLE, "2 0 0"], ["3 0 1 2", "3 0 1 3", "3 1 1 2"])
    with pytest.warns(UserWarning, match=r"m\.ply: 2 of 3 triangles have no area"):
        shape = read_shape(file)
    assert len(shape.triangle) == 1
    assert len(shape.vertex) == 3


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (["0 0 0", "1 0 0", "0 nan 0"], ["3 0 1 2"], "vertex 2 is NaN"),
        (["0 0 0", "1e39 0 0", "0 1 0"], ["3 0 1 2"], "vertex 1 is NaN or infinite"),
        (TRIANGLE, [], "no triangles"),
        (["0 0 0", "1 0 0", "2 0 0"], ["3 0 1 2"], "none of its 1 triangles has an area"),
        (TRIANGLE, ["3 0 1 7"], "does not exist|not a readable mesh"),
    ],
)
def test_meshes_that_cannot_be_shown_are_refused(tmp_path, vertices, faces, message):
    with pytest.raises(EnvlightError, match=message) as caught:
        read_shape(ply(tmp_path / "bad.ply", vertices, faces))
    assert "bad.ply" in str(caught.value)


def test_a_bad_vertex_that_nothing_uses_does_no_harm(tmp_path):
    file = ply(tmp_path / "m.ply", ["nan nan nan", *TRIANGLE], ["3 1 2 3"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read_shape(file).vertex) == 3


@pytest.mark.parametrize(
    ("content", "what"),
    [(b"", ""), (b"ply\nnonsense", ""), (bytes(range(256)), ""), (b"\x1f\x8b\b", "it is .* gzip;")],
)
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".glb", ".gltf"])
def test_damaged_files_are_refused(tmp_path, content, what, suffix):
    file = tmp_path / f"damaged{suffix}"
    file.write_bytes(content)
    with pytest.raises(EnvlightError, match=f"damaged.*: {what}"):
        read_shape(file)


@pytest.mark.parametrize(("lost", "what"), [(1, "cut"), (60, "cut"), (300, "cut"), (-7, "damaged")])
def test_a_binary_stl_of_another_length_is_named(tmp_path, lost, what):
    file = write(tmp_path / "other.stl")
    content = file.read_bytes()
    file.write_bytes(content[:-lost] if lost > 0 else content + bytes(-lost))
    sizes = f"{len(content):,} .*{len(content) - lost:,} f"
    with pytest.raises(EnvlightError, match=f"is {what}.*{sizes}"):
        read_shape(file)


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        (".obj", "v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n"),
        (".obj", "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"),
        (
            ".ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
            "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0\n3 0 0 0\n",
        ),
    ],
)
def test_vertices_without_three_coordinates_are_refused(tmp_path, suffix, content):
    path = tmp_path / f"flat{suffix}"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(EnvlightError, match=r"not of three numbers each|not a readable mesh"):
        read_shape(path)


def glb(path: Path, change) -> Path:
    """A small GLB whose JSON was changed."""
    content = write(path).read_bytes()
    size = int.from_bytes(content[12:16], "little")
    tree = json.loads(content[20 : 20 + size])
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :]
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON")
    path.write_bytes(head + text + rest)
    return path


def test_nodes_far_below_others_are_placed_without_delay(tmp_path):
    """A node has the moves of all above it; by the library alone this takes minutes."""
    depth = 400

    def nested(tree):
        down = [{"children": [k + 1], "translation": [0.5, 0, 0]} for k in range(depth)]
        tree["nodes"] = [*down, {"mesh": 0}]
        tree["scenes"] = [{"nodes": [0]}]

    moved = read_shape(glb(tmp_path / "deep.glb", nested)).vertex
    still = read_shape(write(tmp_path / "still.glb")).vertex
    assert moved.min(axis=0) - still.min(axis=0) == pytest.approx([0.5 * depth, 0, 0], abs=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda tree: tree["accessors"][0].update(sparse={}), "accessor 0 is sparse"),
        (lambda tree: tree["accessors"][1].pop("bufferView"), "accessor 1 is .* without data"),
        (lambda tree: tree["accessors"][1].update(normalized=True), "accessor 1 is .*normalized"),
        (lambda tree: tree["meshes"][0]["primitives"][0].update(mode=6), "triangle fans"),
        (
            lambda tree: tree["nodes"][-1].update(extensions={INSTANCES: 0}),
            f"it needs {INSTANCES}, ",
        ),
    ],
)
def test_triangles_that_a_glb_keeps_in_other_ways_are_named(tmp_path, change, message):
    with pytest.raises(EnvlightError, match=message):
        read_shape(glb(tmp_path / "other.glb", change))


def test_what_moves_the_triangles_of_a_glb_is_told(tmp_path):
    moved = {"skins": [{"joints": [0]}], "nodes": [{"mesh": 0, "weights": [1.0]}]}
    with pytest.warns(UserWarning, match="left aside: skins, morph targets; the mesh stands"):
        read_parts(glb(tmp_path / "moved.glb", lambda tree: tree.update(moved)))


def test_files_that_a_gltf_file_names_are_found_or_named(tmp_path):
    found = trimesh.Trimesh(SHAPE.vertex, SHAPE.triangle).scene().export(file_type="gltf")
    text = found.pop("model.gltf").decode().replace("gltf_buffer_", "its%20data%20")
    (tmp_path / "m.gltf").write_text(text)
    for name, content in found.items():
        (tmp_path / name.replace("gltf_buffer_", "its data ")).write_bytes(content)
    assert len(read_shape(tmp_path / "m.gltf").triangle) == len(SHAPE.triangle)
    (tmp_path / "its data 0.bin").unlink()
    with pytest.raises(EnvlightError, match=r"it needs 'its%20data%200\.bin', no file in its f"):
        read_shape(tmp_path / "m.gltf")


def huge_accessor(tree):
    tree["accessors"].append({"componentType": 5126, "type": "MAT4", "count": 1 << 40})


def many_nodes(tree):
    tree["nodes"] += [{"mesh": 0}] * 100


def test_a_glb_that_declares_more_than_it_holds_is_refused_before_memory_is_taken(tmp_path):
    assert len(read_shape(glb(tmp_path / "solid.glb", lambda tree: None)).triangle)
    with pytest.raises(EnvlightError, match=r"1,099,511,627,776 elements are declared, more than"):
        read_shape(glb(tmp_path / "huge.glb", huge_accessor))
    copied = {"extensionsRequired": ["KHR_materials_ior", "EXT_mesh_gpu_instancing"]}
    with pytest.raises(EnvlightError, match="it needs EXT_mesh_gpu_instancing, which is not read"):
        read_shape(glb(tmp_path / "copied.glb", lambda tree: tree.update(copied)))


def test_a_mesh_that_memory_does_not_hold_is_refused(tmp_path, monkeypatch):
    path = glb(tmp_path / "many.glb", many_nodes)
    once = 24 * 3 * (len(SHAPE.vertex) + 3 * len(SHAPE.triangle))
    monkeypatch.setattr("renderer.scene.mesh_file.available_memory", lambda: 10 * once)
    assert len(read_shape(write(tmp_path / "solid.glb")).triangle)
    with pytest.raises(EnvlightError, match=r"elements may need .* GB are free; reduce the mesh"):
        read_shape(path)


@pytest.mark.parametrize("form", ["ascii 1.0", "binary_little_endian 1.0"])
def test_a_ply_that_declares_more_than_it_holds_is_refused(tmp_path, form):
    path = ply(tmp_path / "huge.ply", ["0 0 0", "1 0 0", "0 1 0"], ["3 0 1 2"])
    text = path.read_text().replace("vertex 3", "vertex 99999999999").replace("ascii 1.0", form)
    path.write_text(text)
    with pytest.raises(EnvlightError, match=r"99,999,999,999 elements are declared, more than its"):
        read_shape(path)


def test_memory_that_runs_out_is_told(tmp_path, monkeypatch):
    def too_large(*words, **named):
        raise MemoryError

    path = write(tmp_path / "solid.ply")
    monkeypatch.setattr("trimesh.load_scene", too_large)
    with pytest.raises(EnvlightError, match="not enough memory"):
        read_shape(path)


def test_missing_files_and_other_formats_are_refused(tmp_path):
    with pytest.raises(EnvlightError, match=r"none\.ply.*check the path"):
        read_shape(tmp_path / "none.ply")
    with pytest.raises(EnvlightError, match=r"\.fbx.*convert"):
        read_shape(tmp_path / "mesh.fbx")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(EnvlightError, match=r"folder\.ply"):
        read_shape(tmp_path / "folder.ply")


def test_scanned_meshes_are_read():
    files = sorted(data_folder("meshes").glob("*.ply"))
    assert files
    for file in files[:2]:
        shape = read_shape(file)
        mesh = shade(shape)
        length = np.linalg.norm(mesh.normal.astype(np.float64), axis=1)
        assert np.abs(length - 1.0).max() < 2.0**-22, file.name
        assert len(mesh.triangle) == len(shape.triangle)
