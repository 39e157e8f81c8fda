"""Running a study: the rows that are missing are measured group by group, and kept one by one.

Rows that the folder holds already at the same identity are not measured again; when only some of a
group are missing, those alone are interleaved with each other. Rows that older starts finished and
that the programs as they are now would measure alike stay in the tables beside those of a narrower
start.
"""

import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from experiments.maps.sources import (
    EMBEDDED,
    EnvironmentSource,
    check_environments,
    find_environments,
    repair_sentence,
)
from experiments.run import time_spent
from experiments.run.bench import LOAD, load_average
from experiments.run.experiment import Group, Job, Row, Study
from experiments.run.identity import digest
from experiments.run.loaded_run import Run
from experiments.run.machine import record
from experiments.run.methods import methods_digest
from experiments.run.record import (
    check_run_folder,
    merged,
    read_record,
    stale_sentence,
    write_run,
)
from experiments.run.request import RunRequest, WatchedRequest
from experiments.run.runner import run_folder, spent_before
from experiments.run.status import INTERRUPTED
from experiments.run.store import DATABASE, Planned, Store
from experiments.run.time_spent import REPORT
from samplers import EnvlightError

NOTE = "note"
"""A row with a note was skipped for that reason; printed, not stored."""
SHARED = ("experiment", "source", "libraries", "machine")
"""What the identities of all rows of a study have alike."""
Finish = Callable[[Study, Run], list[Path]]


def study_environments(request: RunRequest, own: list[str], height: int) -> list[EnvironmentSource]:
    """The maps to measure on; where the request names none, `own` of the embedded ones."""
    patterns = request.maps or (own if request.environments == EMBEDDED else [])
    return find_environments(request.environments, patterns, height, request.repair)


def run_study(study: Study, request: RunRequest, dry_run: bool, finish: Finish) -> int:
    """Measure what is missing, then report; returns the exit status."""
    folder = run_folder(request.output, study.name, request.scale)
    groups = _groups(study, request)
    check_run_folder(folder, study.name, request.scale)
    if dry_run:
        _print_plan(study, groups, folder)
        return 0
    repairs = _repairs(request)
    machine = {**record(), "methods": methods_digest()}
    jobs = {digest(study.identity(job)): job for group in groups for job in group.jobs.values()}
    keys = list(jobs)
    with Store.writing(folder) as store:
        everything, stale = _with_earlier(study, jobs, store, machine["methods"])
        if stale:
            print(stale_sentence(stale, folder), file=sys.stderr)
        store.begin_session(machine, [Planned(key) for key in everything])
        try:
            measured, left_out, failures = _measure(study, groups, store)
        except KeyboardInterrupt:
            done = sum(store.get("row", key) is not None for key in keys)
            print(
                f"envlight: interrupted; {done} of {len(keys)} rows are finished and kept in "
                f"{folder}; the same command goes on with the others",
                file=sys.stderr,
            )
            return INTERRUPTED
        found = [store.get("row", key) for key in everything]
        own = [key for key in keys if store.get("row", key) is not None]
    left_out += _left_out_before(folder, jobs.values())
    rows = pd.DataFrame([*(row for row in found if row is not None), *left_out])
    for failure in failures:
        print(f"envlight: failed: {failure}", file=sys.stderr)
    if not own:
        return 1
    before = spent_before(folder)
    write_run(folder, rows, _facts(study, request, groups, machine, repairs))
    with time_spent.on(REPORT):
        files = finish(study, Run.load(folder))
    time_spent.tell(folder, before)
    stored = len(rows) - measured - len(left_out)
    print(f"{measured} rows measured, {stored} were stored already", end="")
    print(f", {len(left_out)} left out" if left_out else "")
    print("written:   " + ", ".join(str(file) for file in files))
    return 1 if failures else 0


def _repairs(request: RunRequest) -> dict[str, str]:
    """What was repaired in the maps that are named, by the map's name; it is told, too."""
    if not request.repair or request.environments == EMBEDDED:
        return {}
    named = find_environments(request.environments, request.maps, 0, True)
    found = check_environments(named).repaired
    for name, repair in found.items():
        print(repair_sentence(name, repair), file=sys.stderr)
    return {name: str(repair) for name, repair in found.items()}


def _with_earlier(
    study: Study, jobs: dict[str, Job], store: Store, methods: str
) -> tuple[list[str], int]:
    """The keys of the jobs and of what older starts finished besides and is as it would be now; and
    how many rows are not.

    They come in the order of the older start, unless the jobs have all that it had.
    """
    now = {json.dumps(job.columns, sort_keys=True): key for key, job in jobs.items()}
    common = study.identity(Job({}))
    same_methods = (store.sessions() or [{}])[-1].get("methods") == methods
    before, stale = [], 0
    for one in store.plan():
        identity = store.identity("row", one.key)
        if one.key in jobs:
            before.append(one.key)
        elif identity is not None:
            again = now.get(json.dumps(identity["parameters"], sort_keys=True))
            told = same_methods or not identity["depends_on"]
            if again or (told and all(identity[name] == common[name] for name in SHARED)):
                before.append(again or one.key)
            else:
                stale += 1
    return merged(before, list(jobs)), stale


def _left_out_before(folder: Path, jobs: Iterable[Job]) -> list[Row]:
    """The rows that an earlier start left out, but for those of the jobs."""
    try:
        rows = Run.load(folder).rows
    except EnvlightError:  # there is none, or it is made anew from the store
        return []
    if NOTE not in rows:
        return []
    found = [
        {str(name): value for name, value in row.items() if pd.notna(value)}
        for row in rows[rows[NOTE].notna()].to_dict("records")
    ]
    own = [job.columns.items() for job in jobs]
    return [row for row in found if not any(columns <= row.items() for columns in own)]


def _groups(study: Study, request: RunRequest) -> list[Group]:
    """What is to be measured; EnvlightError where an option would have no effect on it."""
    watched = WatchedRequest(request)
    groups = study.groups(watched)
    if ignored := watched.unread():
        raise EnvlightError(
            f"experiment '{study.name}' has no use for {', '.join(ignored)} here; leave that out"
        )
    return groups


def _facts(
    study: Study, request: RunRequest, groups: list[Group], machine: Row, repairs: dict[str, str]
) -> Row:
    """What `run.json` says of a study: its options set it up again, its keys tell rows apart."""
    keys = [name for group in groups for job in group.jobs.values() for name in job.columns]
    before = read_record(run_folder(request.output, study.name, request.scale))
    keys = merged(before.get("keys", []), keys)
    options = asdict(request)
    del options["output"]
    return {
        "experiment": study.name, "request": options, "keys": keys,
        "machine": machine, "repairs": before.get("repairs", {}) | repairs,
    }  # fmt: skip


def show_study(store: Store) -> None:
    """Print how much of the newest start is finished, and the report that it left."""
    plan = store.plan()
    done = sum(store.get("row", one.key) is not None for one in plan)
    print(f"{store.folder}: {done} of {len(plan)} rows of the newest start are finished")
    for file in sorted(store.folder.glob("*.md")):
        print("\n" + file.read_text(encoding="utf-8"))


def _measure(study: Study, groups: list[Group], store: Store) -> tuple[int, list[Row], list[str]]:
    """Measure and commit the missing rows; returns how many, the rows left out, and failures.

    A group that fails is told and keeps nothing.
    """
    measured, left_out, failures = 0, [], []
    for group in groups:
        missing = _missing(study, group, store)
        if not missing:
            continue
        print(f"{study.name}: {group.label}: {len(missing)} rows", file=sys.stderr)
        load = load_average()
        try:
            results = group.measure(list(missing))
        except Exception as error:
            kind = "" if isinstance(error, EnvlightError) else f"{type(error).__name__}: "
            failures.append(f"{group.label}: {kind}{error}")
            continue
        for name in missing:
            row = {**group.jobs[name].columns, **results[name], LOAD: load}
            if NOTE in row:
                left_out.append(row)
                continue
            store.put("row", digest(missing[name]), missing[name], row)
            measured += 1
        group.keep(store)
    return measured, left_out, failures


def _missing(study: Study, group: Group, store: Store) -> dict[str, Row]:
    """The identities of the group's rows that are not stored, by the jobs' names."""
    identities = {name: study.identity(job) for name, job in group.jobs.items()}
    return {name: i for name, i in identities.items() if store.get("row", digest(i)) is None}


def _print_plan(study: Study, groups: list[Group], folder: Path) -> None:
    count = sum(len(group.jobs) for group in groups)
    print(f"{study.name}: {count} rows in {len(groups)} groups")
    for group in groups:
        print(f"  {group.label}: {', '.join(group.jobs)}")
    print(f"folder:    {folder}")
    left = count
    if (folder / DATABASE).is_file():
        with Store.reading(folder) as store:
            left = sum(len(_missing(study, group, store)) for group in groups)
    print(f"left:      {left} rows")
