"""Running an experiment: what its run has not is measured, and a report made from all that it has.

An experiment is a list of tasks, each with a key that tells all that determines its row. What the
store of the working folder has under a key already is taken, whichever run measured it; the rest is
measured, and every row committed as it comes. Tasks stand in groups, which know how they are begun:
a case's measurements behind its reference, on any `concurrent.futures.Executor`; the rows of a
study side by side, in this process. One process writes.

A folder's tables never shrink: what older starts of the experiment finished there, at the same
scale, stays in them beside what a narrower command measures. Only rows that the programs as they
are now would measure otherwise leave them, so that no table mixes two states of a method.
"""

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.progress import Told, telling
from experiments.run import INTERRUPTED
from experiments.run.bench import load_average
from experiments.run.executors import Job, SerialExecutor, run_jobs
from experiments.run.experiment import RunRequest
from experiments.run.identity import (
    ALONE,
    Shared,
    methods_digest,
    module_digest,
    source_digest,
    version_of,
)
from experiments.run.loaded_run import Run, merged, write_run
from experiments.run.machine import machine_identity, record
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import Planned, Store, Stored, StoreError
from experiments.run.warm_up import warm_up
from samplers.errors import EnvlightError, told
from samplers.files.from_file import PREFIX as FROM_FILE

FAILURES_PRINTED = 20
ROWS_AT_ONCE = 5_000
"""Rows that are made to columns together: as words and numbers of Python's they take more."""


def is_present(identity: dict[str, Any]) -> bool:
    """Whether the programs, libraries and machines of an identity are those of now.

    A map or scene from a file and a sampler in one are taken as they were: the store does not know
    where a file lies.
    """
    now: dict[str, Any]
    for name, then in identity.items():
        if not isinstance(then, dict):
            continue
        if name == "programs":
            now = {module: _program_now(module, digest) for module, digest in then.items()}
        elif name == "libraries":
            now = {library: version_of(library) for library in then}
        elif name == "machine":
            now = machine_identity() if then else {}
        elif is_present(then):
            continue
        else:
            return False
        if now != then:
            return False
    return True


def _program_now(module: str, then: str) -> str:
    if module.startswith(FROM_FILE):
        return then
    if module.endswith(ALONE):
        return module_digest(module.removesuffix(ALONE))
    return source_digest(module)


class Present:
    """Which rows of a store are what they would be now. What rows share is looked at once."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._known: dict[str, bool] = {}

    def has(self, one: Planned, stored: Stored) -> bool:
        """Whether a row's image, reference, scores and features are what they would be now."""
        parts = (one.reference, *one.scores, *one.features)
        return self._is_now(stored.identity) and all(map(self._stands, parts))

    def _is_now(self, identity: dict[str, Any]) -> bool:
        parts = (part for part in identity.values() if isinstance(part, str))
        return is_present(identity) and all(map(self._stands, parts))

    def _stands(self, key: str) -> bool:
        """Whether what a hash stands for is what it would be now; what is no hash is."""
        if key not in self._known:
            found = self.store.shared(key)
            if not isinstance(found, dict):
                result = self.store.get(key)
                found = result.identity if result else {}
            self._known[key] = self._is_now(found)
        return self._known[key]


class Group:
    """Tasks that are begun together; its text is what it is called while it works.

    A task makes a row. It has a `key`, the hash of its `identity`, and `names`, which tell it apart
    from others, whatever its programs.
    """

    tasks: Sequence[Any]

    def planned(self) -> list[Planned]:
        """The rows of all its tasks."""
        return [Planned(task.key) for task in self.tasks]

    def missing(self, store: Store) -> list[Any]:
        """The tasks that have something left to do."""
        finished = store.finished(self.planned())
        return [task for task, there in zip(self.tasks, finished, strict=True) if not there]

    def begin(self, missing: list[Any], runner: "Runner") -> Iterable[Job]:
        """The first jobs for these; they hand results to the runner."""
        raise NotImplementedError

    def show(self, store: Store) -> None:
        """Have the images that were kept in the run's folder, too."""


class Plan:
    """What a run is about: an experiment's groups, at a scale.

    incomplete : whether something that was asked for is no task
    """

    experiment: Any
    groups: Sequence[Any]
    incomplete: bool = False

    @property
    def scale(self) -> str:
        """Its name."""
        raise NotImplementedError

    @property
    def about(self) -> list[str]:
        """Experiment and scale."""
        return [self.experiment.name, self.scale]

    def samplers(self, missing: Sequence[Any]) -> Iterable[SamplerSpec]:
        """Those whose kernels the tasks need, unless they see to that themselves."""
        return ()

    def names_of(self, stored: Stored) -> Any:
        """The names of the task that a result is of."""
        raise NotImplementedError

    def is_current(self, present: Present, one: Planned, stored: Stored, same: bool) -> bool:
        """Whether a row is what would be measured now; `same` where it cannot be told."""
        raise NotImplementedError

    def left_out(self, store: Store) -> list[dict[str, Any]]:
        """Rows that say why there is no other."""
        return []

    def in_order(self, rows: pd.DataFrame) -> pd.DataFrame:
        """The rows as tables have them; as they were planned."""
        return rows

    def facts(self, store: Store, rows: pd.DataFrame, started: dict[str, Any]) -> dict[str, Any]:
        """What the record says of the run: see `loaded_run.Run`."""
        raise NotImplementedError

    def tell(self, store: Store | None, request: RunRequest, folder: Path) -> None:
        """Print what a start would be about, and what of it is left."""
        raise NotImplementedError


@dataclass
class Outcome:
    """What a run did.

    measured, stored : tasks done now, and found finished; left_out : rows that could not be
    failures : one sentence per task that failed
    """

    measured: int = 0
    stored: int = 0
    left_out: int = 0
    failures: list[str] = field(default_factory=list)


Finish = Callable[[Any, Run, Outcome], object]
"""Makes and prints the report of a finished run: given by the command line."""


class Runner:
    """Has the missing tasks of groups done, and stores what comes back.

    alone : jobs that wait until nothing else runs, and then run in this process, each by what is
        told of it meanwhile
    """

    def __init__(self, store: Store) -> None:
        self.store, self.outcome = store, Outcome()
        self.told = Told("measuring")
        self.alone: list[tuple[str, Job]] = []

    def run(
        self, left: Sequence[tuple[Group, list[Any]]], executor: Executor | None = None
    ) -> Outcome:
        """Do what is left of groups. A task that fails is reported, not stored.

        Raises StoreError where results cannot be stored any more.
        """
        count = sum(len(missing) for _, missing in left)
        self.outcome.stored = sum(len(group.tasks) for group, _ in left) - count
        todo = [one for one in left if one[1]]
        with telling("measuring", count) as self.told:
            lines = (self._begin(number, len(todo), *one) for number, one in enumerate(todo, 1))
            run_jobs(executor or SerialExecutor(), lines)
            run_jobs(SerialExecutor(), self._one_by_one())
        return self.outcome

    def _begin(self, number: int, count: int, group: Group, missing: list[Any]) -> list[Job]:
        self.told.working_on(f"case {number} of {count}, {group}")
        try:
            return list(group.begin(missing, self))
        except StoreError:
            raise
        except Exception as error:
            return self.fail(missing, error)

    def _one_by_one(self) -> Iterator[list[Job]]:
        for number, (what, job) in enumerate(self.alone, 1):
            self.told.working_on(f"timing {number} of {len(self.alone)}, {what}")
            yield [job]

    def keep(
        self,
        kind: str,
        task: Any,
        result: dict[str, Any] | None,
        scores: Mapping[str, dict[str, Any]] | None = None,
        shared: Iterable[Shared] = (),
    ) -> None:
        """Commit what a task gave: see `Store.put`."""
        self.store.put(kind, task.key, task.identity, result, scores, shared)
        self.outcome.measured += 1
        self.told.advance()

    def fail(self, tasks: Iterable[Any], error: Exception) -> list[Job]:
        """Note why tasks have no row; nothing follows from them."""
        for task in tasks:
            self.outcome.failures.append(f"{task}: {as_sentence(error)}")
            self.told.advance()
        return []


def as_sentence(error: Exception) -> str:
    """An error as it is told of a task."""
    if isinstance(error, OSError) and error.strerror:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror}; check the permissions and the space left"
    return " ".join(str(error).split()) if isinstance(error, EnvlightError) else told(error)


def run_plan(
    plan: Plan, store: Store, finish: Finish, executor: Executor | None = None, timeout: float = 0.0
) -> int:
    """Measure what is missing, write rows and record, and make the report; returns the status.

    timeout : seconds that preparing a sampler's kernels may take, 0 for as long as it needs
    """
    started = {**record(), "methods": methods_digest()}
    planned, stale = with_earlier(plan, store, started["methods"])
    if stale:
        print(
            f"envlight: {stale} rows in {store.run} were measured by other versions of the "
            "programs: they stay in its store, and not in its tables",
            file=sys.stderr,
        )
    store.begin(started, plan.about, planned)
    groups = plan.groups
    try:
        left = left_of(groups, store)
        missing = [task for _, tasks in left for task in tasks]
        warm_up(plan.samplers(missing), executor, timeout)
        outcome = Runner(store).run(left, executor)
        for failure in outcome.failures[:FAILURES_PRINTED]:
            print(f"envlight: failed: {failure}", file=sys.stderr)
        if len(outcome.failures) > FAILURES_PRINTED:
            more = len(outcome.failures) - FAILURES_PRINTED
            print(f"envlight: {more} more failed", file=sys.stderr)
        if outcome.stored + outcome.measured == 0:
            return 1
        outcome.left_out = write_rows(plan, store, started)
        finish(plan.experiment, Run.load(store.run), outcome)
        return 1 if outcome.failures else 0
    except KeyboardInterrupt:
        count = sum(len(missing) for _, missing in left_of(groups, store))
        tasks = sum(len(group.tasks) for group in groups)
        print(
            f"envlight: interrupted; {tasks - count} of {tasks} measurements are finished and kept "
            f"in {store.folder}; the same command resumes with the other {count}",
            file=sys.stderr,
        )
        raise SystemExit(INTERRUPTED) from None


def left_of(groups: Iterable[Group], store: Store) -> list[tuple[Group, list[Any]]]:
    """The groups with the tasks that the store has nothing whole of."""
    return [(group, group.missing(store)) for group in groups]


def write_rows(plan: Plan, store: Store, started: dict[str, Any]) -> int:
    """Write the rows and the record of a run, from which its report is made, and have its images
    in its folder; returns how many rows say why there is no other.
    """
    for group in plan.groups:
        group.show(store)
    left_out = plan.left_out(store)
    rows = plan.in_order(rows_of(store, left_out))
    write_run(store.run, rows, plan.facts(store, rows, started))
    return len(left_out)


def rows_of(store: Store, left_out: Sequence[dict[str, Any]] = ()) -> pd.DataFrame:
    """The whole rows of a run, in the order of its plan; what else the store holds stays out."""
    words: dict[str, str] = {}
    columns: dict[Any, list[pd.Series]] = {}
    rows, count = chain(store.rows(store.plan), left_out), 0
    while some := list(islice(rows, ROWS_AT_ONCE)):
        for row in some:
            for name, value in row.items():
                if isinstance(value, str) and name != "key":
                    row[name] = words.setdefault(value, value)  # each word once
        part = pd.DataFrame(some, index=range(count, count + len(some)))
        count += len(some)
        for column in part:
            columns.setdefault(column, []).append(part[column].copy())
    # Joined one by one: all at once they would be there several times.
    joined = {name: pd.concat(columns.pop(name)).reindex(range(count)) for name in list(columns)}
    return pd.DataFrame(joined, copy=False)


def with_earlier(plan: Plan, store: Store, methods: str) -> tuple[list[Planned], int]:
    """The plan's rows, and what older starts of the experiment finished besides and is as it would
    be now; and how many rows are not.

    methods : the digest of samplers, renderer and metrics as they are now

    They come in the order of the older start, unless the plan has all that it had.
    """
    planned = {one.key: one for group in plan.groups for one in group.planned()}
    before = store.plan if store.selection.about == plan.about else []
    others = [one for one in before if one.key not in planned]
    if not others:
        return list(planned.values()), 0
    keys = {task.names: task.key for group in plan.groups for task in group.tasks}
    there = store.finished(others)
    whole = {one.key: one for one, found in zip(others, there, strict=True) if found}
    records, present = store.starts(), Present(store)
    same = bool(records) and records[max(records)].get("methods") == methods
    stays = {key: key for key in planned}
    for stored in store.each(whole):
        one = whole[stored.key]
        if again := keys.get(plan.names_of(stored)):
            stays[one.key] = again
        elif plan.is_current(present, one, stored, same):
            stays[one.key] = one.key
    kept = [stays[one.key] for one in before if one.key in stays]
    everything = whole | planned
    stale = len(whole.keys() - stays.keys())
    return [everything[key] for key in merged(kept, list(planned))], stale


def starts_of(store: Store, rows: pd.DataFrame) -> dict[str, Any]:
    """What a record says of the starts that measured a grid's rows; of their loads the largest.

    machine : of the start that measured last, with the time of the first; parts : by commit, where
        there are several
    """
    counts, records = rows_by_start(store, rows["key"])
    parts: dict[str, dict[str, Any]] = {}
    for number, session in records.items():
        begun = {"rows": 0, "started": session["started"], "commit": session["commit"]}
        part = parts.setdefault(session["commit"], begun)
        part |= {"rows": part["rows"] + counts[number], "command": session["command"]}
    first, last = min(records), max(records)
    machine = {**records[last], "started": records[first]["started"]}
    loads = [session["load_average"] for session in records.values()]
    machine["load_average"] = float(pd.Series(loads, dtype=float).max())  # NaN where all are
    if last == max(store.selection.starts):
        machine["load_average_end"] = load_average()
    return {"machine": machine, **({"parts": list(parts.values())} if len(parts) > 1 else {})}


def rows_by_start(
    store: Store, keys: Iterable[str]
) -> tuple[dict[int, int], dict[int, dict[str, Any]]]:
    """How many of the rows each start measured, and its record, by its number, oldest first; rows
    whose start is not known any more count to the newest of this run.
    """
    counts = Counter(one.start for one in store.each(keys))
    records = store.starts(counts)
    newest = max(store.selection.starts)
    for number in counts.keys() - records.keys():
        records |= store.starts([newest])
        counts[newest] += counts.pop(number)
    return dict(sorted(counts.items())), records
