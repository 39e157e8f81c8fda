"""Mitsuba 3 as a peer: the same meshes, camera and map, rendered in a process of its own.

A process of its own, because Mitsuba's LLVM backend ends the whole process where the LLVM library
it finds does not suit it; that is then a reason to leave it out, no more. Only times are compared:
coated surfaces become `roughplastic` and metals of GGX, which cost alike and look nearly alike.
Mitsuba takes as many emitter and BSDF samples at a sub-pixel as are taken here.
"""

import importlib.util
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.production_renderers.to_mitsuba import (
    LLVM,
    NO_LLVM,
    SCALAR,
    llvm_library,
)
from renderer.scene import Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Material
from samplers import EnvironmentMap, EnvlightError

VARIANTS = (SCALAR, LLVM)
_loaded: dict[str, Any] = {}


def is_installed() -> bool:
    """Whether the package mitsuba can be imported."""
    return importlib.util.find_spec("mitsuba") is not None


@dataclass(frozen=True)
class PeerSettings:
    variant: str
    width: int
    height: int
    samples: int
    threads: int
    emitter_samples: int = 1
    bsdf_samples: int = 1


class Peer:
    """A process in which Mitsuba renders one scene. Close it after use.

    Raises EnvlightError, with the reason, where the variant does not work on this machine."""

    def __init__(self, scene: Scene, environment: EnvironmentMap, settings: PeerSettings) -> None:
        self._variant = settings.variant
        library = llvm_library()
        if settings.variant.startswith("llvm") and library is None:
            raise EnvlightError(
                f"Mitsuba {self._variant}: {NO_LLVM}; name one by DRJIT_LIBLLVM_PATH"
            )
        self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
        try:
            self._call(_load, scene, environment.radiance, settings, library)
            self.render(0)
        except EnvlightError:
            self.close()
            raise

    def render(self, seed: int) -> NDArray[np.float32]:
        """The image (height, width, 3)."""
        image: NDArray[np.float32] = self._call(_render, seed)
        return image

    def close(self) -> None:
        self._pool.shutdown()

    def _call(self, function: Any, *arguments: Any) -> Any:
        try:
            return self._pool.submit(function, *arguments).result()
        except BrokenProcessPool as error:
            raise EnvlightError(
                f"Mitsuba {self._variant}: its process ended; a suitable LLVM library is missing "
                "(name one by DRJIT_LIBLLVM_PATH)"
            ) from error
        except EnvlightError:
            raise
        except Exception as error:
            sentence = " ".join(str(error).split())[:200]
            raise EnvlightError(f"Mitsuba {self._variant}: {sentence}") from error


def _load(
    scene: Scene, radiance: NDArray[np.float32], settings: PeerSettings, library: str | None
) -> None:
    if library:
        os.environ["DRJIT_LIBLLVM_PATH"] = library
    import drjit
    import mitsuba

    # Before an unsuitable LLVM ends the process it writes pages of machine code there.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    mitsuba.set_variant(settings.variant)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    drjit.set_thread_count(settings.threads)
    _loaded["scene"] = mitsuba.load_dict(description(mitsuba, scene, radiance, settings))
    _loaded["mitsuba"] = mitsuba


def _render(seed: int) -> NDArray[np.float32]:
    return np.array(_loaded["mitsuba"].render(_loaded["scene"], seed=seed), np.float32)


def description(
    mitsuba: Any, scene: Scene, radiance: NDArray[np.float32], settings: PeerSettings
) -> dict[str, Any]:
    """The scene as `mitsuba.load_dict` reads it, under a map (h, w, 3) as Mitsuba lays it out."""
    camera = scene.camera
    look = mitsuba.ScalarTransform4f().look_at(
        origin=list(camera.eye), target=list(camera.target), up=list(camera.up)
    )
    film = {
        "type": "hdrfilm", "width": settings.width, "height": settings.height,
        "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32",
    }  # fmt: skip
    result: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": settings.emitter_samples,
            "bsdf_samples": settings.bsdf_samples},
        "map": {"type": "envmap", "bitmap": mitsuba.Bitmap(radiance)},
        "sensor": {
            "type": "perspective", "fov": camera.field_of_view, "fov_axis": "y", "to_world": look,
            "film": film, "sampler": {"type": "independent", "sample_count": settings.samples},
        },
    }  # fmt: skip
    for item in scene.objects:
        result[item.name] = _mesh(mitsuba, item.name, item.mesh, item.material)
    return result


def _mesh(mitsuba: Any, name: str, mesh: Any, material: Material) -> Any:
    properties = mitsuba.Properties()
    properties["bsdf"] = mitsuba.load_dict(_bsdf(material))
    result = mitsuba.Mesh(
        name, len(mesh.vertex), len(mesh.triangle), properties, has_vertex_normals=True
    )
    parameters = mitsuba.traverse(result)
    parameters["vertex_positions"] = mesh.vertex.ravel()
    parameters["vertex_normals"] = mesh.normal.ravel()
    parameters["faces"] = mesh.triangle.ravel().astype(np.uint32)
    parameters.update()
    return result


def _bsdf(material: Material) -> dict[str, Any]:
    def rgb(value: tuple[float, float, float]) -> dict[str, Any]:
        return {"type": "rgb", "value": list(value)}

    match material:
        case Lambert(albedo):
            return {"type": "diffuse", "reflectance": rgb(albedo)}
        case Coated(albedo, roughness, ior):
            return {
                "type": "roughplastic", "distribution": "ggx", "alpha": max(roughness, 1e-3),
                "int_ior": ior, "diffuse_reflectance": rgb(albedo),
            }  # fmt: skip
        case Conductor(reflectance, roughness):
            return {
                "type": "roughconductor", "distribution": "ggx", "alpha": max(roughness, 1e-3),
                "material": "none", "specular_reflectance": rgb(reflectance),
            }  # fmt: skip
    raise EnvlightError(f"Mitsuba has no material like {type(material).__name__}")
