"""How noisy are production renderers under an environment map, and do they agree with this one?

Mitsuba 3, Cycles and LuxCore render the test scenes with materials that all of them have, beside
three samplers of this project at the same number of rays. All show direct light alone, through a
box filter, without denoiser, clamp, adaptive sampling, light tree or guiding; otherwise each is set
as it does best. Noise is told against a renderer's own converged mean, so that no convention
counts as noise, and that mean is compared with this project's: the strictest check of its
evaluator. A renderer runs in a process of its own, and one that is missing or fails costs its own
rows alone.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

from experiments.maps.classes import named_class
from experiments.maps.sources import EnvironmentSource
from experiments.questions.production_renderers.agreement_tables import (
    agreeing,
    agreement,
    agreement_sentences,
)
from experiments.questions.production_renderers.contenders import Contender, contenders
from experiments.questions.production_renderers.measure import RenderingCase, measure_case
from experiments.questions.production_renderers.noise_tables import (
    efficiency_sentences,
    measured,
    noise,
    slower_variants,
    without_llvm,
)
from experiments.questions.production_renderers.process import installed, renderers_python
from experiments.questions.production_renderers.report_ends import limits, pictures, settings
from experiments.questions.production_renderers.shots import Effort, own_label
from experiments.questions.production_renderers.to_mitsuba import SCALAR
from experiments.questions.production_renderers.written_scene import MATERIALS
from experiments.run.case import Case
from experiments.run.experiment import TEST_SCENES, Group, Job, Row, Study, experiment
from experiments.run.identity import source_digest
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest, run_folder
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import find_scale, of_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.study import study_environments
from metrics.registry import ranked_metrics

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
    """Who is how efficient, who was not at its best, and whether means agree."""
    rows = measured(run)
    return [
        *efficiency_sentences(rows),
        *slower_variants(rows),
        *agreement_sentences(agreeing(rows)),
    ]


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
    python = renderers_python()
    versions = installed(python, tuple(dict.fromkeys(one.package for one in renderers)))
    depends: dict[str, Row] = {own_label(one): {"sampler": one.identity} for one in samplers}
    depends |= {one.label: _settings(one, versions) for one in renderers}
    jobs = {
        f"{label}, {samples}": Job(
            {
                "scene": case.scene,
                "materials": case.materials,
                "environment": case.environment.name,
                "renderer": label,
                "samples": samples,
                "width": effort.width,
                "height": effort.height,
            },
            {**shared, **depends[label]},
        )
        for label in depends
        for samples, _ in effort.samples
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        wanted = {
            name: (jobs[name].columns["renderer"], jobs[name].columns["samples"]) for name in names
        }
        folder = run_folder(request.output, request.experiment, request.scale)
        return measure_case(case, renderers, samplers, wanted, folder)

    return Group(f"{case.scene}, {case.materials}, under {case.environment.name}", jobs, measure)


def _settings(renderer: Contender, versions: Mapping[str, str]) -> Row:
    """What of a renderer determines its rows; its translator's source counts with the study's."""
    return {
        "renderer": renderer.label,
        "version": versions.get(renderer.package, "none"),
        "variant": renderer.variant,
    }
