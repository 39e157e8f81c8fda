"""The plan of a study: rows that are no grid's, measured group by group in this process.

When only some rows of a group are missing, those alone are measured side by side. A row with a note
says why it could not be measured; it is told, not stored, and tried again.
"""

import os
import sys
from concurrent.futures import Future
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.maps.sources import (
    EMBEDDED,
    EnvironmentSource,
    check_environments,
    find_environments,
    repair_sentence,
)
from experiments.run.bench import LOAD, load_average
from experiments.run.executors import Job
from experiments.run.experiment import Group, Row, RunRequest, Study, WatchedRequest
from experiments.run.identity import as_json, digest
from experiments.run.loaded_run import Run, merged, read_record
from experiments.run.runner import Group as TaskGroup
from experiments.run.runner import Plan, Present, Runner, as_sentence
from experiments.run.store import ROW, Planned, Store, Stored, StoreError
from samplers import EnvlightError

SHARED = ("experiment", "programs", "libraries", "machine")
"""What the identities of all rows of a study have alike."""
NOTE = "note"
"""A row with a note was skipped for that reason; printed, not stored."""


def study_environments(request: RunRequest, own: list[str], height: int) -> list[EnvironmentSource]:
    """The maps to measure on; where the request names none, `own` of the embedded ones."""
    patterns = request.maps or (own if request.environments == EMBEDDED else [])
    return find_environments(request.environments, patterns, height, request.repair)


@dataclass(frozen=True, eq=False)
class StudyTask:
    """A row of a study. name : what differs from the other rows of its group; see `Group.asked`"""

    study: Study
    name: str
    columns: Row
    depends_on: Row
    work: Any

    @cached_property
    def identity(self) -> Row:
        """All that determines the row."""
        return self.study.identity(self.columns, self.depends_on)

    @cached_property
    def key(self) -> str:
        return digest(self.identity)

    @property
    def names(self) -> str:
        """Its parameters."""
        return as_json(self.columns)


@dataclass(frozen=True, eq=False)
class StudyGroup(TaskGroup):
    """Rows that are measured side by side. left_out : those that say why there is no other"""

    group: Group
    tasks: list[StudyTask]
    left_out: list[Row] = field(default_factory=list)

    def __str__(self) -> str:
        return self.group.label

    def begin(self, missing: list[StudyTask], runner: Runner) -> list[Job]:
        """Measure the rows together, when nothing else runs."""

        def kept(future: Future) -> None:
            self._keep(missing, runner, future)

        runner.alone.append((str(self), Job(self._measure, missing, kept)))
        return []

    def _measure(self, missing: list[StudyTask]) -> list[Row]:
        load = load_average()
        results = self.group.measure([task.work for task in missing])
        return [
            {**task.columns, **row, LOAD: load} for task, row in zip(missing, results, strict=True)
        ]

    def _keep(self, missing: list[StudyTask], runner: Runner, future: Future) -> None:
        """Commit the rows; those of a group that fails are not there."""
        try:
            rows = future.result()
        except StoreError:
            raise
        except Exception as error:
            runner.outcome.failures.append(f"{self}: {as_sentence(error)}")
            return
        for task, row in zip(missing, rows, strict=True):
            if NOTE in row:
                self.left_out.append(row)
            else:
                runner.keep(ROW, task, row)


@dataclass(frozen=True, eq=False)
class StudyPlan(Plan):
    """What a start of a study is about. repairs : what was repaired, by the map's name"""

    experiment: Study
    request: RunRequest
    groups: list[StudyGroup]
    repairs: dict[str, str]

    @property
    def scale(self) -> str:
        return self.request.scale

    def names_of(self, stored: Stored) -> str:
        return as_json(stored.identity["parameters"])

    def is_current(self, present: Present, one: Planned, stored: Stored, same: bool) -> bool:
        identity, now = stored.identity, self.experiment.identity({}, {})
        told = same or not identity["depends_on"]
        return told and all(identity.get(name) == now[name] for name in SHARED)

    def left_out(self, store: Store) -> list[Row]:
        """The rows that this start left out, and those of earlier ones but for its own tasks."""
        now = [row for group in self.groups for row in group.left_out]
        try:
            rows = Run.load(store.run).rows
        except EnvlightError:  # there is none, or it is made anew from the store
            return now
        if NOTE not in rows:
            return now
        found = [
            {str(name): value for name, value in row.items() if pd.notna(value)}
            for row in rows[rows[NOTE].notna()].to_dict("records")
        ]
        own = [task.columns.items() for group in self.groups for task in group.tasks]
        return [*now, *(row for row in found if not any(one <= row.items() for one in own))]

    def facts(self, store: Store, rows: pd.DataFrame, started: Row) -> Row:
        """What `run.json` says: its options set it up again, its keys tell rows apart."""
        keys = [name for group in self.groups for task in group.tasks for name in task.columns]
        before = read_record(store.run)
        options = asdict(self.request)
        del options["output"], options["store"]
        return {
            "experiment": self.experiment.name, "request": options,
            "keys": merged(before.get("keys", []), keys), "machine": started,
            "repairs": before.get("repairs", {}) | self.repairs,
        }  # fmt: skip

    def tell(self, store: Store | None, request: RunRequest, folder: Path) -> None:
        groups = self.groups
        count = sum(len(group.tasks) for group in groups)
        print(f"{self.experiment.name}: {count} rows in {len(groups)} groups")
        for group in groups:
            print(f"  {group}: {', '.join(task.name for task in group.tasks)}")
        print(f"folder:    {folder}{os.sep}")
        left = count if store is None else sum(len(group.missing(store)) for group in groups)
        print(f"left:      {left} rows")


def study_plan(study: Study, request: RunRequest) -> StudyPlan:
    """What is to be measured; EnvlightError where an option would have no effect on it."""
    watched = WatchedRequest(request)
    groups = study.groups(watched)
    if ignored := watched.unread():
        raise EnvlightError(
            f"experiment '{study.name}' has no use for {', '.join(ignored)} here; leave that out"
        )
    own = [StudyGroup(one, _tasks(study, one)) for one in groups]
    return StudyPlan(study, request, own, _repairs(request))


def _tasks(study: Study, group: Group) -> list[StudyTask]:
    """The rows of a group, named by their own parameters."""
    tasks = []
    for own, depends_on, work in group.asked:
        name = " ".join(map(str, own.values())) or group.label
        columns, depends_on = group.columns | own, group.depends | depends_on
        tasks.append(StudyTask(study, name, columns, depends_on, work))
    return tasks


def _repairs(request: RunRequest) -> dict[str, str]:
    """What was repaired in the maps that are named, by the map's name; it is told, too."""
    if not request.repair or request.environments == EMBEDDED:
        return {}
    named = find_environments(request.environments, request.maps, 0, True)
    found = check_environments(named).repaired
    for name, repair in found.items():
        print(repair_sentence(name, repair), file=sys.stderr)
    return {name: str(repair) for name, repair in found.items()}
