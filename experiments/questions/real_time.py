"""How many lights a frame can have in real time, and what they cost in error.

Wu 2025 promises real time in a game engine (4.4), on a GPU. Here it is asked of this project's own
evaluator, on the processor that the record names: lights are prepared once, frames are then
rendered one after the other, one sample a pixel at 640×480, with every light's shadow rays. "Ours"
renders its indirect lights small and upsamples them; the same without that is beside it.
"""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from experiments.maps.sources import EnvironmentSource
from experiments.report.parts import Part, Table, Text
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.case import choose_scenes, environment_identity, name_and_file
from experiments.run.experiment import Group, Job, Row, RunRequest, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from experiments.run.timed import alone_on_the_machine
from metrics.errors import exposure_scale
from metrics.registry import leading_metric, ranked_metrics
from metrics.truth import Truth
from renderer.reference import render_reference
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers.threads import thread_count

SAMPLERS = ["median-cut", "ours-no-upsampling", "ours"]
SCENES = ["vase"]
MAPS = ["noon-desert"]
SIZES = {"quick": (320, 240), "standard": (640, 480), "paper": (640, 480)}
HEIGHTS = {"quick": 256, "standard": 512, "paper": 1024}
COUNTS = (4, 8, 16, 32, 64, 128)
ROUNDS = {"quick": 5, "standard": 11, "paper": 21}
NOISE, MOST_SAMPLES = 0.01, 4096
"""Of the reference: its noise floor over the foreground's mean, and where it stops in any case."""


@experiment("real-time")
def real_time() -> Study:
    """Frames a second of this evaluator by number of lights, with and without upsampling."""
    return Study(
        title="Lights a frame in real time",
        sections=(frames,),
        groups=groups,
        sources=(__name__,),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per scene and map: all samplers with all numbers of lights, in turn."""
    specs = choose_samplers(request.samplers or SAMPLERS)
    size, rounds = of_scale(SIZES, request.scale), of_scale(ROUNDS, request.scale)
    sources = study_environments(request, MAPS, of_scale(HEIGHTS, request.scale))
    chosen = choose_scenes(request.scenes or SCENES)
    return [_group(scene, one, specs, size, rounds) for scene in chosen for one in sources]


def _group(
    scene: str,
    source: EnvironmentSource,
    specs: Sequence[SamplerSpec],
    size: tuple[int, int],
    rounds: int,
) -> Group:
    depends = {
        "map": environment_identity(source), "scene": load_scene(scene).digest, "size": size,
        "rounds": rounds, "threads": thread_count(), "noise": NOISE,
    }  # fmt: skip
    work = {f"{spec.label} {count}": (spec, count) for spec in specs for count in COUNTS}
    jobs = {
        name: Job(
            {
                "scene": name_and_file(scene)[0],
                "environment": source.name,
                "sampler": spec.label,
                "count": count,
            },
            {**depends, "sampler": spec.identity},
        )
        for name, (spec, count) in work.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        chosen = {name: work[name] for name in names}
        with alone_on_the_machine():
            return _measure(scene, source, chosen, size, rounds)

    return Group(f"{name_and_file(scene)[0]} · {source.name}", jobs, measure)


def _measure(
    scene: str,
    source: EnvironmentSource,
    work: dict[str, tuple[SamplerSpec, int]],
    size: tuple[int, int],
    rounds: int,
) -> dict[str, Row]:
    environment, view = source.load(), make_view(load_scene(scene), *size, 1)
    reference = render_reference(view, environment, NOISE, MOST_SAMPLES)
    exposure = exposure_scale(reference.image, view.coverage > 0.0)
    image = (reference.image * np.float64(exposure)).astype(np.float32)
    truth = Truth(image, exposure, reference.noise_floor * exposure)
    tasks = {
        name: partial(
            render,
            view,
            spec.sampler.prepare(environment, count, np.random.default_rng(0)),
            environment,
        )
        for name, (spec, count) in work.items()
    }
    timings, result = interleaved(tasks, rounds), {}
    for name, task in tasks.items():
        rendering = task()
        row: Row = {"width": size[0], "height": size[1], "threads": thread_count()}
        row |= {"rays": rendering.rays.traced, **timings[name].columns("seconds_frame")}
        for metric in ranked_metrics():
            row |= metric.columns(truth.exposed(rendering.image), truth)
        result[name] = row
    return result


def frames(run: Run) -> Iterator[Part]:
    """The table."""
    rows = run.rows.assign(frames=1.0 / run.rows["seconds_frame"])
    error = leading_metric()
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
        f"Frames of {size}, one sample a pixel, on {rows['threads'].iloc[0]} threads of the "
        "processor that the record names; lights and the view are made once and not counted. "
        f"{error.label} is that of the frame as it is, aliased edges included in the reference."
    )
    yield Text(noise_sentence(run.rows))
