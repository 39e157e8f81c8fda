"""Running a grid experiment: what is missing is measured, then the report is made."""

import os
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.maps.sources import check_environments, repair_sentence
from experiments.run import time_spent
from experiments.run.bench import load_average
from experiments.run.estimate import estimate
from experiments.run.executors import DASK, PROCESSES, make_executor, shared_out, undisturbed
from experiments.run.experiment import GridExperiment
from experiments.run.grid import Grid
from experiments.run.left import Left, left_to_do
from experiments.run.loaded_run import Run
from experiments.run.machine import record
from experiments.run.measurement import Measurement
from experiments.run.methods import methods_digest
from experiments.run.progress import terminal_progress
from experiments.run.record import write_run
from experiments.run.request import RunRequest
from experiments.run.row_order import in_fixed_order
from experiments.run.runner import (
    Outcome,
    missing_measurements,
    planned,
    run_folder,
    run_measurements,
    spent_before,
)
from experiments.run.scene_choice import name_and_file
from experiments.run.status import INTERRUPTED
from experiments.run.store import Planned, Store
from experiments.run.time_spent import REPORT
from experiments.run.warm_up import warm_up
from samplers.threads import set_thread_count

FAILURES_PRINTED = 20
Finish = Callable[[GridExperiment, Run, Outcome], None]
"""Makes and prints the report of a finished run: given by the command line."""


def run_grid(experiment: GridExperiment, request: RunRequest, dry_run: bool, finish: Finish) -> int:
    """Run a grid experiment; returns the exit status: 0, or 1 where some measurements failed."""
    grid = experiment.grid(request)
    for sentence in grid.left_out():
        print(f"envlight: {sentence}", file=sys.stderr)
    checked = check_environments(grid.environments, request.strict)
    for name, reason in checked.bad.items():
        print(f"envlight: map '{name}' is left out: {reason}", file=sys.stderr)
    for name, count in checked.repaired.items():
        print(repair_sentence(name, count))
    grid = replace(grid, environments=checked.good)
    folder = run_folder(request.output, experiment.name, request.scale)
    if dry_run:
        _print_plan(experiment.name, grid, folder)
        _print_left(left_to_do(grid.measurements(), folder, request.images), request)
        return 0
    with (
        Store.writing(folder) as store,
        make_executor(
            request.executor, request.workers, request.threads, request.cluster
        ) as executor,
    ):
        status = run_plan(
            experiment,
            store,
            grid.measurements(),
            finish,
            request.images,
            folder.parent,
            executor,
            checked.bad,
            repairs={name: str(repair) for name, repair in checked.repaired.items()},
        )
    return status or int(bool(checked.bad))


def run_plan(
    experiment: GridExperiment,
    store: Store,
    measurements: list[Measurement],
    finish: Finish,
    images: bool = True,
    beside: Path | None = None,
    executor: Executor | None = None,
    bad_maps: dict[str, str] | None = None,
    repairs: dict[str, str] | None = None,
) -> int:
    """Measure what is missing, write rows and record, and make the report; returns the status.

    beside : a folder of run folders whose references and measurements may be taken
    bad_maps : maps that were left out, and what is wrong with each; the report names them
    repairs : what was repaired, by the map's name
    """
    machine = {**record(), "methods": methods_digest()}
    store.begin_session(machine, [planned(one) for one in measurements])
    try:
        samplers = (one.sampler for one in missing_measurements(store, measurements))
        compiling = warm_up(samplers, executor)
        with terminal_progress() as progress:
            outcome = run_measurements(store, measurements, executor, progress, images, beside)
        for failure in outcome.failures[:FAILURES_PRINTED]:
            print(f"envlight: failed: {failure}", file=sys.stderr)
        if len(outcome.failures) > FAILURES_PRINTED:
            more = len(outcome.failures) - FAILURES_PRINTED
            print(f"envlight: {more} more measurements failed", file=sys.stderr)
        if outcome.stored + outcome.measured == 0:
            return 1
        before = spent_before(store.folder)
        keep_rows(experiment, store, measurements, bad_maps or {}, repairs or {})
        with time_spent.on(REPORT):
            finish(experiment, Run.load(store.folder), outcome)
        time_spent.tell(store.folder, time_spent.added(before, compiling, outcome.elsewhere))
        return 1 if outcome.failures else 0
    except KeyboardInterrupt:
        left = len(missing_measurements(store, measurements))
        print(
            f"envlight: interrupted; {len(measurements) - left} of {len(measurements)} "
            f"measurements are finished and kept in {store.folder}; the same command goes on with "
            f"the other {left}",
            file=sys.stderr,
        )
        raise SystemExit(INTERRUPTED) from None


def keep_rows(
    experiment: GridExperiment,
    store: Store,
    measurements: list[Measurement],
    bad_maps: dict[str, str],
    repairs: dict[str, str] | None = None,
) -> None:
    """Write the rows and the record of a run, from which its report is made."""
    rows = rows_of(store, [planned(one) for one in measurements])
    told = {"bad_maps": bad_maps, "repairs": repairs or {}}
    write_run(store.folder, rows, {**_facts(experiment, store, measurements, rows), **told})


def rows_of(store: Store, plan: list[Planned]) -> pd.DataFrame:
    """The whole rows of a plan in a fixed order; what else the folder holds stays out."""
    found = [row for row in map(store.measured, plan) if row is not None]
    rows = pd.DataFrame(found)
    return rows if rows.empty else in_fixed_order(rows)


def rows_by_start(store: Store, rows: pd.DataFrame) -> dict[int, int]:
    """How many of the rows each start measured, by its place in the store's sessions, oldest first;
    a start that found all finished is not among them."""
    finished_in = store.finished_in()
    return dict(sorted(Counter(finished_in[key] for key in rows["key"]).items()))


def _facts(
    experiment: GridExperiment, store: Store, measurements: list[Measurement], rows: pd.DataFrame
) -> dict[str, Any]:
    there, scale = set(rows["key"]), measurements[0].case.scale
    missing: dict[str, list[str]] = {}
    for one in measurements:
        if one.key not in there:
            cases = missing.setdefault(one.sampler.label, [])
            if str(one.case) not in cases:
                cases.append(str(one.case))
    return {
        "experiment": experiment.name,
        "scale": {
            "name": scale.name, "width": scale.width, "height": scale.height,
            "subpixels": scale.subpixels, "sets": scale.sets,
        },
        "samplers": list(dict.fromkeys(one.sampler.label for one in measurements)),
        "budgets": list(dict.fromkeys(str(one.budget) for one in measurements)),
        "planned": len(measurements),
        "missing": missing,
        **_starts(store, rows),
    }  # fmt: skip


def _starts(store: Store, rows: pd.DataFrame) -> dict[str, Any]:
    """What is recorded of the starts that measured the rows; of their loads the largest."""
    sessions, counts = store.sessions(), rows_by_start(store, rows)
    parts: dict[str, dict[str, Any]] = {}
    for place, count in counts.items():
        session = sessions[place]
        begun = {"rows": 0, "started": session["started"], "commit": session["commit"]}
        part = parts.setdefault(session["commit"], begun)
        part |= {"rows": part["rows"] + count, "command": session["command"]}
    first, last = min(counts), max(counts)
    machine = {**sessions[last], "started": sessions[first]["started"]}
    loads = [sessions[place]["load_average"] for place in counts]
    machine["load_average"] = float(pd.Series(loads, dtype=float).max())  # NaN where all are
    if last == len(sessions) - 1:
        machine["load_average_end"] = load_average()
    return {"machine": machine, **({"parts": list(parts.values())} if len(parts) > 1 else {})}


def _print_left(left: Left, request: RunRequest) -> None:
    print(f"left:      {len(left.measurements)} measurements, {left.references} references")
    workers = 1
    if request.executor in (PROCESSES, DASK) and not request.cluster:
        workers, threads = shared_out(request.workers, request.threads)
        set_thread_count(threads)  # an image takes here what it will take there
        workers = undisturbed(workers, threads)
    print(f"estimate:  {estimate(left, workers)}")


def _print_plan(name: str, grid: Grid, folder: Path) -> None:
    print(f"{name}: {len(grid.measurements())} measurements:", end=" ")
    print(
        f"{len(grid.scenes)} scenes × {len(grid.environments)} maps × "
        f"{len(grid.samplers)} samplers × {len(grid.budgets)} budgets, up to {grid.seeds} seeds; "
        f"{len(grid.scenes) * len(grid.environments)} references"
    )
    print(f"scenes:    {', '.join(name_and_file(scene)[0] for scene in grid.scenes)}")
    print(f"maps:      {', '.join(source.name for source in grid.environments)}")
    print(f"samplers:  {', '.join(spec.label for spec in grid.samplers)}")
    print(f"budgets:   {', '.join(map(str, grid.budgets))}")
    print(f"folder:    {folder}{os.sep}")
