"""Meshes from PLY, OBJ, STL, GLB and glTF files: read through trimesh, checked and cleaned.

A file's own normals are left aside; nodes of a glTF file are placed as it says. Nothing but the
file itself is opened, and what a .gltf file names in its own folder or below it.
"""

import io
import json
import re
import warnings
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from renderer.modelling.shape import Shape, merge, weld
from samplers.errors import EnvlightError
from samplers.files.stored_image import available_memory, one_line, refuse_others

GLTF_SUFFIXES = (".glb", ".gltf")
SUFFIXES = (".ply", ".obj", ".stl", *GLTF_SUFFIXES)
OF_LOOKS = "KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_xmp", "EXT_texture_"
"""How extensions of glTF begin that leave triangles what they are."""
INSTANCES, FAN = "EXT_mesh_gpu_instancing", 6
ELEMENT_BYTES = 24
"""Of one vertex or triangle: three numbers of float64 or int64."""


@dataclass(frozen=True, eq=False)
class Part:
    """A surface of a file as a node places it.

    name : of the mesh in the file, with a number from its second node on; no two are equal
    look : the material as trimesh has it, whose name is its number in a glTF file; or None
    """

    name: str
    shape: Shape
    look: Any = None


def read_shape(path: Path, part: str = "") -> Shape:
    """The triangles of a mesh file, welded and without those that have no area.

    part : the name of one of a glTF file's parts; all of them where it is empty

    Raises EnvlightError for a file that is missing, not a mesh, without triangles, or with NaN or
    infinite positions. Warns of triangles that were left out.
    """
    return cleaned(path, {one.name: one.shape for one in read_parts(path)}, part)


def cleaned(path: Path, shapes: dict[str, Shape], part: str = "") -> Shape:
    """The triangles of a file's parts, or of one of them, as `read_shape` gives them."""
    if part and part not in shapes:
        names = ", ".join(f"'{name}'" for name in list(shapes)[:8])
        raise EnvlightError(f"{path}: it has no part '{part}'; give one of {names}")
    chosen = [shapes[part]] if part else shapes.values()
    raw = merge(*chosen) if chosen else Shape(np.empty((0, 3)), np.empty((0, 3), np.int64))
    if len(raw.triangle) == 0:
        raise EnvlightError(f"{path}: it has no triangles; export a surface, not points or lines")
    if raw.triangle.min() < 0 or raw.triangle.max() >= len(raw.vertex):
        raise EnvlightError(f"{path}: a triangle names a vertex that does not exist; export again")
    used = np.unique(raw.triangle)
    bad = used[np.logical_not(np.isfinite(raw.vertex[used]).all(axis=1))]
    if len(bad):
        raise EnvlightError(
            f"{path}: vertex {bad[0]} is NaN or infinite, or beyond the range of float32, as are "
            f"{len(bad) - 1} others; repair the mesh"
        )
    shape = _with_area(weld(_compact(raw)))
    lost = len(raw.triangle) - len(shape.triangle)
    if len(shape.triangle) == 0:
        raise EnvlightError(f"{path}: none of its {lost} triangles has an area; export again")
    if lost:
        warnings.warn(
            f"{path}: {lost} of {len(raw.triangle)} triangles have no area and were left out",
            stacklevel=2,
        )
    return shape


def read_parts(path: Path) -> list[Part]:
    """The surfaces of a file as they stand in it, in their order; EnvlightError as `read_shape`."""
    import trimesh

    kind = path.suffix[1:].lower()
    content = _content(path)
    if kind != "stl" or len(content) != _stl_size(content):
        refuse_others(path, content)
    if kind == "obj":
        content = _plain(path, content)
    _check_claims(path, content, kind)
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    if f".{kind}" in GLTF_SUFFIXES:
        content = _numbered(content)
    if kind == "gltf":
        options["resolver"] = trimesh.resolvers.FilePathResolver(str(path))
    found = []
    try:
        with np.errstate(all="ignore"):
            scene = trimesh.load_scene(
                io.BytesIO(content), file_type=kind, process=False, **options
            )
            graph = scene.graph.transforms
            place = {str(scene.graph.base_frame): np.eye(4)}
            for node in scene.graph.nodes_geometry:
                _place(node, place, graph)
                name = graph.node_data[node]["geometry"]
                geometry = scene.geometry[name].copy()
                geometry.apply_transform(place[node])
                found.append((str(name), geometry))
    except MemoryError:
        raise EnvlightError(f"{path}: there is not enough memory for it; reduce the mesh") from None
    except Exception as error:  # a damaged file makes trimesh raise almost anything
        reason = " ".join(str(error).split()) or type(error).__name__
        if "unexpected length" in reason:
            reason = "cut short, or its faces have several numbers of corners; export triangles"
        raise EnvlightError(f"{path}: not a readable mesh ({reason[:120]})") from None
    parts, last = dict[str, Part](), defaultdict[str, int](lambda: 1)
    for name, geometry in found:
        if not isinstance(geometry, trimesh.Trimesh):
            continue
        if geometry.vertices.shape[1:] != (3,) or geometry.faces.shape[1:] != (3,):
            raise EnvlightError(
                f"{path}: its vertices or triangles are not of three numbers each; export again"
            )
        with np.errstate(over="ignore"):
            vertex = np.asarray(geometry.vertices, float).astype(np.float32).astype(np.float64)
        shape = Shape(vertex, np.asarray(geometry.faces, np.int64))
        own = name
        while own in parts:
            last[name] += 1
            own = f"{name} {last[name]}"
        parts[own] = Part(own, shape, getattr(geometry.visual, "material", None))
    return list(parts.values())


def _place(node: str, place: dict[str, NDArray[np.float64]], graph: Any) -> None:
    """Find the (4, 4) place of a node and of those above it: trimesh would take the fourth power of
    their number for it."""
    chain: list[str] = []
    while node not in place and len(chain) <= len(graph.parents):
        chain.append(node)
        node = graph.parents[node]
    for one in reversed(chain):
        above = graph.parents[one]
        place[one] = place[above] @ graph.edge_data[above, one].get("matrix", np.eye(4))


def _content(path: Path) -> bytes:
    if path.suffix.lower() not in SUFFIXES:
        raise EnvlightError(
            f"{path}: '{path.suffix}' is not read; convert it to {', '.join(SUFFIXES)}"
        )
    try:
        return path.read_bytes()
    except OSError as error:
        raise EnvlightError(f"{path}: {error.strerror or error}; check the path") from None


def gltf_tree(path: Path) -> dict[str, Any]:
    """The JSON of a .glb or .gltf file; EnvlightError where there is none."""
    try:
        tree = _tree(_content(path))
    except (ValueError, RecursionError):
        tree = None
    if not isinstance(tree, dict):
        raise EnvlightError(f"{path}: not a readable mesh (it has no JSON); export again")
    return tree


def files_beside(path: Path) -> dict[str, Path]:
    """The files that a .gltf file reads, by the names it gives them; none of other files."""
    if path.suffix.lower() != ".gltf":
        return {}
    tree = gltf_tree(path)
    try:
        named = [one.get("uri", "") for key in ("buffers", "images") for one in tree.get(key, ())]
    except (AttributeError, TypeError):
        return {}
    uris = [uri for uri in named if isinstance(uri, str) and uri and not uri.startswith("data:")]
    return {uri: path.parent / unquote(uri) for uri in uris}


def _plain(path: Path, content: bytes) -> bytes:
    """An OBJ file with single blanks between words, and nothing before or behind a line's."""
    content = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    content = re.sub(rb"(?m)^ +", b"", content.replace(b"\t", b" "))
    content = re.sub(rb"(?m)^([vf] [^#\n]*)#.*$", rb"\1", content)
    if re.search(rb"(?m)^f .*?(?<= )0+(?:[ /]|$)", content):
        raise EnvlightError(f"{path}: a face names vertex 0, and the first is 1; export again")
    return content


def _stl_size(content: bytes) -> int:
    """Bytes of a binary STL file with as many triangles as stand in its head."""
    return 84 + 50 * int.from_bytes(content[80:84], "little")


def _tree(content: bytes) -> Any:
    if content[:4] == b"glTF":
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    return json.loads(content)


def _numbered(content: bytes) -> bytes:
    """A glTF file whose materials are called by their numbers, and files by their names; as it is
    where it is no such."""
    try:
        tree = _tree(content)
        for number, material in enumerate(tree.get("materials", ())):
            material["name"] = str(number)
        for one in (*tree.get("buffers", ()), *tree.get("images", ())):
            if not one.get("uri", "data:").startswith("data:"):
                one["uri"] = unquote(one["uri"])
    except (AttributeError, TypeError, ValueError, RecursionError):
        return content
    text = json.dumps(tree).encode()
    if content[:4] != b"glTF":
        return text
    text += b" " * (-len(text) % 4)
    rest = content[20 + int.from_bytes(content[12:16], "little") :]
    sizes = [(20 + len(text) + len(rest)), len(text)]
    whole, own = (size.to_bytes(4, "little") for size in sizes)
    return content[:8] + whole + own + content[16:20] + text + rest


def _check_claims(path: Path, content: bytes, kind: str) -> None:
    """Refuse a file that declares more than it can hold, or than memory can, before it is read."""
    size = len(content)
    try:
        if kind == "ply":
            largest, total = _ply_claims(path, content)
        elif f".{kind}" in GLTF_SUFFIXES:
            tree = _tree(content)
            _check_tree(path, tree)
            largest, total = _gltf_claims(tree)
            size += sum(file.stat().st_size for file in files_beside(path).values())
        elif kind == "stl" and b"\0" in content[:84]:
            largest = total = int.from_bytes(content[80:84], "little")
            expected = _stl_size(content)
            if size != expected:
                raise EnvlightError(
                    f"{path}: it is {'cut short' if size < expected else 'damaged'}: "
                    f"{expected:,} bytes were expected and {size:,} found; export again"
                )
        else:
            if kind == "stl" and b"endsolid" not in content.lower().rpartition(b"endfacet")[2]:
                raise EnvlightError(f"{path}: it is cut short before its endsolid; export again")
            return
    except EnvlightError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, RecursionError, OSError):
        return  # no such file; the library says so
    if largest > size:
        raise EnvlightError(
            f"{path}: {largest:,} elements are declared, more than its {size:,} bytes can "
            "hold; export again"
        )
    free = available_memory()
    if free is not None and total * ELEMENT_BYTES > free:
        raise EnvlightError(
            f"{path}: its {total:,} elements may need {total * ELEMENT_BYTES / 1e9:.1f} GB of "
            f"memory and {free / 1e9:.1f} GB are free; reduce the mesh"
        )


def _check_tree(path: Path, tree: dict[str, Any]) -> None:
    """Refuse a glTF file whose triangles are packed, copied or kept in a way that is not read, and
    warn of what moves them."""
    nodes, meshes, files = tree.get("nodes", ()), tree.get("meshes", ()), files_beside(path)
    copied = [INSTANCES for node in nodes if INSTANCES in node.get("extensions", ())]
    for name in (*tree.get("extensionsRequired", ()), *copied):
        if not name.startswith(OF_LOOKS):
            raise EnvlightError(f"{path}: it needs {name}, which is not read; export without it")
    for uri in (one["uri"] for one in tree.get("buffers", ()) if one.get("uri") in files):
        file = files[uri]
        if not (file.is_file() and file.resolve().is_relative_to(path.parent.resolve())):
            raise EnvlightError(
                f"{path}: it needs '{one_line(uri)}', no file in its folder; put it there"
            )
    for primitive in (one for mesh in meshes for one in mesh["primitives"]):
        if primitive.get("mode") == FAN:
            raise EnvlightError(
                f"{path}: it has triangle fans, which are not read; export triangles"
            )
        for number in {primitive["attributes"]["POSITION"], primitive.get("indices")} - {None}:
            one = tree["accessors"][number]
            if "sparse" in one or one.get("normalized") or "bufferView" not in one:
                raise EnvlightError(
                    f"{path}: its accessor {number} is sparse, normalized or without data, "
                    "which is not read; export plain triangles"
                )
    moved = any(any(one.get("weights", ())) for one in (*meshes, *nodes))
    aside = ["skins"] * bool(tree.get("skins")) + ["morph targets"] * moved
    if aside:
        said = f"{path}: left aside: {', '.join(aside)}; the mesh stands as it is stored"
        warnings.warn(said, stacklevel=2)


def _ply_claims(path: Path, content: bytes) -> tuple[int, int]:
    """The largest number of elements that a PLY's header declares, and their sum; EnvlightError for
    text that has fewer lines, or a last face with fewer numbers, than that."""
    header, _, body = content.partition(b"end_header")
    counts = [int(count) for count in re.findall(rb"^element\s+\S+\s+(\d+)", header, re.MULTILINE)]
    if re.search(rb"^format\s+ascii", header, re.MULTILINE) and sum(counts) <= len(content):
        lines, _, last = body.rstrip().rpartition(b"\n")
        faces = re.search(rb"element\s+\S+\s+[1-9]\d*\s+property\s+list[^\n]*\s*\Z", header)
        cut = lines.count(b"\n") + 1 < sum(counts)
        if cut or (faces and len(last.split()) <= int(last.split()[0])):
            raise EnvlightError(f"{path}: it is cut short, as its last lines show; export again")
    return max(counts), sum(counts)


def _gltf_claims(tree: dict[str, Any]) -> tuple[int, int]:
    """The largest number of elements of glTF's accessors, and the sum over all that are used.

    A mesh counts for every node that places it, and a primitive for every mesh.
    """
    counts = [int(accessor["count"]) for accessor in tree["accessors"]]
    meshes = [
        sum(
            counts[accessor]
            for primitive in mesh["primitives"]
            for accessor in (*primitive["attributes"].values(), primitive.get("indices"))
            if accessor is not None
        )
        for mesh in tree["meshes"]
    ]
    placed = sum(meshes[node["mesh"]] for node in tree.get("nodes", ()) if "mesh" in node)
    return max(counts), sum(counts) + sum(meshes) + placed


def _compact(shape: Shape) -> Shape:
    """Only the vertices that triangles use."""
    used, index = np.unique(shape.triangle, return_inverse=True)
    return Shape(shape.vertex[used], index.reshape(-1, 3))


def _with_area(shape: Shape) -> Shape:
    """Only the triangles whose normal can be told from rounding errors."""
    corner = shape.vertex[shape.triangle]
    ahead, behind = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    sides = np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1)
    flat = np.linalg.norm(np.cross(ahead, behind), axis=1) <= 1e-9 * sides
    return _compact(Shape(shape.vertex, shape.triangle[~flat]))
