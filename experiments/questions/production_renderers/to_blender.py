"""A scene for Cycles: scene.json in Blender's frame, its meshes as NumPy arrays, and the map.

Vertices are turned to +Z up and the map's look-up with them (`renderer.scene.blender_frame`). A
texel is read as it is, without interpolation.

Direct light is all light where no path bounces. Cycles ships with denoising, adaptive sampling, a
clamp of indirect light, a light tree, filtered glossiness, and with light samples that are
dropped where they carry little; all are off. Offsets that hide the facets of smooth meshes are 0.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.production_renderers.written_scene import (
    MAP,
    Picture,
    mesh_place,
    unknown_material,
    write_arrays,
    write_json,
    write_map,
    write_program,
)
from renderer.primary import camera_axes
from renderer.scene import Camera, Object, Scene
from renderer.scene.blender_frame import MAP_TURN, UP_TO_Z
from renderer.scene.materials import Conductor, Lambert
from samplers import EnvironmentMap

PROGRAM = "blender_program.py"
CLIP = (0.01, 1e4)
RENDER: dict[str, Any] = {
    "resolution_percentage": 100,
    "film_transparent": True,
    "use_compositing": False,
    "use_sequencer": False,
    "use_persistent_data": True,
    "dither_intensity": 0.0,
}
CYCLES: dict[str, Any] = {
    "device": "CPU",
    "max_bounces": 0, "pixel_filter_type": "BOX", "filter_width": 1.0, "use_denoising": False,
    "use_adaptive_sampling": False, "sample_clamp_direct": 0.0, "sample_clamp_indirect": 0.0,
    "use_light_tree": False, "use_guiding": False, "light_sampling_threshold": 0.0,
    "blur_glossy": 0.0, "use_auto_tile": False,
}  # fmt: skip
OBJECT = {"shadow_terminator_geometry_offset": 0.0, "shadow_terminator_shading_offset": 0.0}


def write(scene: Scene, environment: EnvironmentMap, picture: Picture, folder: Path) -> str:
    """Write the scene into a folder; returns the command that renders it there."""
    description = describe(scene, picture)
    for index, item in enumerate(scene.objects):
        write_arrays(
            folder / mesh_place(index, "npz"),
            vertex=in_blender(item.mesh.vertex),
            normal=in_blender(item.mesh.normal),
            triangle=item.mesh.triangle.astype(np.int32),
        )
    write_map(folder, environment)
    write_json(folder / "scene.json", description)
    write_program(folder, PROGRAM)
    return (
        f"blender --background --python render.py -- --samples {picture.samples} --output image.exr"
    )


def in_blender(points: NDArray[Any]) -> NDArray[np.float32]:
    """Points or directions (..., 3) in Blender's frame."""
    return np.ascontiguousarray(points @ UP_TO_Z.T, np.float32)


def camera_matrix(camera: Camera) -> NDArray[np.float64]:
    """Rotation and place (4, 4) of a Blender camera, which looks along its −Z with +Y up."""
    right, up, forward = camera_axes(camera)
    matrix = np.eye(4)
    matrix[:3, :3] = UP_TO_Z @ np.stack([right, up, -forward], axis=1)
    matrix[:3, 3] = UP_TO_Z @ np.array(camera.eye)
    return matrix


def describe(scene: Scene, picture: Picture) -> dict[str, Any]:
    """The content of scene.json."""
    return {
        "name": scene.name,
        "render": {**RENDER, "resolution_x": picture.width, "resolution_y": picture.height},
        "cycles": {**CYCLES, "samples": picture.samples},
        "camera": {
            "matrix": camera_matrix(scene.camera).tolist(),
            "angle": math.radians(scene.camera.field_of_view),
            "clip": CLIP,
        },
        "map": {
            "file": MAP,
            "rotation": [0.0, 0.0, MAP_TURN],
            "interpolation": "Closest",
            "colorspace": "Linear Rec.709",
            "cycles": {"sampling_method": "AUTOMATIC"},
        },
        "objects": [
            {
                "name": item.name,
                "mesh": mesh_place(index, "npz"),
                "material": _material(item),
                "options": OBJECT,
            }
            for index, item in enumerate(scene.objects)
        ],
    }


def _material(item: Object) -> dict[str, Any]:
    """A node of Blender's, its options and inputs. Blender's roughness is the root of α."""
    match item.material:
        case Lambert(albedo):
            return {
                "node": "ShaderNodeBsdfDiffuse",
                "options": {},
                "inputs": {"Color": [*albedo, 1.0], "Roughness": 0.0},
            }
        case Conductor((1.0, 1.0, 1.0) as reflectance, roughness):
            return {
                "node": "ShaderNodeBsdfAnisotropic",
                "options": {"distribution": "GGX"},
                "inputs": {"Color": [*reflectance, 1.0], "Roughness": math.sqrt(roughness)},
            }
        case _:
            raise unknown_material("Blender", item)
