"""How calm lights and images stay while a fire spreads through a still place, frame by frame.

Reproduces section 6 and Figure 10 of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic
environment sequences", EGSR 2005. Every method makes 300 lights for each frame, with the same seed.
Between consecutive frames these are compared:

lights : light energy moved × angle, the least that makes one set of the other (see
    `metrics.transport`), in degrees per unit of energy; beside it that of the maps themselves, on a
    coarse grid, and that of the lights where no flame ever is and nothing should move
kept : share of the energy of those lights that stay exactly as they are
images : temporal noise, the RMSE of (Iₜ − Iₜ₋₁) − (Rₜ − Rₜ₋₁) with R the references, at one
    exposure for all frames; over the true change, the RMS of Rₜ − Rₜ₋₁

The paper shows three frames and a video and gives no number for any of these. Its times, 0.70 s a
frame alone and 0.41 s from the frame before, stand beside those of the Q²-tree built from scratch
and mended, which must give the same lights; both are timed in interleaved rounds on each frame.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from experiments.maps import places
from experiments.maps.patterns import select
from experiments.maps.sources import EMBEDDED
from experiments.run.bench import interleaved
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale, find_scale
from experiments.run.study import NOTE, Group, Job, Row, Study, run_study, study_environments
from experiments.wan2005.fire_sequence import FireSequence, change, energies, kept_share, unburnt
from experiments.wan2005.static_sampling import reason_to_leave_out, write_picture
from metrics.errors import rmse
from renderer import scenes
from renderer.image import write_png
from samplers import DirectionalLights, Lighting
from samplers.grids.quad_map import QuadMap
from samplers.q2_tree import Q2Tree

NAME = "dynamic-sequence"
COUNT = 300
SCENES, STILL = ["insect"], ["gallery-skylight"]
"""A bee under a bright window far above the fire, as in the paper."""
WINDOW = {"quick": (86, 93), "standard": (60, 108), "paper": (0, places.FIRE_FRAMES)}
"""Frames rendered, the last exclusive. All hold the paper's 89 to 91."""
SHOWN = (89, 90, 91)
NOISE_TARGET, MOST_SAMPLES = {"quick": 0.008, "standard": 0.005, "paper": 0.003}, 16384
ROUNDS = {"quick": 5, "standard": 7, "paper": 7}
TOLERANCE = 0.25
CALMED = f"q2-tree, tolerance {TOLERANCE}"
"""The tree of the frame before, mended until importances are that close to their order."""
TIMING = "timing"


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    scale = replace(
        find_scale(request.scale),
        noise_target=NOISE_TARGET[request.scale],
        max_samples=MOST_SAMPLES,
    )
    patterns = request.maps or (STILL if request.environments == EMBEDDED else [])
    sources = study_environments(request, patterns, scale.map_height)
    chosen = select(scenes.names(), request.scenes or SCENES, "scene")
    specs = choose_samplers(request.samplers)
    count = request.lights(COUNT)
    folder = run_folder(request.output, NAME, request.scale)
    groups = [
        group
        for source in sources
        for scene in chosen
        for group in _groups(FireSequence(scene, source, scale, folder), specs, count, scale)
    ]
    from experiments.wan2005.dynamic_sequence_report import report

    modules = (__name__, "renderer.render")
    study = Study(NAME, modules, groups, partial(report, count=count))
    return run_study(study, request, dry_run)


def _groups(
    sequence: FireSequence, chosen: tuple[SamplerSpec, ...], count: int, scale: Scale
) -> list[Group]:
    specs = {s.label: s for s in chosen if count >= s.sampler.minimum_count}
    if "q2-tree" in specs:
        specs[CALMED] = specs["q2-tree"]
    groups = [_method_group(sequence, label, spec, count) for label, spec in specs.items()]
    if "q2-tree" in specs:
        groups.append(_timing_group(sequence, specs["q2-tree"], count, ROUNDS[scale.name]))
    return groups


def _jobs(sequence: FireSequence, method: str, depends: Row, count: int) -> dict[str, Job]:
    first, stop = WINDOW[sequence.scale.name]
    return {
        f"{method} {frame}": Job(
            {
                "scene": sequence.scene, "environment": sequence.source.name, "method": method,
                "count": count, "frame": frame,
            },
            {"sequence": sequence.identity, **depends},
        )
        for frame in range(first + 1, stop)
    }  # fmt: skip


def _method_group(sequence: FireSequence, label: str, spec: SamplerSpec, count: int) -> Group:
    jobs = _jobs(sequence, label, {"sampler": spec.identity}, count)

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return _measure(sequence, label, spec, count, jobs)

    return Group(f"{sequence.scene} in {sequence.source.name}, {label}", jobs, measure)


def lights_of(
    sequence: FireSequence, label: str, spec: SamplerSpec, count: int
) -> dict[int, Lighting]:
    """The method's lights in each frame."""
    frames = range(*WINDOW[sequence.scale.name])
    if label != CALMED:
        return {
            frame: spec.sampler.prepare(sequence.map(frame), count, np.random.default_rng(0))
            for frame in frames
        }
    tree = Q2Tree.build(sequence.map(frames[0]), count)
    made: dict[int, Lighting] = {frames[0]: tree.lights()}
    for frame in frames[1:]:
        tree = tree.update(sequence.map(frame), TOLERANCE)
        made[frame] = tree.lights()
    return made


def _measure(
    sequence: FireSequence, label: str, spec: SamplerSpec, count: int, jobs: dict[str, Job]
) -> dict[str, Row]:
    """All frames of a method: each needs the one before, and a tree may need all before it."""
    reason = reason_to_leave_out(
        spec.sampler.prepare(sequence.still, count, np.random.default_rng(0))
    )
    if reason:
        return {name: {NOTE: f"{label} is left out: {reason}"} for name in jobs}
    lighting = lights_of(sequence, label, spec, count)
    factor = sequence.exposure
    rows: dict[str, Row] = {}
    image = {
        frame: sequence.image(frame, lights) * np.float64(factor)
        for frame, lights in lighting.items()
    }
    found = {frame: sequence.reference(frame) for frame in lighting}
    truth = {frame: kept.image * np.float64(factor) for frame, kept in found.items()}
    for name, job in jobs.items():
        now = job.columns["frame"]
        before = now - 1
        sets = energies(lighting[before]), energies(lighting[now])
        away = unburnt(sets[0]), unburnt(sets[1])
        still = np.zeros_like(image[now])
        change_of_image, true_change = image[now] - image[before], truth[now] - truth[before]
        rows[name] = {
            "lights": len(sets[1][1]),
            "lights_change": change(*sets),
            "map_change": change(sequence.grid(before), sequence.grid(now)),
            "unburnt_change": change(*away),
            "unburnt_kept": kept_share(*away),
            "image_change": rmse(change_of_image, still),
            "true_change": rmse(true_change, still),
            "temporal_noise": rmse(change_of_image, true_change),
            "error": rmse(image[now], truth[now]),
            "noise_floor": factor * math.hypot(found[before].noise_floor, found[now].noise_floor),
        }
    for frame in SHOWN:
        if frame in lighting:
            _write_tiles(sequence, label, frame, image[frame], truth[frame], lighting[frame])
    return rows


def _write_tiles(
    sequence: FireSequence, label: str, frame: int, image: np.ndarray, truth: np.ndarray,
    lighting: Lighting,
) -> None:  # fmt: skip
    from experiments.report.light_pattern import draw_pattern

    def place(kind: str, of: str) -> Path:
        return tile(sequence.folder, sequence.scene, sequence.source.name, kind, of, frame)

    write_picture(place("image", "reference"), truth)
    write_picture(place("image", label), image)
    environment = sequence.map(frame)
    write_png(place("pattern", "reference"), draw_pattern(environment, DirectionalLights.none()))
    write_png(place("pattern", label), draw_pattern(environment, lighting))


def tile(folder: Path, scene: str, environment: str, kind: str, method: str, frame: int) -> Path:
    """Where a picture lies from which the strips are made."""
    return folder / "pictures" / f"{scene}_{environment}_{kind}_{method}_{frame}.png"


def _timing_group(sequence: FireSequence, spec: SamplerSpec, count: int, rounds: int) -> Group:
    depends = {"sampler": spec.identity, "rounds": rounds}
    jobs = _jobs(sequence, TIMING, depends, count)

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return {name: _time(sequence, jobs[name].columns["frame"], count, rounds) for name in names}

    return Group(f"{sequence.source.name}, times of the Q²-tree", jobs, measure)


def _time(sequence: FireSequence, frame: int, count: int, rounds: int) -> Row:
    """Seconds of the Q²-tree from scratch and from the frame before, and what both share."""
    environment = sequence.map(frame)
    before = Q2Tree.build(sequence.map(frame - 1), count)
    tasks = {
        "alone": lambda: Q2Tree.build(environment, count).lights(),
        "coherent": lambda: before.update(environment).lights(),
        "reading": lambda: QuadMap.of(environment),
    }
    times = interleaved(tasks, rounds)
    alone, coherent = Q2Tree.build(environment, count), before.update(environment)
    columns = {
        key: value
        for name, timing in times.items()
        for key, value in timing.columns(f"seconds_{name}").items()
    }
    return {
        **columns,
        "identical": int(same_lights(alone.lights(), coherent.lights())),
        "quads_changed": len(set(alone.leaves) - set(before.leaves)),
    }


def same_lights(a: DirectionalLights, b: DirectionalLights) -> bool:
    """Whether two sets agree bit for bit."""
    return np.array_equal(a.direction, b.direction) and np.array_equal(a.irradiance, b.irradiance)
