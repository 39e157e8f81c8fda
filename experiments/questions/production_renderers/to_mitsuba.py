"""A scene for Mitsuba 3: scene.xml, its meshes as PLY, and the map.

Mitsuba's frame and its reading of a map are those of this project: +Y up, row 0 above, and the
middle column towards +Z. Its rows are not texels but lie on the poles and between them, row j of h
at v = j / (h − 1), and it interpolates. So it is given one row more than the map has, each the mean
of the two rows of texels that meet there (the first and the last as they are): interpolation then
shifts nothing and keeps the energy of every row up to its own solid angle's curvature.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from experiments.questions.production_renderers.written_scene import (
    MAP,
    Picture,
    mesh_place,
    unknown_material,
    write_json,
    write_ply,
    write_program,
)
from experiments.run.loaded_run import write_text
from renderer.image import write_exr
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Conductor, Lambert
from samplers import EnvironmentMap

PROGRAM = "mitsuba_program.py"
VERSION = "3.9.0"
SCALAR, LLVM = "scalar_rgb", "llvm_ad_rgb"
LEAST_LLVM = 16
NO_LLVM = f"no LLVM library of version {LEAST_LLVM} or later was found"
LIBRARY_FOLDERS = ("usr/lib", "usr/lib64", "usr/lib/*-linux-gnu", "usr/lib/llvm-*/lib")


def llvm_library() -> str | None:
    """Find the LLVM library for Mitsuba's LLVM variants: DRJIT_LIBLLVM_PATH, or the newest here.

    None where there is none of version 16 or later: older ones end the process.
    """
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        return named
    found: list[tuple[int, str]] = []
    for pattern in LIBRARY_FOLDERS:
        for path in Path("/").glob(f"{pattern}/libLLVM*.so*"):
            version = re.search(r"libLLVM(?:-|\.so\.)(\d+)", path.name)
            if version and int(version[1]) >= LEAST_LLVM:
                found.append((int(version[1]), str(path)))
    return max(found)[1] if found else None


@dataclass(frozen=True)
class MitsubaOptions:
    """variant : of Mitsuba's; compensation : of the map's table for MIS, off in Mitsuba as it is"""

    variant: str = SCALAR
    compensation: bool = False
    sampler: str = "multijitter"


def write(
    scene: Scene,
    environment: EnvironmentMap,
    picture: Picture,
    folder: Path,
    options: MitsubaOptions = MitsubaOptions(),
) -> str:
    """Write the scene into a folder; returns the command that renders it there."""
    root = describe(scene, picture, options)
    for index, item in enumerate(scene.objects):
        write_ply(folder / mesh_place(index, "ply"), item.mesh)
    write_exr(folder / MAP, on_edges(environment.radiance))
    ElementTree.indent(root)
    write_text(folder / "scene.xml", ElementTree.tostring(root, "unicode") + "\n")
    write_json(folder / "program.json", {"variant": options.variant, "sampler": options.sampler,
               "mis_compensation": options.compensation})  # fmt: skip
    write_program(folder, PROGRAM)
    return f"mitsuba -m {options.variant} -D samples={picture.samples} -o image.exr scene.xml"


def on_edges(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rows of texels (h, w, 3) as values on the edges between them, (h + 1, w, 3)."""
    exact = radiance.astype(np.float64)
    edges = np.concatenate([exact[:1], 0.5 * (exact[1:] + exact[:-1]), exact[-1:]])
    return edges.astype(np.float32)


def describe(scene: Scene, picture: Picture, options: MitsubaOptions) -> ElementTree.Element:
    """The scene's file; `samples` can be set where it is rendered."""
    root = ElementTree.Element("scene", version=VERSION)
    ElementTree.SubElement(root, "default", name="samples", value=str(picture.samples))
    integrator = _part(root, "integrator", "direct")
    _value(integrator, "integer", "emitter_samples", 1)
    _value(integrator, "integer", "bsdf_samples", 1)
    _value(integrator, "boolean", "hide_emitters", True)
    _sensor(root, scene.camera, picture, options)
    emitter = _part(root, "emitter", "envmap")
    _value(emitter, "string", "filename", MAP)
    _value(emitter, "boolean", "mis_compensation", options.compensation)
    for index, item in enumerate(scene.objects):
        shape = _part(root, "shape", "ply")
        shape.set("id", f"object-{index}")
        _value(shape, "string", "filename", mesh_place(index, "ply"))
        _value(shape, "boolean", "face_normals", False)
        _bsdf(shape, item)
    return root


def _sensor(
    root: ElementTree.Element, camera: Camera, picture: Picture, options: MitsubaOptions
) -> None:
    sensor = _part(root, "sensor", "perspective")
    _value(sensor, "float", "fov", camera.field_of_view)
    _value(sensor, "string", "fov_axis", "y")
    place = ElementTree.SubElement(sensor, "transform", name="to_world")
    vectors = {"origin": camera.eye, "target": camera.target, "up": camera.up}
    ElementTree.SubElement(place, "lookat", {k: _numbers(v) for k, v in vectors.items()})
    sampler = _part(sensor, "sampler", options.sampler)
    _value(sampler, "integer", "sample_count", "$samples")
    film = _part(sensor, "film", "hdrfilm")
    _value(film, "integer", "width", picture.width)
    _value(film, "integer", "height", picture.height)
    _value(film, "string", "pixel_format", "rgb")
    _value(film, "string", "component_format", "float32")
    _part(film, "rfilter", "box")


def _bsdf(shape: ElementTree.Element, item: Object) -> None:
    """One-sided in Mitsuba, so that it is put on both sides."""
    both = _part(shape, "bsdf", "twosided")
    match item.material:
        case Lambert(albedo):
            _value(_part(both, "bsdf", "diffuse"), "rgb", "reflectance", _numbers(albedo))
        case Conductor((1.0, 1.0, 1.0), roughness):
            bsdf = _part(both, "bsdf", "roughconductor")
            _value(bsdf, "string", "distribution", "ggx")
            _value(bsdf, "string", "material", "none")
            _value(bsdf, "float", "alpha", roughness)
        case _:
            raise unknown_material("Mitsuba", item)


def _part(parent: ElementTree.Element, tag: str, kind: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, type=kind)


def _value(parent: ElementTree.Element, tag: str, name: str, value: object) -> None:
    text = str(value).lower() if isinstance(value, bool) else str(value)
    ElementTree.SubElement(parent, tag, name=name, value=text)


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(repr(float(value)) for value in values)
