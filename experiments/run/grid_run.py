"""Running a grid experiment: what is missing is measured, then the report is made.

A folder's tables never shrink: what older starts of the experiment finished there, at the same
scale, stays in them beside what a narrower command measures. Only rows that the programs as they
are now would measure otherwise leave them, so that no table mixes two states of a method.
"""

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
from experiments.run.case import MAP_FEATURES, SCENE_FEATURES
from experiments.run.estimate import estimate
from experiments.run.executors import DASK, PROCESSES, make_executor, shared_out, undisturbed
from experiments.run.experiment import GridExperiment
from experiments.run.explain import differences, present
from experiments.run.grid import Grid
from experiments.run.identity import module_digest, source_digest
from experiments.run.left import Left, left_to_do
from experiments.run.loaded_run import Run
from experiments.run.machine import record
from experiments.run.measurement import JUDGING, Measurement
from experiments.run.methods import methods_digest
from experiments.run.progress import terminal_progress
from experiments.run.record import (
    about,
    check_run_folder,
    merged,
    read_record,
    stale_sentence,
    write_run,
)
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
from experiments.run.scale import Scale
from experiments.run.scene_choice import name_and_file
from experiments.run.status import INTERRUPTED
from experiments.run.store import Planned, Store
from experiments.run.time_spent import REPORT
from experiments.run.warm_up import warm_up
from metrics.registry import metrics
from samplers import EnvlightError
from samplers.threads import set_thread_count

ABOUT = "about"
"""What the record of a start calls its experiment and scale."""
NAMES = ("scene", "environment", "sampler", "budget", "seed")
"""What tells a measurement of an experiment at a scale apart from others, whatever its programs."""
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
    check_run_folder(folder, experiment.name, request.scale)
    if dry_run:
        _print_plan(experiment.name, grid, folder)
        _print_left(left_to_do(grid.measurements(), folder, request.images), request)
        return 0
    with (
        Store.writing(folder) as store,
        make_executor(
            request.executor,
            request.workers,
            request.threads,
            request.cluster,
            request.host,
            request.tls,
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
            request.timeout,
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
    timeout: float = 0.0,
    repairs: dict[str, str] | None = None,
) -> int:
    """Measure what is missing, write rows and record, and make the report; returns the status.

    beside : a folder of run folders whose references and measurements may be taken
    bad_maps : maps that were left out, and what is wrong with each; the report names them
    timeout : seconds that a measurement may take, 0 for as long as it needs
    repairs : what was repaired, by the map's name
    """
    machine = {**record(), "methods": methods_digest(), ABOUT: _about(experiment, measurements)}
    kept, stale = earlier(store, experiment, measurements, machine["methods"])
    if stale:
        print(stale_sentence(stale, store.folder), file=sys.stderr)
    store.begin_session(machine, [*map(planned, measurements), *kept])
    try:
        samplers = (one.sampler for one in missing_measurements(store, measurements))
        compiling = warm_up(samplers, executor, timeout)
        with terminal_progress() as progress:
            outcome = run_measurements(
                store, measurements, executor, progress, images, beside, timeout
            )
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
    rows = rows_of(store, store.plan())
    facts = _facts(experiment, store, measurements, rows)
    own = {one.case.environment.name for one in measurements} | set(bad_maps)
    told = {"bad_maps": bad_maps, "repairs": repairs or {}}
    if facts["planned"] > len(measurements):
        record = read_record(store.folder)
        for name, now in told.items():
            before = record.get(name, {}).items()
            told[name] = {one: what for one, what in before if one not in own} | now
    write_run(store.folder, rows, {**facts, **told})


def earlier(
    store: Store, experiment: GridExperiment, measurements: list[Measurement], methods: str
) -> tuple[list[Planned], int]:
    """What older starts of the experiment finished and these measurements do not make anew; and how
    many of those rows the programs as they are now would measure otherwise.

    methods : the digest of samplers, renderer and metrics as they are now
    """
    plan, session = store.plan(), (store.sessions() or [{}])[-1]
    if session.get(ABOUT, about(read_record(store.folder))) != _about(experiment, measurements):
        return [], 0
    scale = measurements[0].case.scale
    keys, own = {one.key for one in measurements}, {_names(one) for one in measurements}
    kept, stale, sources = [], 0, _score_sources()
    for one in plan:
        row = None if one.key in keys else store.measured(one)
        if row is None or tuple(row[name] for name in NAMES) in own:
            continue
        stored = {name: store.identity("score", key) for name, key in one.scores.items()}
        now = all(
            found.items() <= (stored.get(name) or {}).items() for name, found in sources.items()
        )
        identity = store.identity("image", one.key) or {}
        if now and _is_as_now(identity, scale, session.get("methods") == methods):
            kept.append(one)
        else:
            stale += 1
    return kept, stale


def _names(one: Measurement) -> tuple[Any, ...]:
    """What a measurement's row says under `NAMES`."""
    case = one.case
    return case.scene, case.environment.name, one.sampler.label, str(one.budget), one.seed


def _about(experiment: GridExperiment, measurements: list[Measurement]) -> list[str]:
    return [experiment.name, measurements[0].case.scale.name]


def _is_as_now(identity: dict[str, Any], scale: Scale, same_methods: bool) -> bool:
    """Whether an image is what would be rendered now at a scale.

    same_methods : what is taken where that cannot be told: of own scenes and samplers
    """
    view = [scale.width, scale.height, scale.subpixels]
    if (identity["case"]["view"], identity["sets"]) != (view, scale.sets):
        return False
    try:
        return not differences(identity, {**present(identity), "sets": scale.sets})
    except EnvlightError:
        return same_methods


def _score_sources() -> dict[str, dict[str, Any]]:
    """The programs in the identities of scores and features, by the metric or module."""
    judging = module_digest(JUDGING)
    found: dict[str, dict[str, Any]] = {
        metric.name: {"metric_source": source_digest(metric.module), "judging_source": judging}
        for metric in metrics()
    }
    for module in (MAP_FEATURES, SCENE_FEATURES):
        found[module] = {"features_source": source_digest(module)}
    return found


def gaps(rows: pd.DataFrame) -> dict[str, list[str]]:
    """By sampler the cases that others have at the same budget."""
    missing: dict[str, dict[str, None]] = {}
    named = rows.assign(case=rows["scene"] + " · " + rows["environment"])
    for _, at_budget in named.groupby("budget"):
        there = list(at_budget["case"].unique())
        for sampler, of_sampler in at_budget.groupby("sampler"):
            found = set(of_sampler["case"])
            left = [case for case in there if case not in found]
            if left:
                missing.setdefault(str(sampler), {}).update(dict.fromkeys(left))
    return {sampler: list(cases) for sampler, cases in missing.items()}


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
    samplers = [one.sampler.label for one in measurements]
    budgets = [str(one.budget) for one in measurements]
    keys = {one.key for one in measurements}
    kept = [one for one in store.plan() if one.key not in keys]
    if kept:
        before = read_record(store.folder)
        samplers = _shown(before.get("samplers", []), samplers, rows["sampler"])
        budgets = _shown(before.get("budgets", []), budgets, rows["budget"])
        missing |= {
            name: merged(missing.get(name, []), cases) for name, cases in gaps(rows).items()
        }
    return {
        "experiment": experiment.name,
        "scale": {
            "name": scale.name, "width": scale.width, "height": scale.height,
            "subpixels": scale.subpixels, "sets": scale.sets,
        },
        "samplers": list(dict.fromkeys(samplers)),
        "budgets": list(dict.fromkeys(budgets)),
        "planned": len(measurements) + len(kept),
        "missing": missing,
        **_starts(store, rows),
    }  # fmt: skip


def _shown(before: list[str], planned: list[str], measured: pd.Series) -> list[str]:
    """Labels in display order: what is planned or measured, and of those before no others."""
    there = {*planned, *measured}
    return [*merged([name for name in before if name in there], planned), *measured]


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
    machine.pop(ABOUT, None)
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
