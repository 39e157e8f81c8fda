"""Scenes of pbrt-v3 and pbrt-v4 (pbrt.org), for `written_scene.py`.

Read are transforms, attributes, `Include`, `Film`, `Camera`, `Material` and `Shape`. pbrt's frame
is left-handed: unless its camera is mirrored, the scene is, by its x.
"""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from renderer.modelling.shape import Matrix, affine, look_at, rotation

TOKEN = re.compile(r'#[^\n]*|"([^"\n]*)"|([\[\]])|([^\s\[\]"#]+)|(\S)')
SETTINGS = re.compile(
    r"Accelerator|ColorSpace|\w*Integrator|Option|PixelFilter|Sampler|ReverseOrientation"
)
MOST_FILES = 10_000
"""Of which each counts as often as it is included: a few may name one another without end."""
SHAPES = {"plymesh": "ply", "trianglemesh": "triangles"}
MATERIALS: dict[str, tuple[str, dict[str, Any]]] = {
    # of version 4, then of version 3: Mitsuba's name, and what is so where the file is silent
    "diffuse": ("diffuse", {}),
    "conductor": ("roughconductor", {"roughness": 0.0}),
    "coateddiffuse": ("roughplastic", {"roughness": 0.0, "eta": 1.5, "ext_ior": 1.0}),
    "matte": ("diffuse", {}),
    "metal": ("roughconductor", {"roughness": 0.01}),
    "plastic": (
        "roughplastic",
        {"roughness": 0.1, "eta": 1.5, "ext_ior": 1.0, "Kd": [0.25] * 3, "Ks": [0.25] * 3},
    ),
}
NAMES = {
    ("diffuse", "Kd"): "reflectance", ("roughplastic", "Kd"): "diffuse_reflectance",
    ("roughplastic", "reflectance"): "diffuse_reflectance", ("roughplastic", "eta"): "int_ior",
    ("roughplastic", "Ks"): "specular_reflectance",
    ("roughconductor", "reflectance"): "specular_reflectance",
}  # fmt: skip
SMOOTHED = (1.62142, 0.819955, 0.1734, 0.0171201, 0.000640711)
"""Version 3's polynomial in ln(roughness) that gives α (its TrowbridgeReitzDistribution)."""
MIRROR = affine(np.diag([-1.0, 1.0, 1.0]))


def content(path: Path) -> dict[str, Any]:
    """What a file says, in Mitsuba's words; LookupError, TypeError or ValueError of other files."""
    found: dict[str, Any] = {"shapes": [], "lights": [], "includes": []}
    film: dict[str, Any] = {}
    world, at, material, up = np.eye(4), np.eye(4), None, None
    kept: list[tuple[Matrix, Any]] = []
    materials: dict[str, dict[str, Any]] = {}
    for name, given in directives(path, path.parent, found["includes"]):
        moved = _moved(at, name, given)
        if moved is not None:
            up = given[6:] if name == "LookAt" else up
            at = moved
            continue
        match name:
            case "AttributeBegin" | "TransformBegin":
                kept.append((at, material))
            case "AttributeEnd":
                at, material = kept.pop()
            case "TransformEnd":
                at, _ = kept.pop()
            case "Film":
                film = _parameters(given)
            case "Camera":
                world = MIRROR if np.linalg.det(at[:3, :3]) > 0.0 else world
                found["sensor"] = {
                    "fov": 90.0, **_parameters(given), "fov_axis": "smaller",
                    "film": {"width": film.get("xresolution", 1280.0),
                             "height": film.get("yresolution", 720.0)},
                    "to_world": world @ np.linalg.inv(at) @ MIRROR,
                    "up": world[:3, :3] @ (up or (0.0, 1.0, 0.0)),
                }  # fmt: skip
            case "Material":
                material = _material(_parameters(given))
            case "MakeNamedMaterial":
                materials[given[0]] = _material(_parameters(given))
            case "NamedMaterial":
                material = materials[given[0]]
            case "LightSource" | "AreaLightSource":
                named = [v for k, v in zip(given[1::2], given[2::2], strict=True) if "name" in k]
                files = np.ravel(named).tolist()  # which alone is told of it
                found["lights"].append({"type": given[0], "filename": " ".join(files)})
            case "Shape":
                values = _parameters(given)
                if values["type"] == "trianglemesh":
                    values["face_normals"] = "N" not in values
                values["type"] = SHAPES.get(values["type"], values["type"])
                values |= {"to_world": world @ at} | ({"bsdf": material} if material else {})
                found["shapes"].append(values)
            case _ if not SETTINGS.fullmatch(name):
                raise ValueError(f"{name} is not read; take it out")
    return found


def directives(path: Path, folder: Path, files: list[str]) -> Iterator[tuple[str, list[Any]]]:
    """Each directive with what stands after it: texts, numbers, truth values, and lists of them.

    files : is given the names of files that are included, which must be in the folder
    """
    name, found = "", list[Any]()
    inner: list[Any] | None = None
    for token in (*TOKEN.finditer(path.read_text("utf-8")), None):
        kind = token.lastindex if token else 3
        value: Any = token[kind or 0] if token else "end"
        if kind == 2:
            if value == "]" and inner is not None:
                found.append(inner)
            inner = [] if value == "[" else None
        elif kind == 4:
            raise ValueError(f"an unclosed {value}")
        elif kind == 3 and value[0].isalpha() and value not in ("true", "false"):
            if name in ("Include", "Import"):
                if not (folder / found[0]).resolve().is_relative_to(folder.resolve()):
                    raise ValueError(f"{name} {found[0]}: it is outside the scene's folder")
                files.append(found[0])
                if len(files) > MOST_FILES:
                    raise ValueError(f"{name}: more than {MOST_FILES:,} files")
                yield from directives(folder / found[0], folder, files)
            elif name:
                flat = len(found) == 1 and isinstance(found[0], list)
                yield name, found[0] if flat else found
            name, found = value, []
        elif kind is not None:
            if kind == 3:
                value = value == "true" if value[0] in "tf" else float(value)
            (found if inner is None else inner).append(value)


def _moved(at: Matrix, name: str, given: list[Any]) -> Matrix | None:
    """The current transform after a directive; None where it is none of transforms."""
    match name:
        case "WorldBegin" | "Identity":
            return np.eye(4)
        case "Translate":
            return at @ affine(offset=given)
        case "Scale":
            return at @ affine(np.diag(given))
        case "Rotate":
            return at @ affine(rotation(given[0], given[1:]))
        case "LookAt":
            return at @ np.linalg.inv(look_at(given[:3], given[3:6], given[6:]))
        case "Transform":
            return np.reshape(given, (4, 4)).T
        case "ConcatTransform":
            return at @ np.reshape(given, (4, 4)).T
    return None


def _parameters(given: list[Any]) -> dict[str, Any]:
    """A type with its parameters, each of which is its kind and name, then its value."""
    result: dict[str, Any] = {"type": given[0]}
    for key, value in zip(given[1::2], given[2::2], strict=True):
        kind, name = key.split()
        values = value if isinstance(value, list) else [value]
        metal = re.fullmatch(r"metal-(\w+)-(?:eta|k)", str(values[0]))
        if kind == "spectrum" and metal:
            result["material"] = metal[1]
        elif kind in ("texture", "spectrum", "blackbody"):
            raise ValueError(f"the {kind} of {name} is not read; give rgb")
        else:
            result[name] = values[0] if len(values) == 1 else values
    return result


def _material(values: dict[str, Any]) -> dict[str, Any]:
    """A material in Mitsuba's words; α is a roughness remapped, unless the file says not to."""
    own = values["type"]
    kind, unsaid = MATERIALS.get(own, (own, {}))
    values = unsaid | values | {"type": kind}
    if own == "conductor" and "reflectance" in values:
        values["material"] = "none"
    if "roughness" in values:
        alpha = float(values.pop("roughness"))
        if values.pop("remaproughness", True) not in (False, "false"):
            log = math.log(max(alpha, 1e-3))
            third = min(sum(factor * log**power for power, factor in enumerate(SMOOTHED)), 1.0)
            alpha = third if own in ("metal", "plastic") else math.sqrt(max(alpha, 0.0))
        values["alpha"] = alpha
    return {NAMES.get((kind, name), name): value for name, value in values.items()}
