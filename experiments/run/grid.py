"""The plan of a grid experiment: cases, each a reference and the measurements that need it.

Measurements with a budget of seconds come last, when nothing else runs, in the process that writes,
whatever the executor: their times are of one machine and can be compared.
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import groupby
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.maps.sources import check_environments, repair_sentence
from experiments.progress import telling
from experiments.run.case import Case
from experiments.run.estimate import Left, estimate
from experiments.run.executors import DASK, PROCESSES, Job, shared_out, undisturbed
from experiments.run.experiment import GridExperiment, RunRequest
from experiments.run.identity import Shared
from experiments.run.kept_images import (
    has_reference,
    link_case,
    link_image,
    reference_path,
    stored_image,
)
from experiments.run.loaded_run import merged, read_record
from experiments.run.measure import (
    Measured,
    MeasurementTask,
    ReferenceTask,
    measure,
    measure_reference,
)
from experiments.run.measurement import NAMES, Measurement
from experiments.run.runner import Group, Plan, Present, Runner, starts_of
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import (
    FEATURES,
    IMAGE,
    PIXELS,
    REFERENCE,
    Planned,
    Store,
    Stored,
    StoreError,
)
from experiments.run.timed import measure_timed
from samplers import EnvlightError
from samplers.threads import set_thread_count

ORDER = ["scale", "scene", "environment", "budget", "sampler", "seed", "key"]


def in_fixed_order(rows: pd.DataFrame) -> pd.DataFrame:
    """A grid's rows in the order of what they measure, whichever was measured first."""
    return rows.sort_values(ORDER, kind="stable", ignore_index=True) if len(rows) else rows


@dataclass(frozen=True, eq=False)
class CaseGroup(Group):
    """A case's measurements.

    images : whether images are kept; timeout : seconds that one may take, 0 for any
    measure, reference : what is sent to the executor
    """

    case: Case
    tasks: Sequence[Measurement]
    images: bool = True
    timeout: float = 0.0
    measure: Callable[[Any], Any] = measure
    reference: Callable[[Any], Any] = measure_reference

    def __str__(self) -> str:
        return str(self.case)

    @cached_property
    def _scores(self) -> dict[str, Shared]:
        return self.case.score_identities

    def planned(self) -> list[Planned]:
        case = self.case
        scores = tuple(shared.key for shared in self._scores.values())
        features = tuple(case.features_keys.values())
        reference = case.reference_key
        return [Planned(one.key, reference, scores, features) for one in self.tasks]

    def missing(self, store: Store) -> list[Measurement]:
        """The measurements whose row is not whole, or whose image is to be kept and is not."""
        finished = store.finished(self.planned())
        return [
            one
            for one, there in zip(self.tasks, finished, strict=True)
            if not (there and (not self.images or stored_image(store.folder, one.key).is_file()))
        ]

    def begin(self, missing: list[Measurement], runner: Runner) -> list[Job]:
        """The measurements where the case's reference is there, or else the reference."""
        store = runner.store
        stored = store.get(self.case.reference_key)
        if stored and has_reference(store.folder, self.case, stored.result):
            return self._jobs(missing, stored.result, runner)
        runner.told.working_on(f"reference of {runner.told.what}")
        task = ReferenceTask(self.case, str(store.folder.absolute()))
        return [Job(self.reference, task, partial(self._keep_reference, missing, runner))]

    def _keep_reference(
        self, missing: list[Measurement], runner: Runner, future: Future
    ) -> list[Job]:
        """Store the row of a reference; the measurements that it allows."""
        case, store = self.case, runner.store
        try:
            row = future.result()
            stored = store.get(case.reference_key)
            if stored is not None and row[PIXELS] != stored.result[PIXELS]:
                raise EnvlightError(
                    f"{store.folder}: the reference image of {case} was lost, and rendering it "
                    "again gives another one; restore the folder, or give another by --store"
                )
            store.put(REFERENCE, case.reference_key, case.reference_identity, row)
            runner.told.working_on(str(case))
        except StoreError:
            raise
        except Exception as error:
            return runner.fail(missing, error)
        return self._jobs(missing, row, runner)

    def _jobs(
        self, missing: list[Measurement], reference: dict[str, Any], runner: Runner
    ) -> list[Job]:
        tasks = self._tasks(missing, reference["noise_floor"], runner.store)
        timed = [
            task
            for task in tasks
            if task.measurement.budget.timed and not (task.rendered or task.count)
        ]
        for budget in dict.fromkeys(task.measurement.budget for task in timed):
            of_budget = [task for task in timed if task.measurement.budget == budget]
            then = partial(self._keep_timed, of_budget, runner)
            runner.alone.append((f"{self.case}, {budget}", Job(measure_timed, of_budget, then)))
        return [
            Job(self.measure, task, partial(self._keep, task, runner))
            for task in tasks
            if not task.measurement.budget.timed or task.rendered or task.count
        ]

    def _tasks(
        self, missing: list[Measurement], floor: float, store: Store
    ) -> list[MeasurementTask]:
        """What is missing of each measurement."""
        case, folder = self.case, str(store.folder.absolute())
        features = tuple(name for name, key in case.features_keys.items() if not store.get(key))
        found, keys = store.find(one.key for one in missing), self._scores.items()
        tasks = []
        for one in missing:
            stored = found.get(one.key)
            scores = stored.scores if stored else {}
            metrics = tuple(name for name, shared in keys if shared.key not in scores)
            count, pixels, rendered = 0, "", False
            if stored is not None:
                row = stored.result
                count, pixels = row["count"], row[PIXELS]
                there = stored_image(store.folder, one.key).is_file()
                rendered = there or not (metrics or self.images)
            found_now = count, features, pixels, self.timeout
            tasks.append(
                MeasurementTask(one, folder, floor, self.images, metrics, rendered, *found_now)
            )
        return tasks

    def _keep(self, task: MeasurementTask, runner: Runner, future: Future) -> None:
        """Store an image's row, unless there is one, and its scores, together."""
        case = self.case
        try:
            found: Measured = future.result()
            for name, row in found.features.items():
                key, identity = case.features_keys[name], case.features_identities[name]
                runner.store.put(FEATURES, key, identity, row)
            shared = self._scores
            scores = {shared[name].key: row for name, row in found.scores.items()}
            runner.keep(IMAGE, task.measurement, found.image, scores, shared.values())
        except StoreError:
            raise
        except Exception as error:
            runner.fail([task.measurement], error)

    def _keep_timed(self, tasks: list[MeasurementTask], runner: Runner, future: Future) -> None:
        try:
            measured: list[Future] = future.result()
        except Exception as error:
            runner.fail([task.measurement for task in tasks], error)
            return
        for task, row in zip(tasks, measured, strict=True):
            self._keep(task, runner, row)

    def show(self, store: Store) -> None:
        link_case(store.folder, store.run, self.case)
        for one in self.tasks if self.images else ():
            link_image(store.folder, store.run, one)


def case_groups(
    measurements: Iterable[Measurement], images: bool = True, timeout: float = 0.0
) -> list[CaseGroup]:
    """The measurements by cases, which must follow one another."""
    cases = groupby(measurements, key=lambda one: one.case)
    return [CaseGroup(case, list(members), images, timeout) for case, members in cases]


@dataclass(frozen=True, eq=False)
class GridPlan(Plan):
    """What a start of a grid experiment is about.

    told : what the record says of maps, by their names: `bad_maps` that were left out, `repairs` of
        values, maps that look `clipped`
    """

    experiment: GridExperiment
    groups: list[CaseGroup]
    told: dict[str, dict[str, str]] = field(default_factory=dict)

    @property
    def scale(self) -> str:
        return self.groups[0].case.scale.name

    @property
    def incomplete(self) -> bool:  # type: ignore[override]
        return bool(self.told["bad_maps"])

    def tasks(self) -> Iterator[Measurement]:
        return (one for group in self.groups for one in group.tasks)

    def samplers(self, missing: Sequence[Measurement]) -> Iterable[SamplerSpec]:
        return dict.fromkeys(one.sampler for one in missing)

    def names_of(self, stored: Stored) -> tuple[Any, ...]:
        row = stored.result
        return tuple(row[name] for name in NAMES)

    def is_current(self, present: Present, one: Planned, stored: Stored, same: bool) -> bool:
        """Whether image, reference and scores are what they would be now."""
        scale, identity = self.groups[0].case.scale, stored.identity
        case = present.store.shared(identity["case"])
        if not isinstance(case, dict) or "programs" not in case:
            return False
        alike = case["view"] == [scale.width, scale.height, scale.subpixels]
        return alike and identity["sets"] == scale.sets and present.has(one, stored)

    def in_order(self, rows: pd.DataFrame) -> pd.DataFrame:
        return in_fixed_order(rows)

    def facts(self, store: Store, rows: pd.DataFrame, started: dict[str, Any]) -> dict[str, Any]:
        there, scale = set(rows["key"]), self.groups[0].case.scale
        missing: dict[str, list[str]] = {}
        for group in self.groups:
            lacking = (one.sampler.label for one in group.tasks if one.key not in there)
            for label in dict.fromkeys(lacking):
                missing.setdefault(label, []).append(str(group.case))
        samplers = list(dict.fromkeys(one.sampler.label for one in self.tasks()))
        budgets = list(dict.fromkeys(str(one.budget) for one in self.tasks()))
        own = {one.key for one in self.tasks()}
        kept, told = sum(one.key not in own for one in store.plan), self.told
        of_files = (one.sampler.sampler for one in self.tasks() if one.sampler.content)
        labels = {sampler.name: sampler.label for sampler in of_files}
        if kept:
            before = read_record(store.run)
            samplers = _shown(before.get("samplers", []), samplers, rows["sampler"])
            budgets = _shown(before.get("budgets", []), budgets, rows["budget"])
            for name, cases in gaps(rows).items():
                missing[name] = merged(missing.get(name, []), cases)
            labels = before.get("labels", {}) | labels
            mine = {group.case.environment.name for group in self.groups} | set(told["bad_maps"])
            for name, of in told.items():
                others = {
                    one: what for one, what in before.get(name, {}).items() if one not in mine
                }
                told = told | {name: others | of}
        return {
            "experiment": self.experiment.name,
            "scale": {
                "name": scale.name, "width": scale.width, "height": scale.height,
                "subpixels": scale.subpixels, "sets": scale.sets,
            },
            "samplers": list(dict.fromkeys([*samplers, *rows["sampler"].unique()])),
            "labels": labels,
            "budgets": list(dict.fromkeys([*budgets, *rows["budget"].unique()])),
            "planned": len(own) + kept,
            "missing": missing,
            **starts_of(store, rows),
            **told,
        }  # fmt: skip

    def tell(self, store: Store | None, request: RunRequest, folder: Path) -> None:
        """Print what a start would be about, what of it is left, and how long that would take."""
        tasks = list(self.tasks())
        scenes = list(dict.fromkeys(group.case.scene for group in self.groups))
        maps = list(dict.fromkeys(group.case.environment.name for group in self.groups))
        samplers = list(dict.fromkeys(one.sampler.label for one in tasks))
        budgets = list(dict.fromkeys(str(one.budget) for one in tasks))
        seeds = 1 + max(one.seed for one in tasks)
        print(
            f"{self.experiment.name}: {len(tasks)} measurements: {len(scenes)} scenes × "
            f"{len(maps)} maps × {len(samplers)} samplers × {len(budgets)} budgets, up to {seeds} "
            f"seeds; {len(self.groups)} references"
        )
        for name, values in {
            "scenes": scenes, "maps": maps, "samplers": samplers, "budgets": budgets,
        }.items():  # fmt: skip
            print(f"{name + ':':<11}{', '.join(values)}")
        print(f"folder:    {folder}{os.sep}")
        left = left_to_do(self.groups, store)
        print(f"left:      {len(left.measurements)} measurements, {left.references} references")
        workers = 1
        if request.executor in (PROCESSES, DASK) and not request.cluster:
            workers, threads = shared_out(request.workers, request.threads)
            set_thread_count(threads)  # an image takes here what it will take there
            workers = undisturbed(workers, threads)
        with telling("estimating"):
            told = estimate(left, workers)
        print(f"estimate:  {told}")


def _shown(before: list[str], planned: list[str], measured: pd.Series) -> list[str]:
    """Labels in display order: what is planned or measured, and of those before no others."""
    there = {*planned, *measured}
    return merged([name for name in before if name in there], planned)


def case_names(rows: pd.DataFrame) -> pd.Series:
    """The case of each row, as it is told."""
    return rows["scene"] + " · " + rows["environment"]


def gaps(rows: pd.DataFrame) -> dict[str, list[str]]:
    """By sampler the cases that others have at the same budget."""
    missing: dict[str, dict[str, None]] = {}
    named = rows.assign(case=case_names(rows))
    for _, at_budget in named.groupby("budget"):
        there = list(at_budget["case"].unique())
        for sampler, of_sampler in at_budget.groupby("sampler"):
            found = set(of_sampler["case"])
            left = [case for case in there if case not in found]
            if left:
                missing.setdefault(str(sampler), {}).update(dict.fromkeys(left))
    return {sampler: list(cases) for sampler, cases in missing.items()}


def grid_plan(experiment: GridExperiment, request: RunRequest) -> GridPlan:
    """What is asked for, of maps that are good; what is wrong with the others is told."""
    grid = experiment.grid(request)
    for sentence in grid.left_out():
        print(f"envlight: {sentence}", file=sys.stderr)
    checked = check_environments(grid.environments, request.strict)
    for name, reason in checked.bad.items():
        print(f"envlight: map '{name}' is left out: {reason}", file=sys.stderr)
    for name, repair in checked.repaired.items():
        print(repair_sentence(name, repair), file=sys.stderr)
    for sentence in checked.clipped.values():
        print(sentence, file=sys.stderr)
    grid = replace(grid, environments=checked.good)
    groups = case_groups(grid.measurements(), request.images, request.timeout)
    repairs = {name: str(repair) for name, repair in checked.repaired.items()}
    told = {"bad_maps": checked.bad, "repairs": repairs, "clipped": checked.clipped}
    return GridPlan(experiment, groups, told)


def left_to_do(groups: Sequence[CaseGroup], store: Store | None) -> Left:
    """What a start would still do: all that the store has not."""
    if store is None:
        return Left([one for group in groups for one in group.tasks], len(groups))
    missing = [(group, tasks) for group in groups if (tasks := group.missing(store))]
    references = store.find(group.case.reference_key for group, _ in missing)
    there = sum(
        group.case.reference_key in references
        and reference_path(store.folder, group.case).is_file()
        for group, _ in missing
    )
    return Left([one for _, tasks in missing for one in tasks], len(missing) - there)
