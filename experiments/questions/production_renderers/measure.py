"""A case measured: every renderer's images at each number of samples, against its own mean.

A renderer has a process of its own, which renders in this order: two images to be thrown away; the
images that are timed and judged; and the independent runs whose mean is its converged image.
Nothing else that is timed runs on the machine meanwhile.
"""

import json
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.maps.sources import EnvironmentSource
from experiments.questions.production_renderers.contenders import (
    PER_SUBPIXEL,
    Contender,
    own_image,
)
from experiments.questions.production_renderers.converged import Agreement, Converged
from experiments.questions.production_renderers.process import Render, render_scene, require
from experiments.questions.production_renderers.written_scene import Picture, with_materials
from experiments.report.sheets import keep_tile, tile_path
from experiments.run.bench import Timing
from experiments.run.experiment import Row
from experiments.run.judging import scores
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.study_run import NOTE
from experiments.run.timed import alone_on_the_machine
from metrics.errors import corrected_square, exposure_scale
from metrics.registry import ranked_metrics
from metrics.truth import Truth
from renderer.monte_carlo import shade_distribution
from renderer.packet.surfaces import LEAST_COSINE
from renderer.scene import Scene
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import EnvironmentMap, EnvlightError, make_sampler
from samplers.threads import thread_count

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
SHOWN_SAMPLES = 16
CONVERGED = "converged"


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

    @property
    def picture(self) -> Picture:
        return Picture(self.width, self.height)

    @property
    def judged(self) -> list[tuple[int, int]]:
        """Samples and seed of each image."""
        pairs = [samples for samples, images in self.samples for _ in range(images)]
        return [(samples, WARM_UP_SEED + 1 + k) for k, samples in enumerate(pairs)]

    @property
    def run_seeds(self) -> range:
        return range(FIRST_RUN_SEED, FIRST_RUN_SEED + self.runs)


@dataclass(frozen=True)
class RenderingCase:
    """A scene, given some materials, under a map. file : a scene's own, or empty"""

    scene: str
    file: str
    materials: str
    environment: EnvironmentSource
    effort: Effort


@dataclass(frozen=True, eq=False)
class Shots:
    """images : with samples and seconds; converged : the mean; facts : version and settings
    mean_samples : what was really taken, where the renderer says so
    """

    images: Sequence[tuple[int, float, Image]]
    converged: Converged
    facts: Mapping[str, Any]
    mean_samples: Mapping[int, float]


def measure_case(
    case: RenderingCase,
    renderers: Sequence[Contender],
    samplers: Sequence[SamplerSpec],
    wanted: Mapping[str, tuple[str, int]],
    folder: Path,
) -> dict[str, Row]:
    """The rows that are wanted, each named with the label of a renderer and samples a pixel.

    folder : of the run, where pictures are kept
    """
    scene = with_materials(load_scene(case.file or case.scene), case.materials)
    environment = case.environment.load()
    labels = {label for label, _ in wanted.values()}
    mask = _seen(scene, case.effort)
    rows: dict[str, Row] = {}
    with alone_on_the_machine():
        ours = _own_converged(scene, environment, case.effort)
        away = turned_away(scene, environment, case.effort)
        for label, shots in _shots(
            scene, environment, case.effort, renderers, samplers, labels, ours
        ):
            names = {name: samples for name, (own, samples) in wanted.items() if own == label}
            if isinstance(shots, EnvlightError):
                rows |= {name: {NOTE: str(shots)} for name in names}
                continue
            found = _judged(shots, ours, mask)
            rows |= {
                name: {**found[samples], "turned_away": away} for name, samples in names.items()
            }
            _keep_pictures(folder, case, label, shots, mask)
    return rows


def turned_away(scene: Scene, environment: EnvironmentMap, effort: Effort) -> float:
    """Share of the picture's light that comes from where a smooth normal faces away from the eye.

    There this renderer tilts the normal until it just faces the eye; others shade as if it did, or
    show black.
    """
    view = make_view(scene, effort.width, effort.height, AWAY_SUBPIXELS)
    table = make_sampler(CONVERGED_BY).prepare(environment, PER_SUBPIXEL, np.random.default_rng(0))
    points, _ = shade_distribution(view, environment, table, WARM_UP_SEED)
    light = points.sum(axis=1, dtype=np.float64)
    cosine = np.einsum("ij,ij->i", view.normal, view.toward_eye)
    return float(light[cosine < JUST_FACING].sum() / max(light.sum(), np.finfo(np.float64).tiny))


def _seen(scene: Scene, effort: Effort) -> NDArray[np.bool_]:
    """Pixels that show a surface, (height, width)."""
    return make_view(scene, effort.width, effort.height, 4).coverage > 0.0


def _shots(
    scene: Scene,
    environment: EnvironmentMap,
    effort: Effort,
    renderers: Sequence[Contender],
    samplers: Sequence[SamplerSpec],
    labels: set[str],
    ours: Converged,
) -> Iterator[tuple[str, Shots | EnvlightError]]:
    """What each renderer made, or why it made nothing."""
    for sampler in samplers:
        label = own_label(sampler)
        if label in labels:
            yield label, _own_shots(scene, environment, effort, sampler, ours)
    for renderer in renderers:
        if renderer.label not in labels:
            continue
        try:
            yield renderer.label, _their_shots(scene, environment, effort, renderer)
        except EnvlightError as error:
            yield renderer.label, error


def own_label(sampler: SamplerSpec) -> str:
    return f"{OWN} {sampler.label}"


def _their_shots(
    scene: Scene, environment: EnvironmentMap, effort: Effort, renderer: Contender
) -> Shots:
    version = require(renderer.package, renderer.label)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        renderer.write(scene, environment, effort.picture, folder)
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


def _own_shots(
    scene: Scene,
    environment: EnvironmentMap,
    effort: Effort,
    sampler: SamplerSpec,
    ours: Converged,
) -> Shots:
    made = sampler.sampler
    images = []
    for samples in WARM_UP:
        _own(scene, environment, made, replace(effort.picture, samples=samples), WARM_UP_SEED)
    for samples, seed in effort.judged:
        image, seconds = _own(
            scene, environment, made, replace(effort.picture, samples=samples), seed
        )
        images.append((samples, seconds, image))
    facts = {"renderer": OWN, "sampler": sampler.label, "samples at a sub-pixel": PER_SUBPIXEL}
    return Shots(images, ours, facts, {})


def _own(
    scene: Scene, environment: EnvironmentMap, made: Any, picture: Picture, seed: int
) -> tuple[Image, float]:
    lighting = made.prepare(environment, PER_SUBPIXEL, np.random.default_rng(seed))
    return own_image(scene, environment, lighting, picture, seed)


def _own_converged(scene: Scene, environment: EnvironmentMap, effort: Effort) -> Converged:
    picture = replace(effort.picture, samples=CONVERGED_SUBPIXELS)
    made = make_sampler(CONVERGED_BY)
    return Converged.of(
        [_own(scene, environment, made, picture, seed)[0] for seed in effort.run_seeds]
    )


def _judged(shots: Shots, ours: Converged, mask: NDArray[np.bool_]) -> dict[int, Row]:
    """What stands in the rows, by samples a pixel."""
    own = shots.converged
    truth = truth_of(own, mask)
    names = [metric.name for metric in ranked_metrics()]
    common = {
        "exposure": truth.exposure,
        "mean": own.mean,
        "mean_error": own.mean_error,
        "runs": own.runs,
        **asdict(Agreement.of(own, ours)),
        "version": str(shots.facts.get("version", "")),
        "settings": json.dumps(shots.facts, ensure_ascii=False),
    }
    rows: dict[int, Row] = {}
    for samples in dict.fromkeys(samples for samples, _, _ in shots.images):
        images = [image for count, _, image in shots.images if count == samples]
        timing = Timing.of([seconds for count, seconds, _ in shots.images if count == samples])
        # Unbiased, and so below 0 at times where the noise of the converged mean is as large.
        squares = [
            corrected_square(truth.exposed(image), truth.image, truth.noise_floor)
            for image in images
        ]
        square = float(np.mean(squares))
        found = scores(images[0], truth, names)
        rows[samples] = {
            **timing.columns(),
            **{key: value for name in names for key, value in found[name].items()},
            "squared_error": square,
            "efficiency": 1.0 / (square * timing.median) if square > 0.0 else math.nan,
            "mean_samples": shots.mean_samples.get(samples, float(samples)),
            **common,
        }
    return rows


def truth_of(own: Converged, mask: NDArray[np.bool_]) -> Truth:
    """A converged mean as metrics take it: exposed, with its halves and its noise."""
    exposure = exposure_scale(own.image, mask)

    def exposed(image: Image) -> Image:
        return (image * np.float64(exposure)).astype(np.float32)

    first, second = own.halves
    return Truth(
        exposed(own.image), exposure, own.floor * exposure, (exposed(first), exposed(second))
    )


def _keep_pictures(
    folder: Path, case: RenderingCase, label: str, shots: Shots, mask: NDArray[np.bool_]
) -> None:
    truth = truth_of(shots.converged, mask)
    shown = {CONVERGED: shots.converged.image}
    shown |= {str(n): image for n, _, image in reversed(shots.images) if n == SHOWN_SAMPLES}
    place = (folder, case.scene, case.materials, case.environment.name, label)
    for name, image in shown.items():
        keep_tile(picture_path(*place, name), truth.exposed(image))


def picture_path(
    folder: Path, scene: str, materials: str, environment: str, label: str, name: str
) -> Path:
    """Where the picture of a renderer's image is kept."""
    return tile_path(folder, scene, materials, environment, label.replace(" ", "-"), name)
