"""A scene for LuxCore: render.cfg, scene.scn, its meshes as PLY, and the map.

Meshes and camera keep this project's frame. LuxCore's maps have u = atan2(y, x) / 2π and v from
+Z, so that its direction (cos φ sin θ, sin φ sin θ, cos θ) is this project's (sin φ sin θ, cos θ,
−cos φ sin θ): the map is put into the scene by the reflection that takes one to the other. A texel
is read as it is, without interpolation.

LuxCore draws from the map alone at a path's last vertex where that is its first one too; with one
vertex more it draws from the BSDF as well and weighs the two, and still ends before any second
surface shines. So paths have two vertices. Its Sobol sampler ships adaptive; that is off. Its
camera sees rows of pixels one too high, which the window on the picture's plane makes up for.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.questions.production_renderers.written_scene import (
    MAP,
    Picture,
    mesh_place,
    unknown_material,
    write_map,
    write_ply,
    write_program,
)
from experiments.run.loaded_run import write_text
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Conductor, Lambert
from samplers import EnvironmentMap

PROGRAM = "luxcore_program.py"
MAP_TO_SCENE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
"""From LuxCore's frame of a map to the scene's."""
VERTICES = 2
SETTINGS: dict[str, Any] = {
    "renderengine.type": "PATHCPU",
    "sampler.type": "SOBOL", "sampler.sobol.adaptive.strength": 0.0,
    "path.pathdepth.total": VERTICES, "path.pathdepth.diffuse": VERTICES,
    "path.pathdepth.glossy": VERTICES, "path.pathdepth.specular": VERTICES,
    "path.clamping.variance.maxvalue": 0.0, "path.hybridbackforward.enable": 0,
    "path.forceblackbackground.enable": 1, "film.filter.type": "NONE",
    "film.imagepipeline.0.type": "NOP", "film.outputs.0.type": "RGB_IMAGEPIPELINE",
    "film.outputs.0.filename": "image.exr",
}  # fmt: skip
MIRROR: dict[str, Any] = {"type": "fresnelconst", "n": [1.0] * 3, "k": [1e3] * 3}
"""Reflects all but 4e-6; by a colour LuxCore makes no metal that reflects more than .999."""
Value = str | int | float | Sequence[float]


def write(scene: Scene, environment: EnvironmentMap, picture: Picture, folder: Path) -> str:
    """Write the scene into a folder; returns the command that renders it there."""
    properties = describe(scene, picture)
    for index, item in enumerate(scene.objects):
        write_ply(folder / mesh_place(index, "ply"), item.mesh)
    write_map(folder, environment)
    write_text(folder / "scene.scn", as_text(properties))
    write_text(folder / "render.cfg", as_text(settings(picture)))
    write_program(folder, PROGRAM)
    return f"luxcoreconsole -D batch.haltspp {picture.samples} render.cfg"


def as_text(properties: dict[str, Value]) -> str:
    """Properties as LuxCore's files have them, a line each."""
    return "".join(f"{name} = {_text(value)}\n" for name, value in properties.items())


def settings(picture: Picture) -> dict[str, Value]:
    """The content of render.cfg."""
    return {
        "scene.file": "scene.scn",
        "film.width": picture.width,
        "film.height": picture.height,
        "batch.haltspp": picture.samples,
        **SETTINGS,
    }


def describe(scene: Scene, picture: Picture) -> dict[str, Value]:
    """The content of scene.scn."""
    transformation = np.eye(4)
    transformation[:3, :3] = MAP_TO_SCENE
    properties: dict[str, Value] = {
        **_camera(scene.camera, picture),
        "scene.lights.map.type": "infinite",
        "scene.lights.map.file": MAP,
        "scene.lights.map.gamma": 1.0,
        "scene.lights.map.storage": "float",
        "scene.lights.map.filter": "nearest",
        # Columns of the matrix one after another.
        "scene.lights.map.transformation": transformation.T.ravel().tolist(),
        **{f"scene.textures.mirror.{name}": value for name, value in MIRROR.items()},
    }
    for index, item in enumerate(scene.objects):
        properties |= {f"scene.materials.m{index}.{k}": v for k, v in _material(item).items()}
        properties |= {
            f"scene.shapes.s{index}.type": "mesh",
            f"scene.shapes.s{index}.ply": mesh_place(index, "ply"),
            f"scene.objects.o{index}.shape": f"s{index}",
            f"scene.objects.o{index}.material": f"m{index}",
        }
    return properties


def _camera(camera: Camera, picture: Picture) -> dict[str, Value]:
    """The plane's window is that of the picture, in half heights, one row of pixels lower."""
    aspect, row = picture.width / picture.height, 2.0 / picture.height
    return {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": camera.eye,
        "scene.camera.lookat.target": camera.target,
        "scene.camera.up": camera.up,
        "scene.camera.fieldofview": camera.field_of_view,
        "scene.camera.screenwindow": (-aspect, aspect, -1.0 - row, 1.0 - row),
        "scene.camera.autofocus.enable": 0,
    }


def _material(item: Object) -> dict[str, Value]:
    match item.material:
        case Lambert(albedo):
            return {"type": "matte", "kd": albedo}
        case Conductor((1.0, 1.0, 1.0), roughness):
            return {
                "type": "metal2",
                "fresnel": "mirror",
                "uroughness": roughness,
                "vroughness": roughness,
            }
        case _:
            raise unknown_material("LuxCore", item)


def _text(value: Value) -> str:
    """A value as LuxCore reads it: text in quotes, lists of numbers all floats."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Sequence):
        return " ".join(repr(float(part)) for part in value)
    return repr(value)
