"""Scenes of Mitsuba and pbrt as ours. `mitsuba_xml.py` and `pbrt_text.py` read them.

Taken are triangle meshes, spheres, rectangles, cubes and discs, a perspective camera, and materials
as the nearest of ours: diffuse ones as Lambert, plastic and coated diffuse ones as Coated, metals
as Conductor; GGX stands for any microfacets. Both sides of a surface reflect. Normals are made
anew, smooth but for edges sharper than 40°. Lights are left aside with a warning, as maps light
scenes; settings of rendering are not read; all else is refused by its name.

Where the camera's up is an axis other than +Y, the scene is turned until it is +Y, as in maps.
"""

import math
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from renderer.modelling import Shape, box, shade, sphere, square
from renderer.modelling.shape import Matrix, affine, rotation
from renderer.scene import Camera, Object, Scene, mitsuba_xml, pbrt_text
from renderer.scene.materials import Coated, Color, Conductor, Lambert, Material
from renderer.scene.mesh_file import cleaned, read_shape
from renderer.scene.scene_file import inside
from renderer.scene.toml_table import Table
from samplers.errors import EnvlightError

FORMATS = {".xml": ("Mitsuba", mitsuba_xml.content), ".pbrt": ("pbrt", pbrt_text.content)}
"""By suffix: the program, and what reads a file as Mitsuba's dictionaries of plugins."""
SHAPES = ("obj", "ply", "triangles", "sphere", "rectangle", "cube", "disk")
BSDFS = ("twosided", "diffuse", "conductor", "roughconductor", "plastic", "roughplastic")
FOV_AXES = ("x", "y", "smaller", "larger")
METALS: dict[str, Color] = {
    "Ag": (0.972, 0.960, 0.915), "Al": (0.913, 0.922, 0.924), "Au": (1.0, 0.782, 0.344),
    "Cu": (0.955, 0.638, 0.538), "none": (1.0, 1.0, 1.0),
}  # fmt: skip
"""Reflectance at normal incidence of metals that the files name, linear Rec. 709 (Hoffman,
"Background: physics and math of shading", SIGGRAPH course 2013; gold's red is clipped)."""
IGNORED = (
    "id", "near_clip", "far_clip", "focus_distance", "shutter_open", "shutter_close", "sampler",
    "film", "emitter", "flip_normals", "flip_tex_coords", "distribution", "sample_visible",
    "nonlinear", "N", "S", "st", "uv", "sigma", "thickness", "focaldistance", "shutteropen",
    "shutterclose", "displayfilename",
)  # fmt: skip
"""What is read elsewhere, or changes no surface."""


def read_written(path: Path) -> tuple[Scene, dict[str, Path]]:
    """The scene of a Mitsuba or pbrt file, and the files that it names, by those names.

    Raises EnvlightError that names the file, and what in it is not read.
    """
    program, content = FORMATS[path.suffix.lower()]
    try:
        found = content(path)
    except OSError as error:
        raise EnvlightError(f"{path}: {error.strerror or error}; check the path") from None
    except (LookupError, RecursionError, SyntaxError, TypeError, ValueError) as error:
        reason = str(error) or type(error).__name__
        raise EnvlightError(f"{path}: not a readable scene of {program}: {reason}") from None
    files = {name: path.parent / name for name in found.get("includes", ())}
    if "sensor" not in found:
        raise EnvlightError(f"{path}: it has no camera; add a perspective one")
    world, camera = _camera(path, found["sensor"])
    lights = found["lights"] + [one["emitter"] for one in found["shapes"] if "emitter" in one]
    aside = dict.fromkeys(
        " of ".join(x for x in (one["type"], one.get("filename")) if x) for one in lights
    )
    if aside:
        said = f"{path}: lights are left aside, as maps light scenes: {', '.join(aside)}"
        warnings.warn(said, stacklevel=2)
    objects, seen = [], Counter[str]()
    for one in found["shapes"]:
        table = _table(path, "shape", one)
        kind = table.choice("type", SHAPES)
        shape = _shape(path, kind, table)
        if kind in ("obj", "ply"):
            files[one["filename"]] = path.parent / one["filename"]
        shape = shape.placed(world @ table.get("to_world", np.eye(4)))
        mesh = shade(shape, 0.0 if table.flag("face_normals", False) else 40.0)
        material = _material(path, table.get("bsdf", {"type": "diffuse"}))
        table.finish()
        name = one.get("id") or kind
        seen[name] += 1
        own = name if seen[name] == 1 else f"{name} {seen[name]}"
        objects.append(Object(own, mesh, material))
    return Scene(path.stem, tuple(objects), camera), files


def _table(path: Path, kind: str, values: dict[str, Any]) -> Table:
    label = " ".join(filter(None, (kind, values.get("type"), values.get("id"))))
    kept = {name: value for name, value in values.items() if name not in IGNORED}
    return Table(kept, f"{path}: {label}")


def _camera(path: Path, values: dict[str, Any]) -> tuple[Matrix, Camera]:
    """From the file's frame to ours, and the camera, which looks along its +Z with +Y up."""
    table, film = _table(path, "sensor", values), values.get("film", {})
    table.choice("type", ("perspective",))
    wide, high = film.get("width", 768.0), film.get("height", 576.0)
    side = {"x": wide, "y": high, "smaller": min(wide, high), "larger": max(wide, high)}
    axis, angle = table.choice("fov_axis", FOV_AXES, "x"), table.number("fov", least=0.0)
    half = math.tan(math.radians(0.5 * angle)) * high / side[axis]
    to_world, up = table.get("to_world", np.eye(4)), np.array(table.get("up", (0.0, 1.0, 0.0)))
    table.finish()
    if np.linalg.det(to_world[:3, :3]) <= 0.0:
        raise table.error("to_world", "it mirrors the picture; leave the mirror out")
    world = np.eye(4)
    above = int(np.abs(up).argmax())
    if above != 1 and abs(up[above]) > 0.999 * np.linalg.norm(up):
        turn = np.cross(up, (0.0, 1.0, 0.0))
        world = affine(rotation(90.0, turn))
        warnings.warn(f"{path}: the camera's up, its {'xyz'[above]} axis, becomes +Y", stacklevel=3)
    matrix = world @ to_world
    eye, ahead, upward = (matrix[:3, column] for column in (3, 2, 1))
    degrees = 2.0 * math.degrees(math.atan(half))
    with table.blamed():
        return world, Camera(tuple(eye), tuple(eye + ahead), degrees, tuple(upward))


def _shape(path: Path, kind: str, table: Table) -> Shape:
    match kind:
        case "sphere":
            return sphere(table.number("radius", 1.0, 0.0)).moved(
                *table.vector("center", (0.0, 0.0, 0.0))
            )
        case "rectangle":
            return square(2.0).turned("x", 90.0)
        case "cube":
            return box((2.0, 2.0, 2.0))
        case "disk":
            height, rim = table.number("height", 0.0), np.arange(256)
            vertex = np.outer(np.sin(rim * (np.pi / 128)), (0.0, 1.0, 0.0))
            vertex[:, 0] = np.cos(rim * (np.pi / 128))
            fan = np.stack([np.full(254, 0), rim[1:-1], rim[2:]], axis=1)
            return Shape(vertex * table.number("radius", 1.0, 0.0), fan).moved(z=height)
        case "triangles":
            points = np.reshape(table.get("P", ()), (-1, 3)).astype(np.float64)
            corners = np.reshape(table.get("indices", (0, 1, 2)), (-1, 3)).astype(np.int64)
            return cleaned(path, {kind: Shape(points, corners)})
    return read_shape(inside(table, path.parent, "filename"))


def _material(path: Path, values: dict[str, Any]) -> Material:
    table = _table(path, "material", values)
    kind = table.choice("type", BSDFS)
    if kind == "twosided":
        inner = table.get("bsdf", {"type": "diffuse"})
        table.finish()
        return _material(path, inner)
    alpha = table.number("alpha", 0.1) if kind.startswith("rough") else 0.0
    made: Material
    with table.blamed():
        if kind == "diffuse":
            made = Lambert(_color(table, "reflectance", 0.5))
        elif kind.endswith("conductor"):
            made = Conductor(_metal(table), alpha)
        else:
            ior = table.number("int_ior", 1.49) / table.number("ext_ior", 1.000277)
            # A coat that reflects less has a lower index: Fresnel's formula at normal incidence.
            share = np.mean(_color(table, "specular_reflectance", 1.0))
            root = math.sqrt(share) * (ior - 1.0) / (ior + 1.0)
            albedo = _color(table, "diffuse_reflectance", 0.5)
            made = Coated(albedo, alpha, (1.0 + root) / (1.0 - root))
    table.finish()
    return made


def _color(table: Table, key: str, default: float) -> Color:
    value = table.get(key, (default,) * 3)
    if isinstance(value, dict):
        raise table.error(key, f"a {value['type']} texture is not read; give rgb")
    return table.vector(key, (default, default, default))


def _metal(table: Table) -> Color:
    """A metal's reflectance at normal incidence, by its name or by Fresnel's formula."""
    scale = np.array(_color(table, "specular_reflectance", 1.0))
    if table.has("eta"):
        eta, k = np.array(_color(table, "eta", 1.0)), np.array(_color(table, "k", 0.0))
        scale *= ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
    else:
        scale *= METALS[table.choice("material", METALS, "Cu")]
    red, green, blue = scale.tolist()
    return red, green, blue
