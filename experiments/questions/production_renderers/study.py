"""How noisy are production renderers under an environment map, and do they agree with this one?

Mitsuba 3, Cycles and LuxCore render the test scenes with materials that all of them have, beside
three samplers of this project at the same number of rays. All show direct light alone, through a
box filter, without denoiser, clamp, adaptive sampling, light tree or guiding; otherwise each is set
as it does best. Noise is told against a renderer's own converged mean, so that no convention
counts as noise, and that mean is compared with this project's: the strictest check of its
evaluator. A renderer runs in a process of its own, and one that is missing or fails costs its own
rows alone.
"""

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.maps.classes import named_class
from experiments.maps.sources import EnvironmentSource
from experiments.questions.production_renderers.shots import (
    OWN,
    Agreement,
    Contender,
    Converged,
    Effort,
    Image,
    Shots,
    contenders,
    own_converged,
    own_shots,
    their_shots,
    turned_away,
)
from experiments.questions.production_renderers.tables import (
    BASE,
    agreement,
    efficiency_sentences,
    measured,
    noise,
    reported_settings,
    slower_variants,
    without_llvm,
)
from experiments.questions.production_renderers.to_mitsuba import SCALAR
from experiments.questions.production_renderers.written_scene import (
    MATERIALS,
    installed,
    renderers_python,
    with_materials,
)
from experiments.report.case_figures import keep_tile, kept_tile, sheet, tile_path
from experiments.report.parts import Heading, Items, Part, Text
from experiments.report.style import label_of
from experiments.run.bench import Timing
from experiments.run.case import Case, choose_scenes, name_and_file
from experiments.run.experiment import TEST_SCENES, Group, Row, RunRequest, Study, experiment
from experiments.run.identity import source_digest
from experiments.run.judging import scores
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import find_scale, of_scale
from experiments.run.study import NOTE, study_environments
from experiments.run.timed import alone_on_the_machine
from metrics.errors import corrected_square, exposure_scale
from metrics.registry import ranked_metrics
from metrics.truth import Truth
from renderer.scene import Scene
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import EnvironmentMap, EnvlightError

MAPS = ["noon-desert", "gallery-skylight"]
MOST_MAPS = 8
"""Of a suite or folder without --maps: one of every kind of map."""
OURS = ["mis", "mis-compensated", "ris-stratified"]
SAMPLES = ((1, 5), (4, 3), (16, 2), (64, 1))
EFFORTS = {
    "quick": Effort(160, 120, ((1, 3), (4, 2), (16, 1), (64, 1)), 8, 16),
    "medium": Effort(320, 240, SAMPLES, 8, 64),
    "standard": Effort(640, 480, SAMPLES, 8, 128),
}
PROGRAMS = "experiments.questions.production_renderers.programs"
SHOWN_SAMPLES = 16
CONVERGED = "converged"
Shoot = Callable[[Scene, EnvironmentMap, Effort, Converged], Shots]
"""What somebody makes of a case, given this project's converged mean."""


@dataclass(frozen=True)
class RenderingCase:
    """A scene, given some materials, under a map. file : a scene's own, or empty"""

    scene: str
    file: str
    materials: str
    environment: EnvironmentSource
    effort: Effort


@experiment("production-renderers")
def production_renderers() -> Study:
    """Noise, speed and agreement of Mitsuba 3, Cycles and LuxCore on the same scenes."""
    return Study(
        title="Production renderers on the same scenes",
        sections=(noise, agreement, pictures, settings, limits),
        groups=groups,
        findings=findings,
        sources=(
            __name__,
            *(f"{PROGRAMS}.{name}" for name in ("session", *{c.program for c in contenders()})),
        ),
    )


def findings(run: Run) -> list[str]:
    """Who is how efficient, and who was not at its best."""
    rows = measured(run)
    return [*efficiency_sentences(rows), *slower_variants(rows)]


def groups(request: RunRequest) -> list[Group]:
    """A group per scene, materials and map; a renderer that is not at its best is told at once."""
    effort = of_scale(EFFORTS, request.scale)
    height = find_scale(request.scale).map_height
    sources = study_environments(request, MAPS, height)
    if not request.maps:
        sources = of_every_kind(sources)
    samplers = choose_samplers(request.samplers or OURS)
    chosen = [name_and_file(scene) for scene in choose_scenes(request.scenes or list(TEST_SCENES))]
    renderers = contenders()
    slower = [one.label for one in renderers if one.variant == SCALAR]
    if slower:
        print(f"envlight: {without_llvm(slower)}", file=sys.stderr)
    return [
        _group(request, RenderingCase(name, file, materials, source, effort), renderers, samplers)
        for materials in MATERIALS
        for source in sources
        for name, file in chosen
    ]


def of_every_kind(sources: Sequence[EnvironmentSource]) -> list[EnvironmentSource]:
    """The first map of every kind whose maps are known by name, or the first ones of all."""
    if len(sources) <= MOST_MAPS:
        return list(sources)
    first: dict[str, EnvironmentSource] = {}
    for source in sources:
        kind = named_class(source.name)
        if kind:
            first.setdefault(kind, source)
    found = list(first.values()) or list(sources)
    return found[:MOST_MAPS]


def _group(
    request: RunRequest,
    case: RenderingCase,
    renderers: Sequence[Contender],
    samplers: Sequence[SamplerSpec],
) -> Group:
    effort = case.effort
    scale = replace(find_scale(request.scale), width=effort.width, height=effort.height)
    shared: Row = {
        "case": Case(case.scene, case.environment, scale, case.file).identity,
        "effort": asdict(effort),
        "metrics": {metric.name: source_digest(metric.module) for metric in ranked_metrics()},
    }
    taking_part = participants(samplers, renderers)
    columns = {
        "scene": case.scene, "materials": case.materials, "environment": case.environment.name,
    }  # fmt: skip
    size = {"width": effort.width, "height": effort.height}
    asked = (
        ({"renderer": label, "samples": samples, **size}, identity, (label, samples))
        for label, (identity, _) in taking_part.items()
        for samples, _ in effort.samples
    )
    folder = request.folder

    def measure(wanted: list[tuple[str, int]]) -> list[Row]:
        shoots = {label: shoot for label, (_, shoot) in taking_part.items()}
        return measure_case(case, shoots, wanted, folder)

    label = f"{case.scene}, {case.materials}, under {case.environment.name}"
    return Group(label, asked, measure, columns, shared)


def participants(
    samplers: Sequence[SamplerSpec], renderers: Sequence[Contender]
) -> dict[str, tuple[Row, Shoot]]:
    """Who takes part, by label: what determines its rows, and what it makes of a case.

    The source of a renderer's translator counts with the study's.
    """
    packages = tuple(dict.fromkeys(one.package for one in renderers))
    versions = installed(renderers_python(), packages)
    found: dict[str, tuple[Row, Shoot]] = {
        f"{OWN} {one.label}": ({"sampler": one.identity}, partial(own_shots, one))
        for one in samplers
    }
    for one in renderers:
        version = versions.get(one.package, "none")
        identity = {"renderer": one.label, "version": version, "variant": one.variant}
        found[one.label] = identity, partial(their_shots, one)
    return found


def settings(run: Run) -> Iterator[Part]:
    """Versions and settings, as the renderers' programs report them."""
    rows = measured(run)
    if rows.empty:
        return
    yield Heading("Versions and settings")
    found = []
    for renderer, answers in reported_settings(rows).items():
        for facts in answers:
            told = "; ".join(f"{key} {value}" for key, value in facts.items() if key != "renderer")
            found.append(f"{label_of(renderer)}: {told}.")
    yield Items(tuple(found))


def pictures(run: Run) -> Iterator[Part]:
    """Every scene under the first map: the converged mean, and each renderer's few samples."""
    rows = run.rows
    environment = str(rows["environment"].iloc[0])
    labels = [str(name) for name in dict.fromkeys(rows["renderer"])]
    scenes = [str(name) for name in dict.fromkeys(rows["scene"])]
    yield Heading("Images")
    for materials in dict.fromkeys(rows["materials"]):
        tiles = []
        for scene in scenes:
            shown = [(BASE, CONVERGED), *((label, str(SHOWN_SAMPLES)) for label in labels)]
            for label, name in shown:
                place = (scene, str(materials), environment, label, name)
                title = "converged" if name == CONVERGED else label_of(label)
                tiles.append((f"{scene}, {title}", kept_tile(picture_path(run.folder, *place))))
        caption = f"{materials} under {environment}, {SHOWN_SAMPLES} samples a pixel."
        yield sheet(f"images_{materials}.webp", caption, tiles, len(labels) + 1)


def limits(run: Run) -> Iterator[Part]:
    """What each renderer does with the map, and what is not compared."""
    yield Heading("What each does with a map")
    yield Items(
        (
            "Mitsuba 3 draws from a table of luminance × sin θ at the map's resolution, by a "
            "hierarchical warp; its compensation takes the mean off that table.",
            "Cycles draws from a table of the mean of red, green and blue × sin θ, of at least "
            "4096×2048 cells.",
            "LuxCore draws from a table of luminance without sin θ, and so too often near the "
            "poles; the density divides by sin θ, which keeps it unbiased. Where a path may have "
            "one vertex only it draws from that table alone, and is far noisier; here paths have "
            "two, of which the second ends them before any other surface shines.",
            f"{OWN} draws from a table of luminance × solid angle; `mis-compensated` takes off "
            "what BRDF sampling covers; `ris-stratified` traces the best of several candidates.",
        )
    )
    yield Heading("What is not compared")
    yield Text(
        "Only direct light under a map, with two kinds of materials, on the processor. These "
        "programs are made for more: light that bounces, textures, many kinds of lights, graphics "
        "processors, denoisers; what they take for that generality is in their times. Of light "
        "under a map alone nothing here says which of them is the better renderer."
    )


def measure_case(
    case: RenderingCase,
    taking_part: Mapping[str, Shoot],
    wanted: Sequence[tuple[str, int]],
    folder: Path,
) -> list[Row]:
    """The rows that are wanted, each by the label of who takes part and samples a pixel.

    folder : of the run, where pictures are kept
    """
    effort, environment = case.effort, case.environment.load()
    scene = with_materials(load_scene(case.file or case.scene), case.materials)
    mask = make_view(scene, effort.width, effort.height, 4).coverage > 0.0
    rows: dict[tuple[str, int], Row] = {}
    with alone_on_the_machine():
        ours = own_converged(scene, environment, effort)
        away = turned_away(scene, environment, effort)
        for label in dict.fromkeys(label for label, _ in wanted):
            try:
                shots = taking_part[label](scene, environment, effort, ours)
            except EnvlightError as error:
                rows |= {one: {NOTE: str(error)} for one in wanted if one[0] == label}
                continue
            for samples, row in _judged(shots, ours, mask).items():
                rows[label, samples] = {**row, "turned_away": away}
            _keep_pictures(folder, case, label, shots, mask)
    return [rows[one] for one in wanted]


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
