"""What is written of a scene for any renderer, and how a written scene is rendered in a process.

A renderer's translator adds the files that the renderer reads, and the program that renders them.

The renderers take 1.6 GB, and two of them cannot live in one process, so they stay out of this
project's environment. `make renderers` makes one for them; ENVLIGHT_RENDERERS names another Python.
A renderer that is missing or ends its process is an EnvlightError, and costs no other.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
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
    write_whole(path, lambda place: np.savez(place, allow_pickle=False, **arrays))


def write_program(folder: Path, program: str) -> None:
    """A renderer's program, as render.py, and what all programs share."""
    source = Path(programs.__file__).parent
    for name, target in ((program, "render.py"), ("session.py", "session.py")):
        write_text(folder / target, (source / name).read_text(encoding="utf-8"))


VARIABLE = "ENVLIGHT_RENDERERS"
OWN_PYTHON = Path(".venv-renderers", "bin", "python")
"""Below the project's folder: the working one, or that of the source."""
MOST_SECONDS = 1800.0
"""A process that takes longer has lost its way."""
PROBE = """
import importlib.metadata, json, sys
found = {}
for name in sys.argv[1:]:
    try:
        found[name] = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        pass
print(json.dumps(found))
"""


@dataclass(frozen=True)
class Render:
    """One rendering: samples a pixel, a seed, and the file for it, .npy or .exr."""

    samples: int
    seed: int
    output: str


def renderers_python() -> Path:
    """The Python in which renderers are looked for: this one where there is none of their own."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    source = Path(__file__).parents[3]
    own = (folder / OWN_PYTHON for folder in (Path.cwd(), source))
    return next((python for python in own if python.is_file()), Path(sys.executable))


@cache
def installed(python: Path, packages: tuple[str, ...]) -> Mapping[str, str]:
    """Versions of those of the packages that a Python has."""
    try:
        found = subprocess.run(
            [python, "-c", PROBE, *packages], capture_output=True, text=True, check=True, timeout=60
        )
        versions: dict[str, str] = json.loads(found.stdout)
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        raise EnvlightError(
            f"{VARIABLE}: {python} does not work as a Python ({error}); name another"
        ) from error
    return versions


def require(package: str, label: str) -> str:
    """The version of a renderer's package; EnvlightError where it is missing."""
    versions = installed(renderers_python(), (package,))
    if package not in versions:
        raise EnvlightError(
            f"{label}: the package {package} is not installed; `make renderers` sets it up, or "
            f"{VARIABLE} names a Python that has it"
        )
    return versions[package]


def render_scene(
    folder: Path,
    renders: Sequence[Render],
    label: str,
    threads: int,
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Render a written scene several times in one process; returns the program's report.

    environment : variables of the process beside those of this one

    Raises EnvlightError with the last words of a process that failed, and after `MOST_SECONDS`.
    """
    plan, report = folder / "plan.json", folder / "report.json"
    content = {"threads": threads, "renders": [asdict(one) for one in renders],
               "report": str(report.resolve())}  # fmt: skip
    plan.write_text(json.dumps(content), encoding="utf-8")
    report.unlink(missing_ok=True)
    # Without what leads another Python to this one's packages.
    plain = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    try:
        ended = subprocess.run(
            [renderers_python().absolute(), "render.py", "--plan", "plan.json"],
            cwd=folder, env=plain | dict(environment or {}),
            capture_output=True, text=True, errors="replace", timeout=MOST_SECONDS,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise EnvlightError(f"{label}: stopped after {MOST_SECONDS:.0f} s") from None
    except OSError as error:
        raise EnvlightError(f"{label}: its Python cannot be started ({error})") from error
    found = json.loads(report.read_text(encoding="utf-8")) if report.is_file() else {"renders": []}
    # Some end badly after all is done, when their libraries are unloaded.
    if len(found["renders"]) < len(renders):
        raise EnvlightError(f"{label}: {_last_words(ended)}")
    return dict(found)


def _last_words(ended: subprocess.CompletedProcess[str]) -> str:
    lines = [line.strip() for line in ended.stderr.splitlines() if line.strip()]
    how = (
        f"its process was ended by signal {-ended.returncode}"
        if ended.returncode < 0
        else f"its process ended with status {ended.returncode}"
    )
    return f"{how}: {lines[-1][:200]}" if lines else how
