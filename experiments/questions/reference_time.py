"""How long a reference at 640×480 pixels takes to reach its noise target, per map and scene, and
which rays it traces.

A case's reference is that which any experiment over a grid makes, with the noise target and the cap
on samples of scale standard, in an empty folder: nothing is read that was made before. It is kept
in the run's folder then, from which grids beside it take references of their sizes. Map, view and
kernels are there when the clock starts. Each reference has a process of its own, which is stopped
at twice the wanted time; how far it came is then told from the last of the passes that it kept for
going on.
"""

import math
import multiprocessing
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps.classes import representatives
from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.targets import target_verdict
from experiments.run.bench import LOAD, load_sentence
from experiments.run.case import Case
from experiments.run.experiment import TEST_SCENES, Group, Job, Row, Study, experiment
from experiments.run.kept_images import (
    FIRST_HALF,
    keep_reference,
    pixel_digest,
    reference_path,
)
from experiments.run.loaded_run import Run
from experiments.run.machine import cores_of, machine_kind
from experiments.run.measure import ReferenceTask
from experiments.run.process_peak import own_peak_mib
from experiments.run.rendering import CaseScene
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.scale import SCALES, Scale, of_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.shared_results import link_reference
from experiments.run.store import PIXELS, Store
from experiments.run.study_run import study_environments
from experiments.run.timed import alone_on_the_machine
from metrics.errors import TARGET_LUMINANCE, exposure_scale
from renderer import scenes
from renderer.reference import Reference, render_reference
from renderer.view import View, make_view
from samplers import EnvironmentMap, EnvlightError
from samplers.threads import set_thread_count, thread_count

NAME = "reference-time"
SIZES = {"quick": (160, 120), "standard": (640, 480), "paper": (640, 480)}
WANTED_SECONDS = 90.0
STOP_SECONDS = 2.0 * WANTED_SECONDS
WANTED_MEAN = 14.0
"""Seconds a reference: 32 maps with four scenes in half an hour."""
KINDS = ("shadow", "brdf", "skipped")
"""Rays toward samples of the map, rays along samples of the BRDF, and samples of no use."""
UNFINISHED = ".partial.npz"
ROUNDING = 1e-5
"""Share by which a noise may exceed its target: the kept image is float32."""
ALL = "all scenes"
FORMATS = {
    "environment": "s", "scene": "s", "seconds": ".1f", "samples": ".0f", "rays": ",d",
    "light_percent": ".0f", "skipped_percent": ".0f", "noise": ".5f", "target": ".5f",
    "peak_mib": ".0f", "verdict": "s",
}  # fmt: skip
SUMMARY_FORMATS = {
    "scene": "s", "maps": "d", "in_time": "d", "reached": "d", "at_cap": "d", "stopped": "d",
    "median_seconds": ".1f", "most_seconds": ".1f", "slowest": "s", "total_seconds": ".0f",
    "light_percent": ".0f", "skipped_percent": ".0f",
}  # fmt: skip


@experiment(NAME)
def reference_time() -> Study:
    """Seconds until a reference reaches its noise target, per map and scene."""
    return Study(
        title="Time to make a reference",
        sections=(all_cases, by_scene),
        groups=groups,
        sources=(__name__,),
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per case."""
    scale = reference_scale(request.scale)
    sources = study_environments(request, representatives(1), scale.map_height)
    chosen = [name_and_file(scene) for scene in choose_scenes(request.scenes or list(TEST_SCENES))]
    cases = [Case(name, source, scale, file) for source in sources for name, file in chosen]
    folder = run_folder(request.output, NAME, request.scale)
    return [_group(case, folder) for case in cases]


def reference_scale(name: str) -> Scale:
    """Scale standard, with its noise target and cap, in the sizes of this experiment."""
    width, height = of_scale(SIZES, name)
    return replace(SCALES["standard"], name=name, width=width, height=height)


def _group(case: Case, folder: Path) -> Group:
    columns = {
        "environment": case.environment.name,
        "scene": case.scene,
        "width": case.scale.width,
        "height": case.scale.height,
        "target": case.scale.noise_target,
        "most_samples": case.scale.max_samples,
        "stop": STOP_SECONDS,
    }

    made: list[Row] = []

    def measure(names: Sequence[str]) -> dict[str, Row]:
        with tempfile.TemporaryDirectory() as place, alone_on_the_machine():
            row, reference = _measure(ReferenceTask(case, place), STOP_SECONDS)
            if reference:
                link_reference(case, folder, Path(place))
                made.append(reference)
        return {name: {**row, "machine": machine_kind()} for name in names}

    def keep(store: Store) -> None:
        for reference in made:
            store.put("reference", case.reference_key, case.reference_identity, reference)

    jobs = {"reference": Job(columns, {"case": case.reference_key})}
    return Group(str(case), jobs, measure, keep)


def _measure(task: ReferenceTask, stop: float) -> tuple[Row, Row]:
    """Make a reference in a process of its own, which has `stop` seconds.

    Returns its row here, and the one that a grid has of it: empty where it was stopped.
    """
    context = multiprocessing.get_context("spawn")
    mine, other = context.Pipe()
    process = context.Process(target=_work, args=(task, thread_count(), other), daemon=True)
    process.start()
    other.close()
    try:
        _receive(mine, None)
        found = _receive(mine, stop)
    finally:
        process.kill()
        process.join()
    return found or ({**_state_at_stop(task), "seconds": stop, "stopped": True}, {})


def _receive(pipe: Connection, seconds: float | None) -> Any:
    """What the process sends next, or raises; None where it sends nothing in the time."""
    if not pipe.poll(seconds):
        return None
    try:
        sent = pipe.recv()
    except EOFError as error:
        raise EnvlightError("its process ended early; is there enough memory?") from error
    if isinstance(sent, Exception):
        raise sent
    return sent


def _work(task: ReferenceTask, threads: int, pipe: Connection) -> None:
    """Tell when all is there, make the reference, and send its row."""
    # Where nobody listens any more, there is nobody to be told.
    with suppress(BrokenPipeError):
        try:
            set_thread_count(threads)
            scene = CaseScene.of(task.case)
            _rehearse()
            pipe.send({})
            reference = _make(task, scene)
            told = {
                "seconds": reference.seconds,
                "stopped": False,
                **_reached(scene.view, reference),
                "peak_mib": own_peak_mib(),
            }
            pipe.send((told, _row_of_a_grid(task.case, reference)))
        except Exception as error:
            pipe.send(EnvlightError(f"{type(error).__name__}: {error}"))


def _rehearse() -> None:
    """Make a tiny reference, so that every kernel is there."""
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (16, 32, 3))
    radiance[4, 7] = 1e3
    environment = EnvironmentMap.from_array(radiance, "rehearsal")
    render_reference(make_view(scenes.make("three-boxes"), 16, 12, 1), environment, 0.01, 256)


def _make(task: ReferenceTask, scene: CaseScene) -> Reference:
    """Make and keep the reference that `measure_reference` makes, which tells no kinds of rays."""
    folder, scale = Path(task.folder), task.case.scale
    checkpoint = reference_path(folder, task.case).with_suffix(UNFINISHED)
    reference = render_reference(
        scene.view, scene.environment, scale.noise_target, scale.max_samples, checkpoint=checkpoint
    )
    keep_reference(folder, task.case, reference.image, reference.first_half)
    return reference


def _row_of_a_grid(case: Case, reference: Reference) -> Row:
    """What a grid's store holds of a reference."""
    return {
        "scene": case.scene,
        "environment": case.environment.name,
        PIXELS: pixel_digest(reference.image),
        FIRST_HALF: pixel_digest(reference.first_half),
        "noise_floor": reference.noise_floor,
        "samples": reference.samples,
        "rays": reference.rays.traced,
        "seconds": reference.seconds,
    }


def _reached(view: View, reference: Reference) -> Row:
    """Samples, rays of each kind, and the noise in units of the foreground's mean luminance."""
    exposure = exposure_scale(reference.image, view.coverage > 0.0)
    return {
        "samples": reference.samples,
        **{f"rays_{kind}": getattr(reference.rays, kind) for kind in KINDS},
        "noise": reference.noise_floor * exposure / TARGET_LUMINANCE,
    }


def _state_at_stop(task: ReferenceTask) -> Row:
    """Noise, samples and rays of the last pass that a stopped process kept; NaN without one."""
    kept = next(Path(task.folder).rglob(f"*{UNFINISHED}"), None)
    unknown = dict.fromkeys(["samples", *(f"rays_{kind}" for kind in KINDS), "noise"], math.nan)
    if kept is None:
        return {**unknown, "peak_mib": math.nan}
    scene = CaseScene.of(task.case)
    # With no samples allowed it adds none, and judges those that are there.
    state = render_reference(scene.view, scene.environment, 0.0, 0, checkpoint=kept)
    return {**_reached(scene.view, state), "peak_mib": math.nan}


def with_verdicts(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with `reached`, the target; `in_time`, reached in the wanted time; and verdicts."""
    stopped = rows["stopped"].astype(bool)
    reached = ~stopped & (rows["noise"] <= rows["target"] * (1.0 + ROUNDING))
    in_time = reached & (rows["seconds"] <= WANTED_SECONDS)
    shown = rows.assign(
        stopped=stopped, reached=reached, in_time=in_time, at_cap=~stopped & ~reached
    )
    return shown.assign(verdict=[_verdict(row) for _, row in shown.iterrows()])


def _verdict(row: pd.Series) -> str:
    if row["stopped"]:
        return f"stopped at {row['seconds']:.0f} s"
    if row["at_cap"]:
        return f"target missed at the cap of {row['most_samples']:.0f} samples"
    return target_verdict(row["seconds"] / WANTED_SECONDS)


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Per scene on how many maps the target was reached, and in the wanted time; then all scenes.

    rows : with verdicts. For all scenes a map counts where it does with every scene of the rows.
    """
    parts = [(str(scene), part) for scene, part in rows.groupby("scene", sort=False)]
    found = [
        {
            "scene": scene,
            "maps": len(part),
            **{name: int(part[name].sum()) for name in ("in_time", "reached", "at_cap", "stopped")},
            **_times(part),
        }
        for scene, part in parts
    ]
    by_map = rows.groupby("environment")
    whole = by_map["scene"].nunique() == len(parts)
    every = {name: int((by_map[name].all() & whole).sum()) for name in ("in_time", "reached")}
    some = {name: int(by_map[name].any().sum()) for name in ("at_cap", "stopped")}
    found.append({"scene": ALL, "maps": len(whole), **every, **some, **_times(rows)})
    return pd.DataFrame(found)


def _times(part: pd.DataFrame) -> Row:
    slowest = part.iloc[int(part["seconds"].argmax())]
    return {
        "median_seconds": part["seconds"].median(),
        "most_seconds": slowest["seconds"],
        "slowest": slowest["environment"],
        "total_seconds": part["seconds"].sum(),
        **shares(part[[f"rays_{kind}" for kind in KINDS]].sum()),
    }


def shares(rays: pd.DataFrame | pd.Series) -> Row:
    """Of the rays the percentage toward samples of the map; of the samples that of no use."""
    traced = rays["rays_shadow"] + rays["rays_brdf"]
    return {
        "light_percent": 100.0 * rays["rays_shadow"] / traced,
        "skipped_percent": 100.0 * rays["rays_skipped"] / (traced + rays["rays_skipped"]),
    }


def all_cases(run: Run) -> Iterator[Part]:
    """Every case with its verdict."""
    rows = with_verdicts(run.rows)
    rows = rows.assign(rays=rows["rays_shadow"] + rows["rays_brdf"], **shares(rows))
    rows["rays"] = rows["rays"].round().astype("Int64")
    width, height = rows["width"].iloc[0], rows["height"].iloc[0]
    yield Table("reference_time", rows, FORMATS)
    yield Text(
        f"{width}×{height} pixels, {SCALES['standard'].subpixels} sub-pixels; machine: "
        f"{', '.join(rows['machine'].unique())}. `samples` are a mean per shading point; `noise` "
        "and `target` are in units of the foreground's mean luminance. Every point takes two "
        "samples of the map for each of its BRDF; `light percent` is the share of the former in "
        "the rays traced, and `skipped percent` that of the samples of both kinds that need no "
        "ray, as they lie below the surface or carry nothing. `met`: the target is "
        f"reached within {WANTED_SECONDS:.0f} s. A reference is stopped after {STOP_SECONDS:.0f} "
        "s; its noise, samples and rays are then of the last pass that was kept, up to some 20 s "
        "and one pass before. `peak mib` is of the whole process that made it."
    )
    yield Text(load_sentence(rows[LOAD].tolist(), max(map(cores_of, rows["machine"]))))


def by_scene(run: Run) -> Iterator[Part]:
    """One line per scene, and one for all."""
    yield Heading(f"References within {WANTED_SECONDS:.0f} s")
    yield Items(tuple(findings(run)))
    yield Table(
        "reference_time_summary",
        summary(with_verdicts(run.rows)),
        SUMMARY_FORMATS,
        caption="In the last line `at cap` and `stopped` count maps with any such scene.",
    )


def in_time_sentence(table: pd.DataFrame) -> str:
    """On how many maps all references were made in time. table : `summary` of rows"""
    every = table.iloc[-1]
    return (
        f"On {every['in_time']} of {every['maps']} maps every scene reaches the target within "
        f"{WANTED_SECONDS:.0f} s. All references together take {every['total_seconds']:.0f} s."
    )


def mean_sentence(rows: pd.DataFrame) -> str:
    """The mean time of a reference beside what is wanted. rows : with verdicts"""
    mean = rows["seconds"].mean()
    least = " at least, as some were stopped" if rows["stopped"].any() else ""
    wanted = f"wanted {WANTED_MEAN:.0f} s: {target_verdict(mean / WANTED_MEAN)}"
    return f"A reference takes {mean:.1f} s in the mean{least}; {wanted}."


def rays_sentence(table: pd.DataFrame) -> str:
    """Which rays are traced for references. table : `summary` of rows"""
    scenes, every = table.iloc[:-1], table.iloc[-1]
    low, high = scenes["light_percent"].min(), scenes["light_percent"].max()
    return (
        f"Of the rays {every['light_percent']:.0f} % go toward samples of the map "
        f"({low:.0f} to {high:.0f} % by scene), the others along samples of the BRDF; of "
        f"all samples {every['skipped_percent']:.0f} % need no ray."
    )


def findings(run: Run) -> list[str]:
    """How many references were made in time, how long all took, and which rays were traced."""
    rows = with_verdicts(run.rows)
    table = summary(rows)
    return [f"{in_time_sentence(table)} {mean_sentence(rows)}", rays_sentence(table)]
