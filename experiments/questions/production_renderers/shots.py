"""Who renders, and what each makes of a case: the images that are judged, and its converged mean.

What all get is a scene over black under a map: direct light alone, a box filter of one pixel, one
sample of the map and one of the BSDF for each sample of a pixel.

A renderer has a process of its own, which renders in this order: two images to be thrown away; the
images that are timed and judged; and the independent runs whose mean is its converged image. Those
are independent and alike, so that the deviation of their means, over the root of their number, is
the standard error of the mean's mean: of the whole image, of each block, and, as the root of the
mean over pixels and channels, of the image itself (its noise floor).
"""

import math
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.production_renderers import to_blender, to_luxcore, to_mitsuba
from experiments.questions.production_renderers.to_mitsuba import LLVM, SCALAR, llvm_library
from experiments.questions.production_renderers.written_scene import (
    Picture,
    Render,
    render_scene,
    require,
)
from experiments.run.sampler_spec import SamplerSpec
from renderer.monte_carlo import shade_distribution
from renderer.packet.surfaces import LEAST_COSINE
from renderer.scene import Scene
from renderer.surface import shade_surface
from renderer.view import make_view
from samplers import (
    EnvironmentMap,
    EnvlightError,
    LightDistribution,
    LightSampler,
    SurfaceDistribution,
    make_sampler,
)
from samplers.threads import thread_count

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

Image = NDArray[np.float32]
OWN = "envlight"
"""Begins the labels of this project's own samplers."""
CONVERGED_BY = "mis"
"""All of them are unbiased, and this one's mean is that of all."""
CONVERGED_SUBPIXELS = 64
"""So many that their regular grid misses hardly a glint on a rounded edge."""
AWAY_SUBPIXELS = 16
JUST_FACING = 2.0 * LEAST_COSINE
"""Normals that were tilted have this cosine to the eye by half, but for rounding."""
WARM_UP = (1, 4)
"""Numbers of samples that are rendered once before anything is timed."""
WARM_UP_SEED, FIRST_RUN_SEED = 1, 1001
"""Images that are judged have the seeds between."""

BLOCK = 8
"""Pixels along the side of a block."""


@dataclass(frozen=True, eq=False)
class Converged:
    """image : (H, W, 3) float32, the mean of `runs` images
    halves : means of every other run, two images as long as there are two runs
    floor : RMSE of `image` by its own noise
    mean, mean_error : over pixels and channels, and its standard error
    blocks, block_error : (h, w) of blocks of BLOCK × BLOCK pixels; what is left over is not in one
    """

    image: NDArray[np.float32]
    halves: tuple[NDArray[np.float32], NDArray[np.float32]]
    floor: float
    mean: float
    mean_error: float
    blocks: NDArray[np.float64]
    block_error: NDArray[np.float64]
    runs: int

    @classmethod
    def of(cls, images: Sequence[NDArray[np.float32]]) -> "Converged":
        """The mean of at least two independent images of one size."""
        stack = np.stack(images).astype(np.float64)
        runs = len(stack)
        means, blocks = stack.mean(axis=(1, 2, 3)), np.stack([_blocks(one) for one in stack])
        halves = stack[::2].mean(axis=0), stack[1::2].mean(axis=0)
        return cls(
            image=stack.mean(axis=0).astype(np.float32),
            halves=(halves[0].astype(np.float32), halves[1].astype(np.float32)),
            floor=math.sqrt(stack.var(axis=0, ddof=1).mean() / runs),
            mean=float(means.mean()),
            mean_error=float(means.std(ddof=1) / math.sqrt(runs)),
            blocks=blocks.mean(axis=0),
            block_error=blocks.std(axis=0, ddof=1) / math.sqrt(runs),
            runs=runs,
        )


def _blocks(image: NDArray[np.float64]) -> NDArray[np.float64]:
    height, width = (size // BLOCK for size in image.shape[:2])
    cut = image[: height * BLOCK, : width * BLOCK]
    return cut.reshape(height, BLOCK, width, BLOCK, 3).mean(axis=(1, 3, 4))


@dataclass(frozen=True)
class Agreement:
    """How a mean agrees with another; all but `block_z` in units of the other's mean.

    difference, difference_error : of the image's mean, and its standard error
    block_difference : RMS over blocks, without what noise alone gives; 0 where that is all
    block_noise : what noise alone gives
    block_z : RMS over blocks of differences in units of their standard errors
    """

    difference: float
    difference_error: float
    block_difference: float
    block_noise: float
    block_z: float

    @classmethod
    def of(cls, one: Converged, other: Converged) -> "Agreement":
        between = one.blocks - other.blocks
        noise = one.block_error**2 + other.block_error**2
        lit = noise > 0.0
        unit = other.mean if other.mean > 0.0 else 1.0
        excess = float((between**2 - noise).mean())
        return cls(
            difference=(one.mean - other.mean) / unit,
            difference_error=math.hypot(one.mean_error, other.mean_error) / unit,
            block_difference=math.sqrt(max(0.0, excess)) / unit,
            block_noise=math.sqrt(float(noise.mean())) / unit,
            block_z=(
                math.sqrt(float((between[lit] ** 2 / noise[lit]).mean())) if lit.any() else math.nan
            ),
        )


@dataclass(frozen=True)
class Effort:
    """How large and how exact.

    samples : a pixel, to be measured, and how many images of each
    runs, run_samples : the independent runs whose mean is converged, and their samples a pixel
    """

    width: int
    height: int
    samples: tuple[tuple[int, int], ...]
    runs: int
    run_samples: int

    def picture(self, samples: int) -> Picture:
        return Picture(self.width, self.height, samples)

    @property
    def judged(self) -> list[tuple[int, int]]:
        """Samples and seed of each image."""
        pairs = [samples for samples, images in self.samples for _ in range(images)]
        return [(samples, WARM_UP_SEED + 1 + k) for k, samples in enumerate(pairs)]

    @property
    def run_seeds(self) -> range:
        return range(FIRST_RUN_SEED, FIRST_RUN_SEED + self.runs)


@dataclass(frozen=True, eq=False)
class Shots:
    """images : with samples and seconds; converged : the mean; facts : version and settings
    mean_samples : what was really taken, where the renderer says so
    """

    images: Sequence[tuple[int, float, Image]]
    converged: Converged
    facts: Mapping[str, Any]
    mean_samples: Mapping[int, float]


def their_shots(
    renderer: Contender, scene: Scene, environment: EnvironmentMap, effort: Effort, ours: Converged
) -> Shots:
    """What a production renderer makes; EnvlightError where it makes nothing."""
    version = require(renderer.package, renderer.label)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        renderer.write(scene, environment, Picture(effort.width, effort.height), folder)
        first = [(samples, WARM_UP_SEED) for samples in WARM_UP]
        runs = [(effort.run_samples, seed) for seed in effort.run_seeds]
        pairs = [*first, *effort.judged, *runs]
        plan = [Render(*pair, str(folder / f"{k}.npy")) for k, pair in enumerate(pairs)]
        report = render_scene(folder, plan, renderer.label, thread_count(), renderer.environment)
        images = [_read(Path(one.output), effort, renderer.label) for one in plan]
    begin, end = len(first), len(first) + len(effort.judged)
    done = report["renders"][begin:end]
    return Shots(
        [(one["samples"], one["seconds"], images[begin + k]) for k, one in enumerate(done)],
        Converged.of(images[end:]),
        {**report["facts"], "package": f"{renderer.package} {version}"},
        {one["samples"]: one["mean_samples"] for one in done if "mean_samples" in one},
    )


def _read(path: Path, effort: Effort, label: str) -> Image:
    image: Image = np.load(path)
    if image.shape != (effort.height, effort.width, 3) or not np.isfinite(image).all():
        raise EnvlightError(
            f"{label}: its image has shape {image.shape}, or values that are not finite"
        )
    return image


def own_shots(
    sampler: SamplerSpec, scene: Scene, environment: EnvironmentMap, effort: Effort, ours: Converged
) -> Shots:
    """What one of this project's samplers makes; its converged mean is `ours`."""
    made = sampler.sampler
    pairs = [*((samples, WARM_UP_SEED) for samples in WARM_UP), *effort.judged]
    images = [
        (n, *own_image(scene, environment, made, effort.picture(n), seed)) for n, seed in pairs
    ]
    facts = {"renderer": OWN, "sampler": sampler.label, "samples at a sub-pixel": PER_SUBPIXEL}
    return Shots(images[len(WARM_UP) :], ours, facts, {})


def own_image(
    scene: Scene, environment: EnvironmentMap, made: LightSampler, picture: Picture, seed: int
) -> tuple[float, Image]:
    """The seconds it took, and the surfaces over black, `samples` sub-pixels a pixel.

    Primary rays count in the time, as elsewhere; Embree's hierarchy and the lighting's table are
    there before, as the others' are.
    """
    lighting = made.prepare(environment, PER_SUBPIXEL, np.random.default_rng(seed))
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
    return time.perf_counter() - started, image


def own_converged(scene: Scene, environment: EnvironmentMap, effort: Effort) -> Converged:
    """This project's converged mean."""
    picture, made = effort.picture(CONVERGED_SUBPIXELS), make_sampler(CONVERGED_BY)
    return Converged.of(
        [own_image(scene, environment, made, picture, seed)[1] for seed in effort.run_seeds]
    )


def turned_away(scene: Scene, environment: EnvironmentMap, effort: Effort) -> float:
    """Share of the picture's light that comes from where a smooth normal faces away from the eye.

    There this renderer tilts the normal until it just faces the eye; others shade as if it did, or
    show black.
    """
    view = make_view(scene, effort.width, effort.height, AWAY_SUBPIXELS)
    table = make_sampler(CONVERGED_BY).prepare(environment, PER_SUBPIXEL, np.random.default_rng(0))
    assert isinstance(table, LightDistribution)
    points, _ = shade_distribution(view, environment, table, WARM_UP_SEED)
    light = points.sum(axis=1, dtype=np.float64)
    cosine = np.einsum("ij,ij->i", view.normal, view.toward_eye)
    return float(light[cosine < JUST_FACING].sum() / max(light.sum(), np.finfo(np.float64).tiny))
