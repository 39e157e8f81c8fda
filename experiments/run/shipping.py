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

from experiments.run.case import Case
from experiments.run.identity import digest
from experiments.run.kept_images import half_path, image_path, reference_path
from experiments.run.measure import MeasurementTask, ReferenceTask
from experiments.run.measurement import Measurement
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
    """A hash of all keys under which the task's results are filed."""
    if isinstance(task, ReferenceTask):
        return task.case.reference_key
    return digest([task.measurement.key, task.measurement.score_keys])


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
    files: dict[str, bytes],
    scratch: str,
    threads: int,
) -> Delivery:
    """Do an order in this process, with one folder of its own; one at a time.

    map_file : name and content of the map's file, None for a map made from code
    files : what the task reads, by path below the run's folder
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
        outputs = _outputs(task, folder)
        try:
            for name, content in files.items():
                _write_new(folder / name, content)
            result = order.function(task)
            made = {str(path.relative_to(folder)): path.read_bytes() for path in outputs}
            made = {name: new for name, new in made.items() if new != files.get(name)}
        finally:
            for path in (*(folder / name for name in files), *outputs):
                path.unlink(missing_ok=True)
        return Delivery(result, made)


def needed(task: Task) -> list[Path]:
    """The files of the run's folder that a task reads, the map's aside."""
    if isinstance(task, ReferenceTask):
        return []
    folder, one = Path(task.folder), task.measurement
    found = [reference_path(folder, one.case), half_path(folder, one.case)]
    return [*found, image_path(folder, one)] if task.rendered and task.metrics else found


def _outputs(task: Task, folder: Path) -> list[Path]:
    """The files that a task writes."""
    if isinstance(task, ReferenceTask):
        return [reference_path(folder, task.case), half_path(folder, task.case)]
    image = image_path(folder, task.measurement)
    return [image] if task.keep_image and (not task.rendered or task.metrics) else []


def _write_new(path: Path, content: bytes) -> None:
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
