"""What is written of a scene for any renderer: its meshes, its map, and how large the picture is.

A renderer's translator adds the files that the renderer reads, and the program that renders them.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.production_renderers import programs
from experiments.run.loaded_run import write_text
from renderer.image import write_exr, write_whole
from renderer.scene import Mesh, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from samplers import EnvironmentMap, EnvlightError

MAP = "map.exr"
LAMBERT, CONDUCTOR = "lambert", "conductor"
MATERIALS = (LAMBERT, CONDUCTOR)
"""Materials that all renderers have: ideal diffuse ones, and a metal that reflects everything."""
ROUGHNESS = 0.1
"""GGX α of the metal: small enough for the renderers' masking terms to be nearly the same."""


@dataclass(frozen=True)
class Picture:
    """width, height : in pixels; samples : a pixel, where nothing else is asked for"""

    width: int
    height: int
    samples: int = 64


def with_materials(scene: Scene, materials: str) -> Scene:
    """The scene with each surface ideally diffuse, or all of it a metal that reflects everything.

    A diffuse surface keeps its colour: the albedo below a coat, a metal's reflectance, and all that
    a Ward material reflects.
    """
    if materials not in MATERIALS:
        raise EnvlightError(f"no materials are called '{materials}'; use {' or '.join(MATERIALS)}")
    metal = Conductor((1.0, 1.0, 1.0), ROUGHNESS)
    return replace(
        scene,
        objects=tuple(
            Object(
                item.name, item.mesh, metal if materials == CONDUCTOR else _diffuse(item.material)
            )
            for item in scene.objects
        ),
    )


def _diffuse(material: Material) -> Lambert:
    match material:
        case Lambert(albedo) | Coated(albedo):
            return Lambert(albedo)
        case Conductor(reflectance):
            return Lambert(reflectance)
        case Ward(diffuse, specular):
            red, green, blue = (d + s for d, s in zip(diffuse, specular, strict=True))
            return Lambert((red, green, blue))
    raise EnvlightError(f"no diffuse material stands for {type(material).__name__}")


def unknown_material(renderer: str, item: Object) -> EnvlightError:
    """What to raise for a material that a renderer is not given."""
    return EnvlightError(
        f"object '{item.name}': {renderer} is not given {type(item.material).__name__}; "
        f"use --materials {' or '.join(MATERIALS)}"
    )


def mesh_place(index: int, suffix: str) -> str:
    """A mesh's file in a written scene. Names of objects may hold what names of files may not."""
    return f"meshes/{index:02d}.{suffix}"


def write_map(folder: Path, environment: EnvironmentMap) -> None:
    """The map's texels, unchanged, as OpenEXR of 32-bit floats."""
    write_exr(folder / MAP, environment.radiance)


def write_json(path: Path, content: Any) -> None:
    """A JSON file, whole."""
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


def write_ply(path: Path, mesh: Mesh) -> None:
    """A mesh with its vertex normals as binary PLY."""
    import trimesh

    whole = trimesh.Trimesh(mesh.vertex, mesh.triangle, vertex_normals=mesh.normal, process=False)
    content = trimesh.exchange.ply.export_ply(whole, vertex_normal=True)
    write_whole(path, lambda place: place.write_bytes(content))


def write_arrays(path: Path, **arrays: NDArray[Any]) -> None:
    """Arrays by name, as NumPy reads them."""

    def write(place: Path) -> None:
        with place.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)

    write_whole(path, write)


def write_program(folder: Path, program: str) -> None:
    """A renderer's program, as render.py, and what all programs share."""
    source = Path(programs.__file__).parent
    for name, target in ((program, "render.py"), ("session.py", "session.py")):
        write_text(folder / target, (source / name).read_text(encoding="utf-8"))
