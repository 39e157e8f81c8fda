"""Scenes of other programs, as the text of a scene file (`scene_file.py`): a mesh, or a glTF scene.

A file without a camera is scaled to a longest side of 2, set on a ground in the middle and looked
at from the front; one with a camera is taken as it is. Lights are left aside: scenes are lit by
maps.

Materials of glTF become the nearest of ours: from a metallic factor of one half on a Conductor,
else a Coated; a Lambert where KHR_materials_specular takes the lobe away or it is unlit. GGX α is
the square of glTF's roughness. Textures become their mean, of colours in linear light. What is
transparent or shines by itself and other extensions are left aside with a warning. What has no
material is a grey Lambert.
"""

import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.modelling.shape import affine
from renderer.scene.mesh_file import GLTF_SUFFIXES, SUFFIXES, Part, cleaned, gltf_tree, read_parts
from samplers.errors import EnvlightError

SIDE, GROUND, FIELD_OF_VIEW = 2.0, 10.0, 35.0
FROM = np.array([0.3, 0.4, 1.0])
"""Where an own camera stands, seen from what it looks at."""
MARGIN = 1.05
GREY: dict[str, Any] = {"type": "lambert", "albedo": [0.6, 0.6, 0.6]}
GROUND_GREY: dict[str, Any] = {"type": "lambert", "albedo": [0.5, 0.5, 0.5]}
KNOWN = {"KHR_materials_ior", "KHR_materials_specular", "KHR_materials_unlit"}
OTHERS = {".blend": "Blender", ".usd": "USD"}
"""Of programs that can save their scenes as glTF."""
ASIDE = ("emissiveFactor", "emissiveTexture", "normalTexture", "alphaMode")


def description(path: Path) -> str:
    """The text of a scene file beside a mesh or glTF file, which shows it.

    Raises EnvlightError for what is no such file, or has nothing to show.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        program = f"scenes of {OTHERS[suffix]} are" if suffix in OTHERS else f"'{suffix}' is"
        raise EnvlightError(
            f"scene '{path}': {program} not read; give a scene's .toml file, or one of "
            f"{', '.join(SUFFIXES)}, .xml, .pbrt"
        )
    parts = read_parts(path)
    if not parts:
        raise EnvlightError(f"{path}: it has no triangles; export a surface, not points or lines")
    tree = gltf_tree(path) if path.suffix.lower() in GLTF_SUFFIXES else {}
    camera, several = _camera(path, tree), len(parts) > 1
    objects: list[dict[str, Any]] = [{"mesh": path.name, "material": ""} for _ in parts]
    content: dict[str, Any] = {"name": path.stem, "camera": camera}
    for one, part in zip(objects, parts, strict=True):
        if several:
            one["part"] = part.name
        if several and camera is None and part.name == "ground":
            one["name"] = "ground of the file"
    if camera is None:
        low, high = _bounds(path, parts)
        scale = SIDE / float((high - low).max())
        place = -scale * np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
        for one in objects:
            if several:
                one |= {"scale": scale, "position": place.tolist()}
            else:
                one |= {"up": "y", "size": SIDE, "turn": 0.0, "rest": True}
        content["camera"] = _own_camera(scale * (high - low))
        content["ground"] = {"radius": GROUND, "material": "ground"}
    materials = [_look(path, part, tree) for part in parts]
    named: dict[str, dict[str, Any]] = {}
    for one, material in zip(objects, materials, strict=True):
        same = (name for name, known in named.items() if known == material)
        one["material"] = next(same, f"material-{len(named) + 1}")
        named[one["material"]] = material
    if camera is None:
        named["ground"] = GROUND_GREY
    return _toml(content | {"materials": named, "objects": objects})


def _bounds(path: Path, parts: list[Part]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    vertex = cleaned(path, {one.name: one.shape for one in parts}).vertex
    return vertex.min(axis=0), vertex.max(axis=0)


def _own_camera(size: NDArray[np.float64]) -> dict[str, Any]:
    """A camera that sees all of a box of this size that stands in the middle of the ground."""
    target = np.array([0.0, 0.5 * size[1], 0.0])
    distance = MARGIN * 0.5 * np.linalg.norm(size) / math.sin(math.radians(0.5 * FIELD_OF_VIEW))
    eye = target + distance * FROM / np.linalg.norm(FROM)
    return {"eye": eye.tolist(), "target": target.tolist(), "field_of_view": FIELD_OF_VIEW}


def _camera(path: Path, tree: dict[str, Any]) -> dict[str, Any] | None:
    """The first perspective camera of a glTF file's scene; None where there is none."""
    try:
        nodes, found = tree.get("nodes", []), None
        waiting = [(n, np.eye(4)) for n in tree["scenes"][tree.get("scene", 0)]["nodes"]]
        for (number, above), _ in zip(waiting, nodes, strict=False):  # one parent at most
            node = nodes[number]
            matrix = above @ _matrix(node)
            waiting += [(n, matrix) for n in node.get("children", ())]
            view = tree["cameras"][node["camera"]] if "camera" in node else {}
            if view.get("type") == "perspective":
                found = matrix, float(view["perspective"]["yfov"])
                break
    except (LookupError, TypeError, ValueError, AttributeError):
        return None  # a tree without a scene or of another form
    if found is None:
        return None
    (matrix, angle), unit = found, np.linalg.norm(found[0][:3, :3], axis=0)
    if not (np.isfinite(matrix).all() and unit.all()):
        raise EnvlightError(f"{path}: its camera stands nowhere; export again")
    eye, axes = matrix[:3, 3], matrix[:3, :3] / unit
    return {
        "eye": eye.tolist(),
        "target": (eye - axes[:, 2]).tolist(),
        "up": axes[:, 1].tolist(),
        "field_of_view": math.degrees(angle),
    }


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """A node's place in its parent's frame, (4, 4)."""
    from scipy.spatial.transform import Rotation

    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    turn = Rotation.from_quat(node.get("rotation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    scale = np.array(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    return affine(turn * scale, node.get("translation", (0.0, 0.0, 0.0)))


def _look(path: Path, part: Part, tree: dict[str, Any]) -> dict[str, Any]:
    """The material of a part, as a scene file has it."""
    name = getattr(part.look, "name", None)
    known = tree.get("materials", [])
    if not (isinstance(name, str) and name.isdigit() and int(name) < len(known)):
        return GREY
    material = known[int(name)]
    try:
        return _nearest(path, material, part.look)
    except (AttributeError, LookupError, TypeError, ValueError):
        raise EnvlightError(
            f"{path}: its material {name} is none of glTF's; export again"
        ) from None


def _nearest(path: Path, material: dict[str, Any], look: Any) -> dict[str, Any]:
    surface = material.get("pbrMetallicRoughness", {})
    extensions = material.get("extensions", {})
    aside = [key for key in ASIDE if material.get(key) not in (None, "OPAQUE", [0, 0, 0])]
    aside += sorted(set(extensions) - KNOWN)
    if aside:
        label = material.get("name", "without a name")
        warnings.warn(
            f"{path}: of its material {label} this is left aside: {', '.join(aside)}", stacklevel=2
        )
    factor = surface.get("baseColorFactor", [1.0] * 4)[:3]
    color = [_share(c) for c in _mean(look.baseColorTexture, linear=True) * factor]
    others = _mean(look.metallicRoughnessTexture, linear=False)
    roughness = _share(surface.get("roughnessFactor", 1.0) * others[1])
    metallic = _share(surface.get("metallicFactor", 1.0) * others[2])
    if "KHR_materials_unlit" in extensions:
        return {"type": "lambert", "albedo": color}
    if metallic >= 0.5:
        return {"type": "conductor", "reflectance": color, "roughness": roughness**2}
    if extensions.get("KHR_materials_specular", {}).get("specularFactor", 1.0) == 0.0:
        return {"type": "lambert", "albedo": color}
    ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
    coat = {"type": "coated", "albedo": color, "roughness": roughness**2}
    return coat | {"ior": min(max(ior, 1.0), 10.0)}


def _share(value: Any) -> float:
    return min(max(float(value), 0.0), 1.0)


def _mean(texture: Any, linear: bool) -> NDArray[np.float64]:
    """The mean (3,) of a picture in [0, 1]; 1 where there is none. linear : of sRGB's light"""
    if texture is None:
        return np.ones(3)
    try:
        counts = np.array(texture.convert("RGB").histogram(), np.float64).reshape(3, 256)
    except Exception:  # a damaged picture makes the library raise almost anything
        return np.ones(3)
    level = np.arange(256) / 255.0
    if linear:
        level = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    return np.asarray(counts @ level / counts.sum(axis=1))


def _toml(content: dict[str, Any]) -> str:
    """A scene's tables as TOML."""
    lines = [f"name = {_value(content['name'])}"]
    tables = [("[camera]", content["camera"])]
    if "ground" in content:
        tables.append(("[ground]", content["ground"]))
    tables += [(f"[materials.{name}]", table) for name, table in content["materials"].items()]
    tables += [("[[objects]]", table) for table in content["objects"]]
    for head, table in tables:
        lines += ["", head, *(f"{key} = {_value(value)}" for key, value in table.items())]
    return "\n".join([*lines, ""])


def _value(value: Any) -> str:
    """Numbers, truth values, lists and texts look in TOML as in JSON, but for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
