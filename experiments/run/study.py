"""Experiments that are not grids of images: groups of rows, measured together, kept one by one.

A group is what must be measured side by side, such as all methods on one map. Each of its rows has
an identity: the parameters, the source that computes it and, for times, the machine. Rows that the
folder holds already at the same identity are not measured again; when only some of a group are
missing, those alone are interleaved with each other.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.maps.sources import EnvironmentSource, find_environments
from experiments.run.bench import LOAD, load_average
from experiments.run.identity import digest, library_versions, source_digest
from experiments.run.machine import machine_identity, record
from experiments.run.record import read_run, write_run
from experiments.run.runner import run_folder
from experiments.run.store import Store
from samplers import EnvlightError

if TYPE_CHECKING:
    from experiments.cli.commands import RunRequest

INTERRUPTED = 130
NOTE = "note"
"""A row with a note was left out for the reason it gives. It is told, not kept."""
Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """One row to measure.

    columns : its parameters, which stand in the row
    depends_on : what else determines the result, such as the source of a sampler
    """

    columns: Row
    depends_on: Row = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """Rows that are measured side by side.

    label : what is printed while it is measured
    jobs : the rows by name
    measure : from the names of the rows that are missing to their results
    """

    label: str
    jobs: dict[str, Job]
    measure: Callable[[Sequence[str]], dict[str, Row]]


@dataclass(frozen=True)
class Study:
    """An experiment.

    name : as in the catalogue
    sources : modules whose source, with all that it imports, determines the results
    groups : what is measured
    report : writes tables and plots into the folder, prints what matters; returns the files
    timed : whether results depend on the machine
    """

    name: str
    sources: tuple[str, ...]
    groups: list[Group]
    report: Callable[[pd.DataFrame, Path], list[Path]]
    timed: bool = True

    def identity(self, job: Job) -> Row:
        """All that determines a row."""
        machine = machine_identity() if self.timed else {}
        return {
            "experiment": self.name,
            "parameters": job.columns,
            "depends_on": job.depends_on,
            "source": source_digest(*self.sources),
            "libraries": library_versions(*self.sources),
            "machine": machine,
        }


def study_environments(
    request: "RunRequest", patterns: list[str], height: int
) -> list[EnvironmentSource]:
    """The maps to measure on; none where tables are made again, which takes rows alone."""
    if request.tabulate:
        return []
    return find_environments(request.environments, patterns, height, request.repair)


def run_study(study: Study, request: "RunRequest", dry_run: bool) -> int:
    """Measure what is missing, then report; returns the exit status."""
    folder = run_folder(request.output, study.name, request.scale)
    if dry_run:
        _print_plan(study, folder)
        return 0
    if request.tabulate:
        study.report(read_run(folder)[0], folder)
        return 0
    machine = record()
    keys = {
        digest(study.identity(job)): (group, name)
        for group in study.groups
        for name, job in group.jobs.items()
    }
    with Store.writing(folder) as store:
        store.begin_session(machine, list(keys))
        try:
            measured, left_out, failures = _measure(study, store)
        except KeyboardInterrupt:
            done = sum(store.get("measurement", key) is not None for key in keys)
            print(
                f"envlight: interrupted; {done} of {len(keys)} rows are finished and kept in "
                f"{folder}; the same command goes on with the others",
                file=sys.stderr,
            )
            return INTERRUPTED
        found = {key: store.get("measurement", key) for key in keys}
    rows = pd.DataFrame([*(row for row in found.values() if row is not None), *left_out])
    for failure in failures:
        print(f"envlight: failed: {failure}", file=sys.stderr)
    if len(rows) == len(left_out):
        return 1
    write_run(folder, rows, _facts(study, request, machine))
    files = study.report(read_run(folder)[0], folder)
    stored = len(rows) - measured - len(left_out)
    print(f"{measured} rows measured, {stored} were stored already", end="")
    print(f", {len(left_out)} left out" if left_out else "")
    print("written:   " + ", ".join(str(file) for file in files))
    return 1 if failures else 0


def _facts(study: Study, request: "RunRequest", machine: Row) -> Row:
    """What `run.json` says of a study: by its options it can be set up again."""
    options = asdict(request)
    for place in ("output", "tabulate"):
        del options[place]
    return {"experiment": study.name, "request": options, "machine": machine}


def show_study(store: Store) -> None:
    """Print how much of the newest start is finished, and the tables that it left."""
    plan = store.plan()
    done = sum(store.get("measurement", key) is not None for key in plan)
    print(f"{store.folder}: {done} of {len(plan)} rows of the newest start are finished")
    for file in sorted(store.folder.glob("*.md")):
        print("\n" + file.read_text(encoding="utf-8"))


def _measure(study: Study, store: Store) -> tuple[int, list[Row], list[str]]:
    """Measure and commit the missing rows; returns how many, the rows left out, and failures.

    A group that fails is told and keeps nothing.
    """
    measured, left_out, failures = 0, [], []
    for group in study.groups:
        identities = {name: study.identity(job) for name, job in group.jobs.items()}
        missing = [n for n, i in identities.items() if store.get("measurement", digest(i)) is None]
        if not missing:
            continue
        print(f"{study.name}: {group.label}: {len(missing)} rows", file=sys.stderr)
        load = load_average()
        try:
            results = group.measure(missing)
        except Exception as error:
            kind = "" if isinstance(error, EnvlightError) else f"{type(error).__name__}: "
            failures.append(f"{group.label}: {kind}{error}")
            continue
        for name in missing:
            row = {**group.jobs[name].columns, **results[name], LOAD: load}
            if NOTE in row:
                left_out.append(row)
                continue
            store.put("measurement", digest(identities[name]), identities[name], row)
            measured += 1
    return measured, left_out, failures


def _print_plan(study: Study, folder: Path) -> None:
    count = sum(len(group.jobs) for group in study.groups)
    print(f"{study.name}: {count} rows in {len(study.groups)} groups")
    for group in study.groups:
        print(f"  {group.label}: {', '.join(group.jobs)}")
    print(f"folder:    {folder}")
