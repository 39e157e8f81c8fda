"""Whether the paper's 4 seconds at 1600×1200 with 4 sub-pixels can be kept by every sampler.

Wu, "Efficient environment map rendering based on decomposition", 2025, gives every method 4 s an
image. Here each sampler renders a scene under a map at the count that budgets of seconds choose for
it, beside its smallest count, below which it cannot go. The time is that of rendering; generating
lights and making the view are told apart. There are no references and no errors. Then each sampler
renders once more in a process of its own, which makes its view and its lights itself and tells its
peak memory. Smaller scales have as many seconds per pixel.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
import pandas as pd

from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.targets import target_verdict
from experiments.run.bench import ON_TIME, noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.machine import machine_kind
from experiments.run.measurement import Measurement
from experiments.run.process_peak import in_fresh_process, own_peak_mib
from experiments.run.rendering import CaseScene, light_count
from experiments.run.request import RunRequest
from experiments.run.sampler_choice import choose_samplers
from experiments.run.scale import Scale, find_scale, of_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.study_run import NOTE, study_environments
from experiments.run.timed import (
    allowed_counts,
    alone_on_the_machine,
    time_at_budget,
    timed_rounds,
)
from experiments.wu2025.published import PAPER_PIXELS, seconds_budget
from samplers import EnvlightError
from samplers.threads import set_thread_count, thread_count

SCENES = ["vase", "birdcage"]
MAPS = ["noon-desert", "room-one-window"]
SIZES = {"quick": (400, 300), "standard": (800, 600), "paper": (1600, 1200)}
SUBPIXELS = 4
MOST_MIB = 2048.0
"""What a run at the paper's size should stay below."""
REHEARSAL = "three-boxes"
FORMATS = {
    "scene": "s", "environment": "s", "sampler": "s", "budget": "s", "seconds_lights": ".3f",
    "seconds_view": ".2f", "least_count": "d", "seconds_least": ".3f", "count": "d",
    "seconds_render": ".3f", "ratio": ".3f", "rays": ".1f", "verdict": "s", "peak_mib": ".0f",
}  # fmt: skip
SUMMARY_FORMATS = {
    "sampler": "s", "budget": "s", "cases": "d", "met": "d", "worst_ratio": ".3f",
    "most_seconds_least": ".3f", "most_seconds_lights": ".3f", "most_seconds_view": ".2f",
    "peak_mib": ".0f", "memory": "s",
}  # fmt: skip


@experiment("paper-budget")
def paper_budget() -> Study:
    """Whether every sampler can keep the paper's budget of seconds."""
    return Study(
        title="The paper's budget of 4 s at 1600×1200 pixels",
        sections=(all_rows, by_sampler),
        groups=groups,
        sources=(__name__,),
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per case and budget."""
    scale = budget_scale(request.scale)
    sources = study_environments(request, MAPS, scale.map_height)
    specs = choose_samplers(request.samplers)
    return [
        _group([Measurement(case, spec, budget, 0) for spec in specs])
        for name, file in map(name_and_file, choose_scenes(request.scenes or SCENES))
        for case in (Case(name, source, scale, file) for source in sources)
        for budget in _budgets(request, scale)
    ]


def budget_scale(name: str) -> Scale:
    """A scale with the image sizes of this experiment."""
    width, height = of_scale(SIZES, name)
    return replace(find_scale(name), width=width, height=height, subpixels=SUBPIXELS)


def _budgets(request: RunRequest, scale: Scale) -> list[Budget]:
    budgets = [Budget.parse(text) for text in request.budgets] or list(seconds_budget(scale))
    for budget in budgets:
        if budget.kind != "seconds":
            raise EnvlightError(f"budget '{budget}': only times here; write seconds=T")
    return budgets


def _group(measurements: list[Measurement]) -> Group:
    case, budget = measurements[0].case, measurements[0].budget
    by_name = {measurement.sampler.label: measurement for measurement in measurements}
    jobs = {
        name: Job(
            {
                "scene": case.scene,
                "environment": case.environment.name,
                "sampler": name,
                "width": case.scale.width,
                "height": case.scale.height,
                "budget": str(budget),
            },
            {"measurement": measurement.key},
        )
        for name, measurement in by_name.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return _measure({name: by_name[name] for name in names})

    return Group(f"{case}, {budget}", jobs, measure)


def _measure(measurements: dict[str, Measurement]) -> dict[str, Row]:
    """Rows of the samplers of one case; a sampler that fails has a note instead."""
    scene = CaseScene.of(next(iter(measurements.values())).case)
    rows: dict[str, Row] = {}
    with alone_on_the_machine():
        found = time_at_budget(scene, list(measurements.values()))
        for name, measurement in measurements.items():
            timed = found[measurement]
            if isinstance(timed, Exception):
                rows[name] = {NOTE: f"{name} on {measurement.case}: {timed}"}
                continue
            shot, timing, least = timed.shot, timed.timing, allowed_counts(measurement).least
            smallest = timing
            if shot.count > least:
                shots = {measurement: scene.shoot(measurement, least)}
                smallest = timed_rounds(scene, shots)[measurement]
            rows[name] = {
                "least_count": least,
                "most_count": allowed_counts(measurement).most,
                "seconds_least": smallest.median,
                "count": shot.count,
                "lights": light_count(shot.lighting),
                "rays": shot.rays,
                **timing.columns("seconds_render"),
                **in_fresh_process(_by_itself, measurement, shot.count, thread_count()),
                "machine": machine_kind(),
            }
    return rows


def _by_itself(measurement: Measurement, count: int, threads: int) -> Row:
    """All that one image takes, from nothing: seconds of view and lights, and peak memory, MiB."""
    set_thread_count(threads)
    case = measurement.case
    rehearsal = replace(case, scene=REHEARSAL, scene_file="")
    # Loads the map and all kernels, in little memory.
    CaseScene.of(rehearsal, case.scale.width // 16).shoot(
        measurement, allowed_counts(measurement).least
    )
    started = perf_counter()
    scene = CaseScene.of(case)
    seconds = perf_counter() - started
    shot = scene.shoot(measurement, count)
    return {
        "seconds_view": seconds,
        "seconds_lights": shot.seconds_lights,
        "peak_mib": own_peak_mib(),
    }


def verdict(row: pd.Series) -> str:
    """Whether the median is within 10 % of the budget, or what stands in the way."""
    seconds = Budget.parse(row["budget"]).amount
    count, taken = int(row["count"]), row["seconds_render"]
    if abs(taken / seconds - 1.0) <= ON_TIME:
        return "met"
    if taken > seconds and count == row["least_count"]:
        return f"smallest budget {taken:.2g} s with K={count}"
    if taken < seconds and count == row["most_count"]:
        return f"largest budget {taken:.2g} s with K={count}"
    return f"nearest budget {taken:.2g} s with K={count}"


def with_verdicts(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with the share of the budget that was used, and verdicts."""
    seconds = rows["budget"].map(lambda text: Budget.parse(text).amount)
    return rows.assign(ratio=rows["seconds_render"] / seconds, verdict=rows.apply(verdict, axis=1))


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Per sampler, over scenes and maps: on how many the budget is met, and the largest costs.

    rows : with ratio and verdict
    """
    table = (
        rows.groupby(["sampler", "budget"], sort=False)
        .agg(
            cases=("verdict", "size"),
            met=("verdict", lambda verdicts: verdicts.eq("met").sum()),
            worst_ratio=("ratio", lambda ratio: ratio.iloc[int(np.log(ratio).abs().argmax())]),
            most_seconds_least=("seconds_least", "max"),
            most_seconds_lights=("seconds_lights", "max"),
            most_seconds_view=("seconds_view", "max"),
            peak_mib=("peak_mib", "max"),
        )
        .reset_index()
    )
    table["memory"] = [target_verdict(peak / MOST_MIB) for peak in table["peak_mib"]]
    at_paper = (rows["width"] * rows["height"] >= PAPER_PIXELS).all()
    return table if at_paper else table.drop(columns="memory")


def finished(run: Run) -> pd.DataFrame:
    """The rows that were measured, with verdicts."""
    shown = with_verdicts(run.rows[run.rows["seconds_render"].notna()].reset_index(drop=True))
    counts = ["least_count", "most_count", "count"]
    shown[counts] = shown[counts].astype(int)
    return shown


def all_rows(run: Run) -> Iterator[Part]:
    """Every sampler on every case, and what was left out."""
    rows = finished(run)
    width, height = rows["width"].iloc[0], rows["height"].iloc[0]
    yield Table("paper_budget", rows, FORMATS)
    yield Text(
        f"{width}×{height} pixels, {SUBPIXELS} sub-pixels; machine: "
        f"{', '.join(rows['machine'].unique())}. `seconds render` is the median of "
        f"{rows['rounds'].min()} to {rows['rounds'].max()} rounds at the count K chosen for the "
        f"budget, `ratio` its share of the budget, and `met` means within {100 * ON_TIME:.0f} % of "
        "it. `seconds least` is the time at the smallest count. `rays` are per sub-pixel. Seconds "
        "of lights and view were taken once. `peak mib` is all of a process that renders this "
        "image and nothing else, interpreter and libraries included, references and metrics not."
    )
    notes = run.rows.get(NOTE, pd.Series(dtype=object)).dropna().unique()
    yield Items((*(f"Left out: {note}." for note in notes), noise_sentence(rows)))


def by_sampler(run: Run) -> Iterator[Part]:
    """One line per sampler."""
    totals = summary(finished(run))
    goal = f"At {PAPER_PIXELS:,} pixels a process should stay below {MOST_MIB:.0f} MiB"
    note = f"{goal}." if "memory" in totals else f"{goal}; this run was of another size."
    yield Heading("By sampler")
    yield Table(
        "paper_budget_summary", totals, SUMMARY_FORMATS, caption=f"{met_sentence(totals)} {note}"
    )


def met_sentence(totals: pd.DataFrame) -> str:
    """In how many rows the budget is met. totals : `summary` of rows"""
    return f"The budget is met in {totals['met'].sum()} of {totals['cases'].sum()} rows."


def findings(run: Run) -> list[str]:
    """How often the budget is met."""
    return [met_sentence(summary(finished(run)))]
