"""Measuring on another machine, which shares no folder with the run's.

What a task reads goes with it as bytes, the map's file and the reference image; what it writes,
the reference or the measurement's image, comes back with its result, and the one process that
writes puts it into the run's folder. A worker counts the key of a measurement again from its own
source code, libraries and files: a result of other code is never filed under that key.
"""

import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.run.measure import MeasurementTask, ReferenceTask, image_path, reference_path
from experiments.run.measurement import Case, Measurement
from samplers import EnvlightError
from samplers.threads import set_thread_count

Task = ReferenceTask | MeasurementTask
_one_at_a_time = threading.Lock()


@dataclass(frozen=True)
class Order:
    """Work for a worker: `function` of a task. key : of the task's case or measurement"""

    function: Callable[..., Any]
    task: Task
    key: str


@dataclass(frozen=True)
class Delivery:
    """result : what the function gave; files : contents by path below the run's folder"""

    result: Any
    files: dict[str, bytes]


def case_of(task: Task) -> Case:
    return task.case if isinstance(task, ReferenceTask) else task.measurement.case


def key_of(task: Task) -> str:
    """The key under which the task's result is filed."""
    return task.case.key if isinstance(task, ReferenceTask) else task.measurement.key


def bare(task: Task, folder: str, map_file: str | None = None) -> Task:
    """The task in another folder, and with another file as its map; nothing computed goes along."""
    case = case_of(task)
    source = replace(case.environment, path=case.environment.path if map_file is None else map_file)
    case = replace(case, environment=source)
    if isinstance(task, ReferenceTask):
        return ReferenceTask(case, folder)
    return replace(task, measurement=_with_case(task.measurement, case), folder=folder)


def _with_case(measurement: Measurement, case: Case) -> Measurement:
    return replace(measurement, case=case)


def carry_out(
    order: Order,
    map_file: tuple[str, bytes] | None,
    reference: bytes | None,
    scratch: str,
    threads: int,
) -> Delivery:
    """Do an order in this process, with one folder of its own; one at a time.

    map_file : name and content of the map's file, None for a map made from code
    threads : how many the kernels may use

    Raises EnvlightError where this process would not measure what the sender means.
    """
    folder = Path(scratch)
    with _one_at_a_time:
        set_thread_count(threads)
        place = None
        if map_file is not None:
            place = folder / "maps" / map_file[0]
            _write_new(place, map_file[1])
        task = bare(order.task, scratch, str(place) if place else None)
        if key_of(task) != order.key:
            raise EnvlightError(
                f"worker {socket.gethostname()}: it has other source code, library versions or "
                "files than the sender; install the same there and start its workers again"
            )
        truth = reference_path(folder, case_of(task))
        output = _output(task, folder)
        try:
            if reference is not None:
                _write_new(truth, reference)
            result = order.function(task)
            files = {str(output.relative_to(folder)): output.read_bytes()} if output else {}
        finally:
            for path in (truth, output):
                if path is not None:
                    path.unlink(missing_ok=True)
        return Delivery(result, files)


def _output(task: Task, folder: Path) -> Path | None:
    """The file that a task writes."""
    if isinstance(task, ReferenceTask):
        return reference_path(folder, task.case)
    return image_path(folder, task.measurement) if task.keep_image else None


def _write_new(path: Path, content: bytes) -> None:
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
