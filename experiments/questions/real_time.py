"""How many lights a frame can have in real time, and what they cost in error.

Wu 2025 promises real time in a game engine (4.4), on a GPU. Here it is asked of this project's own
evaluator, on the processor that the record names: lights are prepared once, frames are then
rendered one after the other, one sample a pixel at 640×480, with every light's shadow rays. "Ours"
renders its indirect lights small and upsamples them; the same without that is beside it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from experiments.report.parts import Part, Table, Text, counted
from experiments.report.style import label_of
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.case import Case, choose_scenes, name_and_file
from experiments.run.experiment import Group, Row, RunRequest, Study, experiment
from experiments.run.judging import truth_in
from experiments.run.loaded_run import Run
from experiments.run.rendering import case_view
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import find_scale, of_scale
from experiments.run.study import study_environments
from experiments.run.timed import alone_on_the_machine
from metrics.registry import leading_metric, ranked_metrics
from renderer.render import render
from samplers.threads import thread_count

NAME = "real-time"
SAMPLERS = ["median-cut", "ours-no-upsampling", "ours"]
SCENES = ["vase"]
MAPS = ["noon-desert"]
SIZES = {"quick": (320, 240), "standard": (640, 480), "paper": (640, 480)}
HEIGHTS = {"quick": 256, "standard": 512, "paper": 1024}
COUNTS = (4, 8, 16, 32, 64, 128)
ROUNDS = {"quick": 5, "standard": 11, "paper": 21}
NOISE, MOST_SAMPLES = 0.01, 4096
"""Of the reference: its noise floor over the foreground's mean, and where it stops in any case."""


@experiment(NAME)
def real_time() -> Study:
    """Frames a second of this evaluator by number of lights, with and without upsampling."""
    return Study(
        title="Lights a frame in real time",
        sections=(frames,),
        findings=findings,
        groups=groups,
        sources=(__name__,),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per scene and map: all samplers with all numbers of lights, in turn."""
    specs = choose_samplers(request.samplers or SAMPLERS)
    (width, height), rounds = of_scale(SIZES, request.scale), of_scale(ROUNDS, request.scale)
    scale = replace(
        find_scale(request.scale), width=width, height=height, subpixels=1, noise_target=NOISE,
        max_samples=MOST_SAMPLES, map_height=of_scale(HEIGHTS, request.scale),
    )  # fmt: skip
    sources = study_environments(request, MAPS, scale.map_height)
    chosen = map(name_and_file, choose_scenes(request.scenes or SCENES))
    folder = request.folder
    return [
        _group(Case(name, source, scale, file), specs, rounds, folder)
        for name, file in chosen
        for source in sources
    ]


def _group(case: Case, specs: Sequence[SamplerSpec], rounds: int, folder: Path) -> Group:
    own = {"scene": case.scene, "environment": case.environment.name}
    depends = {"case": case.reference_identity, "rounds": rounds, "threads": thread_count()}
    asked = (
        ({"sampler": spec.label, "count": count}, {"sampler": spec.identity}, (spec, count))
        for spec in specs
        for count in COUNTS
    )

    def measure(work: list[tuple[SamplerSpec, int]]) -> Iterator[Row]:
        with alone_on_the_machine():
            yield from _measured(case, work, rounds, folder)

    return Group(str(case), asked, measure, own, depends)


def _measured(
    case: Case, work: list[tuple[SamplerSpec, int]], rounds: int, folder: Path
) -> Iterator[Row]:
    environment, view, truth = case.environment.load(), case_view(case), truth_in(folder, case)
    tasks = {}
    for spec, count in work:
        lights = spec.sampler.prepare(environment, count, np.random.default_rng(0))
        tasks[f"{spec.label} {count}"] = partial(render, view, lights, environment)
    timings = interleaved(tasks, rounds)
    for name, task in tasks.items():
        frame = task()
        image = truth.exposed(frame.image)
        row: Row = {"width": view.width, "height": view.height, "threads": thread_count()}
        row |= {"rays": frame.rays.traced, **timings[name].columns("seconds_frame")}
        for metric in ranked_metrics():
            row |= metric.columns(image, truth)
        yield row


def findings(run: Run) -> list[str]:
    """Frames a second and error of each sampler, with the fewest and with the most lights."""
    rows, metric, told = run.rows.sort_values("count", kind="stable"), leading_metric(), []
    for (scene, name), case in rows.groupby(["scene", "environment"], sort=False):
        first, each = case.iloc[0], []
        for sampler, lines in case.groupby("sampler", sort=False):
            few, many = lines.iloc[0], lines.iloc[-1]
            each.append(
                f"{label_of(str(sampler))} {1.0 / few['seconds_frame']:.1f} to "
                f"{1.0 / many['seconds_frame']:.1f} frames a second, {metric.label} "
                f"{few[metric.name]:.{metric.digits}f} to {many[metric.name]:.{metric.digits}f}"
            )
        told.append(
            f"{scene} under {name}, {first['width']}×{first['height']}, one sample a pixel, "
            f"{counted(first['threads'], 'thread')} of a processor, {case['count'].min()} to "
            f"{case['count'].max()} lights: {'; '.join(each)}."
        )
    return told


def frames(run: Run) -> Iterator[Part]:
    """What was found, and the table."""
    yield from map(Text, findings(run))
    rows = run.rows.assign(frames=1.0 / run.rows["seconds_frame"])
    formats = {
        "scene": "s", "environment": "s", "sampler": "s", "count": "d", "frames": ".1f",
        "rays": ",d", **{metric.name: f".{metric.digits}f" for metric in ranked_metrics()},
    }  # fmt: skip
    headings = {"count": "lights", "frames": "frames/s"} | {
        metric.name: metric.label for metric in ranked_metrics()
    }
    yield Table("real_time", rows, formats, headings)
    size = f"{rows['width'].iloc[0]}×{rows['height'].iloc[0]}"
    yield Text(
        f"Frames of {size}, one sample a pixel, on {counted(rows['threads'].iloc[0], 'thread')} of "
        "the processor that the record names; lights and the view are made once and not counted. "
        f"{leading_metric().label} is that of the frame as it is, aliased edges included in the "
        "reference."
    )
    yield Text(noise_sentence(run.rows))
