"""Who renders: three production renderers, each in a process of its own, and this project's own.

What all get is a scene over black under a map: direct light alone, a box filter of one pixel, one
sample of the map and one of the BSDF for each sample of a pixel.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.questions.production_renderers import to_blender, to_luxcore, to_mitsuba
from experiments.questions.production_renderers.to_mitsuba import LLVM, SCALAR, llvm_library
from experiments.questions.production_renderers.written_scene import Picture
from renderer.monte_carlo import shade_distribution
from renderer.scene import Scene
from renderer.surface import shade_surface
from renderer.view import make_view
from samplers import EnvironmentMap, EnvlightError, LightDistribution
from samplers.lighting import Lighting, SurfaceDistribution

Write = Callable[[Scene, EnvironmentMap, Picture, Path], str]
PER_SUBPIXEL = 2
"""Samples at a sub-pixel: one of the map and one of the BRDF, or two resampled ones."""


@dataclass(frozen=True)
class Contender:
    """A production renderer.

    label : in tables
    package : that has it; program : of a written scene, its source counts with the results
    write : its translator
    variant : of its code, where it has several
    environment : variables of its process
    """

    label: str
    package: str
    program: str
    write: Write
    variant: str = ""
    environment: Mapping[str, str] = field(default_factory=dict)


def contenders() -> tuple[Contender, ...]:
    """The production renderers, Mitsuba's LLVM variant where there is an LLVM library for it."""
    library = llvm_library()
    variant = LLVM if library else SCALAR
    variables = {"DRJIT_LIBLLVM_PATH": library} if library else {}

    def mitsuba(label: str, compensation: bool) -> Contender:
        options = to_mitsuba.MitsubaOptions(variant, compensation)
        write = partial(to_mitsuba.write, options=options)
        return Contender(label, "mitsuba", "mitsuba_program", write, variant, variables)

    return (
        mitsuba("Mitsuba 3", False),
        mitsuba("Mitsuba 3, compensated", True),
        Contender("Cycles", "bpy", "blender_program", to_blender.write),
        Contender("LuxCore", "pyluxcore", "luxcore_program", to_luxcore.write),
    )


WRITERS: Mapping[str, Write] = {
    "mitsuba": to_mitsuba.write,
    "blender": to_blender.write,
    "luxcore": to_luxcore.write,
}
"""Translators by the names that the command line has for the programs."""


def own_image(
    scene: Scene,
    environment: EnvironmentMap,
    lighting: Lighting,
    picture: Picture,
    seed: int,
) -> tuple[NDArray[np.float32], float]:
    """The surfaces over black, with `samples` sub-pixels a pixel, and the seconds it took.

    Primary rays count in the time, as elsewhere; Embree's hierarchy and the lighting's table are
    there before, as the others' are.
    """
    started = time.perf_counter()
    view = make_view(scene, picture.width, picture.height, picture.samples)
    match lighting:
        case SurfaceDistribution():
            points, _ = shade_surface(view, environment, lighting, seed)
        case LightDistribution():
            points, _ = shade_distribution(view, environment, lighting, seed)
        case _:
            raise EnvlightError(
                "production-renderers: only samplers that give a distribution take samples like a "
                "renderer; leave the others out of --samplers"
            )
    image = view.to_image(points, None)
    return image, time.perf_counter() - started
