"""Lights as glTF 2.0, by the extension KHR_lights_punctual, alone or in a scene with its camera.

Axes are this project's: right-handed, +Y up. A directional light shines along the −Z of its node,
so the node's +Z points towards the light. Intensity is in lux and the colour is linear Rec. 709:
intensity × colour is the irradiance of a facing plane where the map's radiance is taken as
luminance in cd/m² per channel. A white diffuse plane that faces a light of intensity E then has
luminance E / π. Lights of glTF have no size; it stands in the node's extras.

A scene's materials become metallic-roughness ones: glTF's α is the square of its roughness. Lambert
has no specular lobe by KHR_materials_specular, Coated its index by KHR_materials_ior, Conductor is
metallic; Ward, which glTF does not have, becomes what most of its reflection is, at the mean α.
"""

import math
from typing import Any

import numpy as np

from experiments.export.light_set import (
    Layer,
    LightSet,
    frame_towards,
    quaternion,
    strength_and_color,
)
from renderer.primary import camera_axes
from renderer.scene import Camera, Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.sphere import cap_solid_angle

GENERATOR = "envlight, with trimesh"
LIGHTS = "KHR_lights_punctual"
ASPECT = 4.0 / 3.0
"""Of the camera's picture, which viewers choose anew."""
USE = (
    "A light shines along the -Z of its node. intensity (lux) * color is the irradiance of a "
    "facing plane, the map's radiance being taken as luminance in cd/m2; times 683 where it is in "
    "W/(m2 sr). Axes: right-handed, +Y up, where the map's first row is; its middle column is +Z, "
    "and u = 1/4 is +X. extras of a light's node: angular_radius in radians and solid_angle in sr, "
    "which lights of glTF do not have; share_of_energy of the map's luminous flux."
)


def as_gltf(lights: LightSet | None, scene: Scene | None = None, binary: bool = True) -> bytes:
    """The content of a .glb file, or of a .gltf file that needs no other.

    scene : objects and a camera to be lit
    """
    import trimesh

    whole = trimesh.Scene()
    for item in scene.objects if scene else ():
        mesh = trimesh.Trimesh(
            item.mesh.vertex, item.mesh.triangle, vertex_normals=item.mesh.normal, process=False
        )
        whole.add_geometry(mesh, node_name=item.name, geom_name=item.name)

    def complete(tree: dict[str, Any]) -> None:
        _complete(tree, lights, scene)

    export = trimesh.exchange.gltf
    if binary:
        content = export.export_glb(whole, include_normals=True, tree_postprocessor=complete)
        return bytes(content) if scene else _without_empty_chunk(content)
    files = export.export_gltf(
        whole, include_normals=True, embed_buffers=True, tree_postprocessor=complete
    )
    return bytes(files["model.gltf"])


def _without_empty_chunk(content: bytes) -> bytes:
    """A .glb file of JSON alone: the specification asks to leave out an empty binary chunk."""
    end = 20 + int.from_bytes(content[12:16], "little")
    return content[:8] + end.to_bytes(4, "little") + content[12:end]


def _complete(tree: dict[str, Any], lights: LightSet | None, scene: Scene | None) -> None:
    """Put materials, camera and lights into the tree of a file."""
    tree["asset"]["generator"] = GENERATOR
    used: set[str] = set()
    nodes: list[dict[str, Any]] = tree["nodes"] if scene else []
    roots: list[int] = tree["scenes"][0]["nodes"] if scene else []
    if scene is not None:
        tree["materials"] = [
            {"name": item.name, **_material(item.material)} for item in scene.objects
        ]
        used.update(*(one.get("extensions", ()) for one in tree["materials"]))
        place = {item.name: index for index, item in enumerate(scene.objects)}
        for mesh in tree["meshes"]:
            mesh["primitives"][0]["material"] = place[mesh["name"]]
        tree["cameras"] = [_camera(scene.camera)]
        roots.append(len(nodes))
        nodes.append({"name": "camera", "camera": 0, **_placed(scene.camera)})
    if lights is not None and _add_lights(tree, lights, nodes, roots):
        used.add(LIGHTS)
    # glTF has no empty lists.
    for owner, name, found in (
        (tree, "extensionsUsed", sorted(used)),
        (tree, "nodes", nodes),
        (tree["scenes"][0], "nodes", roots),
    ):
        owner[name] = found
        if not found:
            del owner[name]


def _add_lights(
    tree: dict[str, Any], lights: LightSet, nodes: list[dict[str, Any]], roots: list[int]
) -> bool:
    """Put lights, and what they mean, into a tree and its nodes; whether there are any."""
    made: list[dict[str, Any]] = []
    for layer in lights.layers:
        first = len(nodes)
        for index in range(len(layer.direction)):
            light, node = _light(lights, layer, index)
            node["extensions"] = {LIGHTS: {"light": len(made)}}
            made.append(light)
            nodes.append(node)
        if len(nodes) > first:
            roots.append(len(nodes))
            nodes.append({"name": layer.name, "children": list(range(first, len(nodes)))})
    if made:
        tree["extensions"] = {LIGHTS: {"lights": made}}
    about = {"title": lights.title, "meaning": USE, "map_digest": lights.map_digest}
    if lights.residual is not None:
        about["residual"] = lights.residual_file
    tree["scenes"][0]["extras"] = about
    return bool(made)


def _light(lights: LightSet, layer: Layer, index: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """A light, and the node that turns it."""
    name = f"{layer.name} {index:05d}"
    strength, color = strength_and_color(layer.on_facing_plane[index])
    w, x, y, z = quaternion(frame_towards(layer.direction[index]))
    flux, energy = (
        float(of @ LUMINANCE_WEIGHTS) for of in (layer.irradiance[index], lights.map_flux)
    )
    extras = {
        "solid_angle": float(cap_solid_angle(layer.angle[index])),
        "angular_radius": float(layer.angle[index]),
        "share_of_energy": flux / energy if energy else 0.0,
    }
    light = {"type": "directional", "name": name, "intensity": strength, "color": list(color)}
    return light, {"name": name, "rotation": [x, y, z, w], "extras": extras}


def _material(material: Material) -> dict[str, Any]:
    """A material of glTF, without its name."""
    extensions: dict[str, Any] = {}
    match material:
        case Lambert(color):
            alpha, metallic = 1.0, 0.0
            extensions = {"KHR_materials_specular": {"specularFactor": 0.0}}
        case Coated(color, alpha, ior):
            metallic = 0.0
            extensions = {"KHR_materials_ior": {"ior": ior}}
        case Conductor(color, alpha):
            metallic = 1.0
        case Ward(diffuse, specular, along, across):
            alpha = math.sqrt(along * across)
            metallic = float(sum(specular) > sum(diffuse))
            red, green, blue = np.add(diffuse, specular).tolist()
            color = (red, green, blue) if metallic else diffuse
    surface = {
        "baseColorFactor": [*color, 1.0],
        "metallicFactor": metallic,
        "roughnessFactor": math.sqrt(alpha),
    }
    return {"pbrMetallicRoughness": surface} | ({"extensions": extensions} if extensions else {})


def _camera(camera: Camera) -> dict[str, Any]:
    distance = math.dist(camera.eye, camera.target)
    view = {
        "yfov": math.radians(camera.field_of_view),
        "aspectRatio": ASPECT,
        "znear": 0.01 * distance,
        "zfar": 1e4 * distance,
    }
    return {"type": "perspective", "perspective": view}


def _placed(camera: Camera) -> dict[str, Any]:
    """Where a camera of glTF stands, which looks along its −Z with +Y up."""
    right, up, forward = camera_axes(camera)
    w, x, y, z = quaternion(np.stack([right, up, -np.asarray(forward)], axis=1))
    return {"translation": list(camera.eye), "rotation": [x, y, z, w]}
