"""What `envlight list`, `run` and `show` do; heavy imports stand inside."""

import os
from contextlib import ExitStack
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.progress import telling

if TYPE_CHECKING:
    from experiments.run.experiment import Experiment, RunRequest
    from experiments.run.loaded_run import Run
    from experiments.run.runner import Outcome

Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON, for machines.")]


def list_names(
    kind: Annotated[
        str, typer.Argument(help="samplers, scenes, environments, scales or experiments.")
    ] = "all",
) -> None:
    """List what there is to choose from."""
    from experiments.maps import places
    from experiments.run.registry import experiment_names
    from experiments.run.scale import SCALES
    from renderer import scenes
    from samplers import EnvlightError, sampler_names

    kinds = {
        "samplers": [f"{name:24} {_headline(name)}" for name in sampler_names()],
        "scenes": scenes.names(),
        "environments": [f"{name:24} {places.kind(name)}" for name in places.names()],
        "scales": [
            f"{s.name:24} {s.width}×{s.height}, {s.subpixels} sub-pixels" for s in SCALES.values()
        ],
        "experiments": [f"{name:24} {_experiment(name)}" for name in experiment_names()],
    }
    if kind not in ("all", *kinds):
        raise EnvlightError(f"nothing is called '{kind}'; list {', '.join(kinds)}, or all")
    for heading, names in kinds.items():
        if kind in ("all", heading):
            print(f"{heading}:")
            for name in names:
                print(f"  {name}")


def _experiment(name: str) -> str:
    """Its summary, and which tables and figures of its paper it makes."""
    from experiments.run.registry import figures_of, room_of, summary_of

    numbers = figures_of(name)
    paper = getattr(import_module(f"experiments.{room_of(name)}"), "PAPER", "")
    return summary_of(name) + (f" ({paper}: {', '.join(numbers)})" if numbers else "")


def _headline(name: str) -> str:
    from samplers import sampler_class

    return (sampler_class(name).__doc__ or "").strip().splitlines()[0]


def run(request: "RunRequest", dry_run: bool) -> int:
    """Run an experiment; returns the exit status: 0, or 1 where some of it failed."""
    with telling("starting"):
        from experiments.run.machine import keep_freed_memory
        from experiments.run.registry import find_experiment
        from experiments.run.start import run_experiment
        from samplers.threads import set_thread_count

        experiment = find_experiment(request.experiment)
    if request.threads:
        set_thread_count(request.threads)
    keep_freed_memory()
    made = partial(finish, images=request.images, json=request.as_json)
    return run_experiment(experiment, request, dry_run, made)


def finish(
    experiment: "Experiment",
    run: "Run",
    outcome: "Outcome",
    images: bool = True,
    json: bool = False,
) -> None:
    """Write a run's report, and the montages of a grid's images, and print its tables."""
    import pandas as pd

    from experiments.report.summary import summary
    from experiments.report.tables import as_json, print_summary, print_tables
    from experiments.report.write import sections, tables_of
    from experiments.run.experiment import Study

    study = isinstance(experiment, Study)
    report, *tables = _written(experiment, run, images and not study)
    table = pd.DataFrame() if study else summary(run.rows)
    if json:
        facts = {
            "measured": outcome.measured,
            "stored": outcome.stored,
            "failed": outcome.failures,
            "report": str(report),
        }
        print(as_json(table, facts))
        return
    if study:
        print_tables(tables_of(sections(experiment, run)))
    else:
        print_summary(table, experiment.name)
    things = "rows" if study else "measurements"
    print(f"{outcome.measured} {things} made, {outcome.stored} were stored already", end="")
    print(f", {outcome.left_out} left out" if outcome.left_out else "", end="")
    print(f", {len(outcome.failures)} failed" if outcome.failures else "")
    print(f"report:    {report}")
    print(f"tables:    {', '.join(map(str, [*tables, run.folder / 'measurements.csv']))}")
    if images and not study:
        print(f"pictures:  {run.folder / 'montages'}{os.sep}, {run.folder / 'images'}{os.sep}")


def _written(experiment: "Experiment", run: "Run", images: bool) -> list[Path]:
    """The report's files; where there are images, their montages are made by another process."""
    from experiments.report.case_figures import write_montages
    from experiments.report.write import write_report
    from experiments.run.executors import ProcessExecutor

    with telling("writing the report"), ExitStack() as stack:
        if not images:
            return write_report(experiment, run)
        beside = stack.enter_context(ProcessExecutor(1, threads=1))
        montages = beside.submit(write_montages, run)
        files = write_report(experiment, run)
        montages.result()
    return files


def show(
    folder: Annotated[Path, typer.Argument(help="The folder of a run.")], as_json: Json = False
) -> None:
    """Show what a run folder holds."""
    from experiments.report.summary import summary
    from experiments.report.tables import as_json as in_json
    from experiments.report.tables import print_summary
    from experiments.run.runner import rows_of
    from experiments.run.store import IMAGE, ROW, Store

    with Store.reading(folder) as store:
        plan = store.plan
        rows = rows_of(store)
        of_study = any(not one.reference for one in plan)
        if as_json and not of_study:
            counts = {"finished": len(rows), "planned": len(plan)}
            print(in_json(summary(rows) if len(rows) else rows, counts))
            return
        things = "rows" if of_study else "measurements"
        print(
            f"{folder}: {len(rows)} of {len(plan)} {things} of its plan are finished; "
            f"{store.count(IMAGE, ROW)} in the store {store.folder}; "
            f"{len(store.selection.starts)} starts"
        )
        if of_study:
            for file in sorted(folder.glob("*.md")):
                print("\n" + file.read_text(encoding="utf-8"))
            return
        for (scale, scene), part in rows.groupby(["scale", "scene"]) if len(rows) else ():
            maps = part["environment"].nunique()
            print(f"  {scale} · {scene}: {len(part)} measurements, {maps} maps")
        if len(rows):
            print_summary(summary(rows), folder.name)
