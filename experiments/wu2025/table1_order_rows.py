"""Rows of `table1-order`: images at equal time, and at equal rays, on one scene under one map."""

from collections.abc import Sequence
from pathlib import Path

from experiments.run.bench import Timing
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.experiment import Group, Job, Row
from experiments.run.judging import scores, truth_in
from experiments.run.kept_images import reference_path
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, Shot, light_count, shoot
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_choice import single_sampler
from experiments.run.scale import find_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.shared_results import take_reference
from experiments.run.study_run import study_environments
from experiments.run.timed import alone_on_the_machine, time_at_budget, timed_rounds
from experiments.wu2025.published import TABLE1, seconds_at
from metrics.truth import Truth

NAME = "table1-order"
SECONDS = 0.9
"""Of an image of the paper's size."""
FULL, WITHOUT, FHIS, MEASURE = "ours", "ours-no-upsampling", "fhis", "median-cut"
SHARED, PLAIN = f"{WITHOUT}, lights of {FULL}", f"{FHIS}[light=point]"
METHODS = (*TABLE1.values, PLAIN)
TIME, RAYS = "time", "rays"
METRICS = ("rmse", "flip")


def groups(request: RunRequest) -> list[Group]:
    """A group per scene and map."""
    scale = find_scale(request.scale)
    if request.reference_noise:
        scale = scale.with_noise(request.reference_noise)
    sources = study_environments(request, [], scale.map_height)
    budget = request.budget(seconds_at(scale, SECONDS))
    folder = run_folder(request.output, NAME, request.scale)
    return [
        _group(Case(name, source, scale, file), budget, folder)
        for name, file in map(name_and_file, choose_scenes(request.scenes or ["vase"]))
        for source in sources
    ]


def _group(case: Case, budget: Budget, folder: Path) -> Group:
    timed = {label: Measurement(case, single_sampler(label), budget, 0) for label in METHODS}
    columns = {"scene": case.scene, "environment": case.environment.name, "budget": str(budget)}
    depends = {
        "reference": case.reference_key,
        "measurements": [one.key for one in timed.values()],
    }
    where = {
        f"{label} ({alike})": (alike, label)
        for alike in (TIME, RAYS)
        for label in (*METHODS, SHARED)
    }
    jobs = {
        name: Job({**columns, "alike": alike, "sampler": label}, depends)
        for name, (alike, label) in where.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        if not reference_path(folder, case).is_file():
            take_reference(case, folder, folder.parent)
        truth = truth_in(folder, case)
        with alone_on_the_machine():
            shots = _shots(timed)
        return {name: _row(*shots[where[name]], truth) for name in names}

    return Group(str(case), jobs, measure)


def _shots(timed: dict[str, Measurement]) -> dict[tuple[str, str], tuple[Shot, Timing]]:
    """Every method's image and its time, at equal time and at the rays of median cut there."""
    case = timed[FULL].case
    scene = CaseScene.of(case)
    shots: dict[tuple[str, str], tuple[Shot, Timing]] = {}
    for one, result in time_at_budget(scene, list(timed.values())).items():
        if isinstance(result, Exception):
            raise result
        shots[TIME, one.sampler.label] = result.shot, result.timing
    rays = Budget(shots[TIME, MEASURE][0].rays, RAYS)
    for label in METHODS:
        _, shot = shoot(Measurement(case, timed[label].sampler, rays, 0))
        shots[RAYS, label] = shot, Timing.of([shot.rendering.seconds])
    for alike in (TIME, RAYS):
        shared = {timed[WITHOUT]: scene.shoot(timed[WITHOUT], shots[alike, FULL][0].count)}
        shots[alike, SHARED] = shared[timed[WITHOUT]], timed_rounds(scene, shared)[timed[WITHOUT]]
    return shots


def _row(shot: Shot, timing: Timing, truth: Truth) -> Row:
    judged = scores(shot.rendering.image, truth, METRICS)
    return {
        "count": shot.count,
        "lights": light_count(shot.lighting),
        "rays": shot.rays,
        **timing.columns("seconds_render"),
        **{key: value for found in judged.values() for key, value in found.items()},
    }
