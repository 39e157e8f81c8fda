"""Meshes from PLY, OBJ and GLB files: read through trimesh, checked and cleaned.

A file's own normals, colours, materials and textures are left aside; a GLB's nodes are placed as
the file says. Nothing but the file itself is opened, whatever it refers to.
"""

import io
import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from renderer.modelling.shape import Shape, weld
from samplers.errors import EnvlightError
from samplers.files.stored_image import available_memory

SUFFIXES = (".ply", ".obj", ".glb")
ELEMENT_BYTES = 24
"""Of one vertex or triangle: three numbers of float64 or int64."""


def read_shape(path: Path) -> Shape:
    """The triangles of a mesh file, welded and without those that have no area.

    Raises EnvlightError for a file that is missing, not a mesh, without triangles, or with NaN or
    infinite positions. Warns of triangles that were left out.
    """
    raw = _load(path)
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


def _load(path: Path) -> Shape:
    import trimesh

    if path.suffix.lower() not in SUFFIXES:
        raise EnvlightError(
            f"{path}: '{path.suffix}' is not read; convert it to {', '.join(SUFFIXES)}"
        )
    try:
        content = path.read_bytes()
    except OSError as error:
        raise EnvlightError(f"{path}: {error.strerror or error}; check the path") from None
    kind = path.suffix[1:].lower()
    _check_claims(path, content, kind)
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    try:
        with np.errstate(all="ignore"):
            scene = trimesh.load_scene(
                io.BytesIO(content), file_type=kind, process=False, **options
            )
            parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    except MemoryError:
        raise EnvlightError(f"{path}: there is not enough memory for it; reduce the mesh") from None
    except Exception as error:  # a damaged file makes trimesh raise almost anything
        reason = " ".join(str(error).split()) or type(error).__name__
        raise EnvlightError(f"{path}: not a readable mesh ({reason[:120]})") from None
    if any(np.shape(array)[1:] != (3,) for part in parts for array in (part.vertices, part.faces)):
        raise EnvlightError(
            f"{path}: its vertices or triangles are not of three numbers each; export again"
        )
    shapes = [Shape(np.asarray(p.vertices, float), np.asarray(p.faces, np.int64)) for p in parts]
    start = np.cumsum([0] + [len(shape.vertex) for shape in shapes])
    vertex = [np.empty((0, 3)), *(shape.vertex for shape in shapes)]
    triangle = [shape.triangle + first for shape, first in zip(shapes, start, strict=False)]
    with np.errstate(over="ignore"):
        seen = np.concatenate(vertex).astype(np.float32).astype(np.float64)
    return Shape(seen, np.concatenate([np.empty((0, 3), np.int64), *triangle]))


def _check_claims(path: Path, content: bytes, kind: str) -> None:
    """Refuse a file that declares more than it can hold, or than memory can, before it is read."""
    try:
        largest, total = {"ply": _ply_claims, "glb": _glb_claims}.get(kind, _none)(content)
    except (LookupError, TypeError, ValueError, RecursionError):
        return  # no such file; the library says so
    if largest > len(content):
        raise EnvlightError(
            f"{path}: {largest:,} elements are declared, more than its {len(content):,} bytes can "
            "hold; export again"
        )
    free = available_memory()
    if free is not None and total * ELEMENT_BYTES > free:
        raise EnvlightError(
            f"{path}: its {total:,} elements may need {total * ELEMENT_BYTES / 1e9:.1f} GB of "
            f"memory and {free / 1e9:.1f} GB are free; reduce the mesh"
        )


def _none(content: bytes) -> tuple[int, int]:
    return 0, 0


def _ply_claims(content: bytes) -> tuple[int, int]:
    """The largest number of elements that a PLY's header declares, and their sum."""
    header = content[: content.index(b"end_header")]
    counts = [int(count) for count in re.findall(rb"^element\s+\S+\s+(\d+)", header, re.MULTILINE)]
    return max(counts), sum(counts)


def _glb_claims(content: bytes) -> tuple[int, int]:
    """The largest number of elements of a GLB's accessors, and the sum over all that are used.

    A mesh counts for every node that places it, and a primitive for every mesh.
    """
    tree = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
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
