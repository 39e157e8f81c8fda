"""Running measurements: what is stored already is left alone, the rest is measured and committed.

Tasks go to any `concurrent.futures.Executor`; results come back to the one process that writes. A
case's reference goes first, then its measurements. The default executor works in this process,
where kernels already use all cores.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, Protocol

from experiments.run import time_spent
from experiments.run.case import Case
from experiments.run.kept_images import has_reference, image_path
from experiments.run.measure import (
    Measured,
    MeasurementTask,
    ReferenceTask,
    measure,
    measure_reference,
)
from experiments.run.measurement import Measurement
from experiments.run.record import read_record
from experiments.run.schedule import Job, run_jobs
from experiments.run.shared_results import take_measurements, take_reference
from experiments.run.store import PIXELS, Planned, Store, StoreError
from experiments.run.time_spent import KEEPING, Seconds, added, handing_over
from experiments.run.timed import measure_timed
from metrics.registry import find_metric
from samplers import EnvlightError


class Progress(Protocol):
    """What the runner tells while it works."""

    def begin(self, total: int, stored: int) -> None: ...
    def working_on(self, what: str) -> None: ...
    def advance(self) -> None: ...


class SilentProgress:
    """No output at all."""

    def begin(self, total: int, stored: int) -> None: ...
    def working_on(self, what: str) -> None: ...
    def advance(self) -> None: ...


class SerialExecutor(Executor):
    """Runs each task at once, in the calling thread."""

    slots = 1

    def submit(self, fn, /, *args, **kwargs) -> Future:
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@dataclass
class Outcome:
    """What a run did.

    measured, stored : measurements measured now, and found finished
    failures : one sentence per measurement that could not be measured
    elsewhere : processor seconds by kind of work that other processes used for it
    """

    measured: int = 0
    stored: int = 0
    failures: list[str] = field(default_factory=list)
    elsewhere: Seconds = field(default_factory=dict)


def planned(measurement: Measurement) -> Planned:
    """What the store is asked for a measurement's row."""
    case = measurement.case
    parts = {**measurement.score_keys, **case.features_keys}
    return Planned(measurement.key, case.reference_key, parts)


def missing_measurements(store: Store, measurements: Iterable[Measurement]) -> list[Measurement]:
    """The measurements whose row is not whole, in their order."""
    return [one for one in measurements if store.measured(planned(one)) is None]


def run_measurements(
    store: Store,
    measurements: list[Measurement],
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep_images: bool = True,
    beside: Path | None = None,
    timeout: float = 0.0,
) -> Outcome:
    """Measure what is not stored yet. A measurement that fails is reported, not stored.

    Where an image is kept, only its missing scores are made. Measurements with a budget of seconds
    come last, when nothing else runs, in this process whatever the executor: their times are of
    one machine and can be compared.

    beside : a folder of run folders whose references and measurements may be taken
    timeout : seconds that a measurement may take, 0 for as long as it needs

    Raises StoreError where results cannot be stored any more.
    """
    executor = executor or SerialExecutor()
    todo = missing_measurements(store, measurements)
    if beside is not None and todo and take_measurements(store, todo, keep_images, beside):
        todo = missing_measurements(store, measurements)
    run = _Run(store, progress or SilentProgress(), keep_images, beside, timeout)
    run.outcome.stored = len(measurements) - len(todo)
    run.progress.begin(len(todo), run.outcome.stored)
    run_jobs(executor, run.jobs(todo))
    run_jobs(SerialExecutor(), run.timed_jobs())
    run.outcome.failures = [run.failed[one.key] for one in todo if one.key in run.failed]
    return run.outcome


class _Run:
    """What jobs are made from, and what is done with their results."""

    def __init__(
        self, store: Store, progress: Progress, keep_images: bool, beside: Path | None,
        timeout: float,
    ) -> None:  # fmt: skip
        self.store, self.progress = store, progress
        self.outcome = Outcome()
        self.failed: dict[str, str] = {}
        self._keep_images, self._beside, self._timeout = keep_images, beside, timeout
        self._timed: list[list[MeasurementTask]] = []

    def jobs(self, measurements: Iterable[Measurement]) -> Iterator[Job]:
        """The references of all cases, and, as they come, the measurements that are not timed."""
        for case, members in groupby(measurements, key=lambda one: one.case):
            group = list(members)
            self.progress.working_on(str(case))
            try:
                begun = self._begin_case(case, group)
            except StoreError:
                raise
            except Exception as error:
                begun = self._fail_all(group, error)
            yield from begun

    def timed_jobs(self) -> Iterator[Job]:
        """The timed measurements of the cases that have a reference, side by side per budget."""
        for tasks in self._timed:
            self.progress.working_on(str(tasks[0].measurement.case))
            yield Job(measure_timed, tasks, partial(self._keep_timed, tasks))

    def _begin_case(self, case: Case, measurements: list[Measurement]) -> list[Job]:
        """The case's measurements where its reference is there, or else the reference."""
        folder = self.store.folder
        stored = self.store.get("reference", case.reference_key)
        if stored and has_reference(folder, case, stored):
            return self._measurement_jobs(measurements, stored)
        if self._beside is not None and (row := take_reference(case, folder, self._beside)):
            return self._keep_reference(case, measurements, lambda: row)
        return [
            Job(
                handing_over(measure_reference),
                ReferenceTask(case, str(folder)),
                lambda future: self._keep_reference(
                    case, measurements, partial(self._received, future)
                ),
            )
        ]

    def _keep_reference(
        self, case: Case, measurements: list[Measurement], result: Callable[[], dict[str, Any]]
    ) -> list[Job]:
        """Store the row of a reference; the jobs that it allows."""
        key = case.reference_key
        try:
            row = result()
            stored = self.store.get("reference", key)
            if stored is None:
                self.store.put("reference", key, case.reference_identity, row)
            elif row[PIXELS] != stored[PIXELS]:
                raise EnvlightError(
                    f"{self.store.folder}: the reference image of {case} was lost, and rendering "
                    "it again gives another one; restore the folder, or start in a new one by "
                    "--output"
                )
        except StoreError:
            raise
        except Exception as error:
            return self._fail_all(measurements, error)
        return self._measurement_jobs(measurements, row)

    def _measurement_jobs(
        self, measurements: list[Measurement], reference: dict[str, Any]
    ) -> list[Job]:
        tasks = [self._task(one, reference["noise_floor"]) for one in measurements]
        timed = [
            task
            for task in tasks
            if task.measurement.budget.timed and not (task.rendered or task.count)
        ]
        for budget in dict.fromkeys(task.measurement.budget for task in timed):
            self._timed.append([task for task in timed if task.measurement.budget == budget])
        return [
            Job(handing_over(measure), task, partial(self._keep_received, task))
            for task in tasks
            if task not in timed
        ]

    def _task(self, one: Measurement, floor: float) -> MeasurementTask:
        """What is missing of a measurement."""
        folder = self.store.folder
        stored = self.store.get("image", one.key)
        missing = [
            name for name, key in one.score_keys.items() if self.store.get("score", key) is None
        ]
        kept = stored is not None and (not missing or image_path(folder, one).is_file())
        count, pixels = (stored["count"], stored[PIXELS]) if stored else (0, "")
        features = tuple(
            name
            for name, key in one.case.features_keys.items()
            if self.store.get("score", key) is None
        )
        return MeasurementTask(
            one, str(folder), floor, self._keep_images, tuple(missing),
            kept, count, features, pixels, self._timeout,
        )  # fmt: skip

    def _keep_measurement(self, task: MeasurementTask, result: Callable[[], Measured]) -> None:
        try:
            self._store(task.measurement, result())
        except StoreError:
            raise
        except Exception as error:
            self._fail(task.measurement, error)
        else:
            self.outcome.measured += 1
            self.progress.advance()

    def _keep_received(self, task: MeasurementTask, future: Future) -> None:
        self._keep_measurement(task, partial(self._received, future))

    def _received(self, future: Future) -> Any:
        """A task's result; the time that it took elsewhere is added up."""
        result, seconds = future.result()
        self.outcome.elsewhere = added(self.outcome.elsewhere, seconds)
        return result

    def _store(self, one: Measurement, found: Measured) -> None:
        """Commit an image's row, unless there is one, and its scores, together."""
        with time_spent.on(KEEPING), self.store.together():
            if found.image is not None and self.store.get("image", one.key) is None:
                self.store.put("image", one.key, one.identity, found.image)
            case = one.case
            for name, row in found.features.items():
                key = case.features_keys[name]
                if self.store.get("score", key) is None:
                    self.store.put("score", key, case.features_identities[name], row)
            for name, row in found.scores.items():
                identity = one.score_identity(find_metric(name))
                self.store.put("score", one.score_keys[name], identity, row)

    def _keep_timed(self, tasks: list[MeasurementTask], future: Future) -> None:
        try:
            measured: list[Future] = future.result()
        except Exception as error:
            self._fail_all([task.measurement for task in tasks], error)
            return
        for task, row in zip(tasks, measured, strict=True):
            self._keep_measurement(task, row.result)

    def _fail(self, measurement: Measurement, error: Exception) -> None:
        self.failed[measurement.key] = f"{measurement}: {_sentence(error)}"
        self.progress.advance()

    def _fail_all(self, measurements: list[Measurement], error: Exception) -> list[Job]:
        for measurement in measurements:
            self._fail(measurement, error)
        return []


def _sentence(error: Exception) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, OSError) and error.strerror:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror}; check the permissions and the space left"
    return text if isinstance(error, EnvlightError) else f"{type(error).__name__}: {text}"


def run_folder(output: Path | None, experiment: str, scale: str) -> Path:
    """The folder of a run: the one asked for, or runs/EXPERIMENT-SCALE."""
    return output or Path("runs") / f"{experiment}-{scale}"


def spent_before(folder: Path) -> Seconds:
    """The processor seconds that the folder's record tells of earlier starts; none where no record
    can be read."""
    return read_record(folder).get("processor_seconds", {})
