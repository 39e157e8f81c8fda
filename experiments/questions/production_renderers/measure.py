"""A case measured: every renderer's images at each number of samples, against its own mean.

Nothing else that is timed runs on the machine meanwhile.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.maps.sources import EnvironmentSource
from experiments.questions.production_renderers.contenders import Contender
from experiments.questions.production_renderers.shots import (
    Agreement,
    Converged,
    Effort,
    Image,
    Shots,
    own_converged,
    own_label,
    own_shots,
    their_shots,
    turned_away,
)
from experiments.questions.production_renderers.written_scene import with_materials
from experiments.report.sheets import keep_tile, tile_path
from experiments.run.bench import Timing
from experiments.run.experiment import Row
from experiments.run.judging import scores
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.study import NOTE
from experiments.run.timed import alone_on_the_machine
from metrics.errors import corrected_square, exposure_scale
from metrics.registry import ranked_metrics
from metrics.truth import Truth
from renderer.scene import Scene
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import EnvironmentMap, EnvlightError

SHOWN_SAMPLES = 16
CONVERGED = "converged"


@dataclass(frozen=True)
class RenderingCase:
    """A scene, given some materials, under a map. file : a scene's own, or empty"""

    scene: str
    file: str
    materials: str
    environment: EnvironmentSource
    effort: Effort


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
        ours = own_converged(scene, environment, case.effort)
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
            yield label, own_shots(scene, environment, effort, sampler, ours)
    for renderer in renderers:
        if renderer.label not in labels:
            continue
        try:
            yield renderer.label, their_shots(scene, environment, effort, renderer)
        except EnvlightError as error:
            yield renderer.label, error


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
