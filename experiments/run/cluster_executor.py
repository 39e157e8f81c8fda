"""Measurements on many machines, by Dask's `distributed`.

A worker process works on one measurement at a time, with as many kernel threads as it was given
(`dask worker --nthreads`). A worker that is lost takes no measurement with it: its task goes to
another. No folder needs to be shared: what a task reads goes with it as bytes, the map's file and
the reference image; what it writes comes back with its result, and the one process that writes
puts it into the store. A worker counts the keys of a task again from its own source code, libraries
and files: a result of other code is never filed under them.

Whoever reaches a port of such a cluster can have it run anything: one that is begun here listens to
this machine alone, and TLS, by Dask's own configuration, keeps out those without a certificate.
"""

import importlib.util
import logging
import socket
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.run.case import Case
from experiments.run.executors import Done, settle, uninterrupted
from experiments.run.identity import digest, file_digest
from experiments.run.kept_images import half_path, reference_path, stored_image
from experiments.run.measure import MeasurementTask, ReferenceTask
from renderer.image import write_whole
from samplers import EnvlightError
from samplers.threads import set_thread_count

if TYPE_CHECKING:
    from distributed import Client
    from distributed import Future as Remote

LOSSES = 5
"""How often a task may be lost with its worker before it is given up."""
KEPT = 16
"""Map files and reference images that are held on the cluster at most, the newest."""
LOST = (
    "its workers were lost again and again, or the scheduler; see whether memory was used up, "
    "then give the same command again"
)
GONE = (
    "the cluster's scheduler does not answer any more; what was measured is stored: see whether "
    "it still runs, then give the same command again"
)
CONNECT_SECONDS = 30.0
LOOPBACK = "127.0.0.1"
EXTRA = "the cluster needs the package distributed: pip install 'envlight[cluster]'"
ASKED_SECONDS = 0.5
"""So long what the scheduler says of its workers is believed."""
Task = ReferenceTask | MeasurementTask
_one_at_a_time = threading.Lock()


@dataclass(frozen=True)
class Order:
    """Work for a worker: `work` of tasks of one case by a function. key : of all their results"""

    work: Callable[[Callable[[Any], Any], Sequence[Any]], Done]
    function: Callable[[Any], Any]
    tasks: list[Task]
    key: str


@dataclass(frozen=True)
class Delivery:
    """done : what became of the tasks; files : contents by path below the store's folder"""

    done: Done
    files: dict[str, bytes]


@contextmanager
def cluster_executor(address: str, workers: int, threads: int) -> Iterator["ClusterExecutor"]:
    """An executor on the cluster of a scheduler.

    address : of the scheduler (tcp://HOST:PORT) or its scheduler file; empty for a cluster of this
        machine, with so many workers of so many threads each

    Raises EnvlightError where there is no scheduler that lets us in.
    """
    if importlib.util.find_spec("distributed") is None:
        raise EnvlightError(EXTRA)
    from distributed import Client, LocalCluster

    if not address:
        with uninterrupted():
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=threads, dashboard_address=None,
                host=LOOPBACK, silence_logs=logging.CRITICAL,
            )  # fmt: skip
        with cluster, Client(cluster) as client, ClusterExecutor(client) as executor:
            yield executor
        return
    try:
        file = Path(address).is_file()
        client = Client(
            None if file else address,
            scheduler_file=address if file else None,
            timeout=CONNECT_SECONDS,
        )
    except (OSError, ValueError, TypeError) as error:
        raise EnvlightError(
            f"cluster '{address}': no scheduler answers there; start one by 'dask scheduler', and "
            "give its tcp:// address or scheduler file"
        ) from error
    with client, ClusterExecutor(client) as executor:
        yield executor


class ClusterExecutor(Executor):
    """Sends the functions of `measure` with their tasks to a Dask cluster."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._held: OrderedDict[str, Remote] = OrderedDict()
        self._busy: Counter[str] = Counter()
        self._lock = threading.RLock()
        self._asked, self._known = -ASKED_SECONDS, [""]

    @property
    def slots(self) -> int:
        """How many workers there are now, at least 1."""
        return max(1, len(self._workers()))

    def _workers(self) -> list[str]:
        if time.monotonic() - self._asked < ASKED_SECONDS:
            return self._known
        try:
            self._known = list(self._client.scheduler_info(n_workers=-1)["workers"])
        except Exception as error:  # of whatever layer: it does not answer
            raise EnvlightError(GONE) from error
        self._asked = time.monotonic()
        return self._known

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        """The future of `work_off(function, tasks)`; what it writes is then in their folder."""
        function, tasks = args
        future: Future = Future()
        self._send(Order(fn, function, bare(tasks), key_of(tasks)), tasks, future, 0)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let go of what is held on the cluster; the workers belong to whoever started them."""
        self._held.clear()

    def _send(self, order: Order, tasks: list[Task], future: Future, losses: int) -> None:
        """Give the order to the worker that has least to do; to another where that one is lost."""
        try:
            with self._lock:
                map_file, files = self._map_file(tasks[0]), self._files(tasks)
                name = min(self._workers(), key=lambda name: self._busy[name], default="")
                self._busy[name] += 1
            remote = self._client.submit(
                _carry_out, order, map_file, files, pure=False,
                workers=[name] if name else None, allow_other_workers=bool(name),
            )  # fmt: skip
        except Exception as error:
            settle(future, error=error)
            return
        remote.add_done_callback(
            lambda done: self._receive(done, order, tasks, name, future, losses, (map_file, files))
        )

    def _receive(
        self,
        remote: "Remote",
        order: Order,
        tasks: list[Task],
        name: str,
        future: Future,
        losses: int,
        needs: tuple["Remote | None", ...],
    ) -> None:
        """Write what was delivered and pass the result on; send lost orders again."""
        with self._lock:
            self._busy[name] -= 1
        try:
            delivery: Delivery = remote.result()
        except Exception as error:
            if _failed(remote, error):
                settle(future, error=error)
            elif _is_deadly(error) or losses + 1 == LOSSES or self._client.status != "running":
                settle(future, error=EnvlightError(LOST))
            else:
                self._forget(needs)
                self._asked = -ASKED_SECONDS
                self._send(order, tasks, future, losses + 1)
            return
        try:
            for path, content in delivery.files.items():
                write_whole(Path(tasks[0].folder) / path, partial(_write, content))
        except Exception as error:
            settle(future, error=error)
        else:
            settle(future, delivery.done)

    def _map_file(self, task: Task) -> "Remote | None":
        path = task.case.environment.path
        if not path:
            return None
        name = f"{file_digest(Path(path))}/{Path(path).name}"
        return self._hold(_map_key(task), lambda: (name, Path(path).read_bytes()))

    def _files(self, tasks: list[Task]) -> "Remote | None":
        """What tasks of one case read from the store's folder; the files of a reference once."""
        folder = Path(tasks[0].folder)
        paths = dict.fromkeys(path for task in tasks for path in needed(task))
        if not paths:
            return None
        names = [str(path.relative_to(folder)) for path in paths]
        return self._hold(
            " ".join(names),
            lambda: {name: (folder / name).read_bytes() for name in names},
        )

    def _hold(self, key: str, content: Callable[[], Any]) -> "Remote":
        """Data on the cluster, from where all workers can fetch it; sent there once."""
        if key not in self._held:
            (self._held[key],) = self._client.scatter([content()], hash=False)
            if len(self._held) > KEPT:
                self._held.popitem(last=False)
        self._held.move_to_end(key)
        return self._held[key]

    def _forget(self, lost: tuple["Remote | None", ...]) -> None:
        """Send these anew when they are needed, unless another order has done so already."""
        with self._lock:
            for key in [key for key, held in self._held.items() if held in lost]:
                del self._held[key]


def _failed(remote: "Remote", error: Exception) -> bool:
    """Whether the task itself failed, rather than that a worker or what it held is gone.

    A result, too, lies on its worker until it is fetched.
    """
    from distributed.comm import CommClosedError

    lost = isinstance(error, CancelledError | CommClosedError) or _is_deadly(error)
    return remote.status == "error" and not lost


def _is_deadly(error: Exception) -> bool:
    """Whether several workers died one after another with the task on them."""
    from distributed.scheduler import KilledWorker

    return isinstance(error, KilledWorker)


def _map_key(task: Task) -> str:
    return f"map {task.case.environment.path}"


def _write(content: bytes, path: Path) -> None:
    path.write_bytes(content)


def _carry_out(
    order: Order, map_file: tuple[str, bytes] | None, files: dict[str, bytes] | None
) -> Delivery:
    """Runs on a worker, in its own folder and with its own number of threads."""
    from distributed import get_worker

    worker = get_worker()
    scratch = Path(worker.local_directory) / "envlight"
    return carry_out(order, map_file, files or {}, str(scratch), worker.state.nthreads)


def key_of(tasks: Sequence[Task]) -> str:
    """A hash of all keys under which the tasks' results are filed."""
    case = tasks[0].case
    keys = [one.measurement.key for one in tasks if isinstance(one, MeasurementTask)]
    return digest([case.reference_key, list(case.score_keys.values()), keys])


def bare(tasks: Sequence[Task]) -> list[Task]:
    """The tasks of a case for another process, in no folder."""
    case = bare_case(tasks[0].case)
    return [_in_case(task, case, "") for task in tasks]


def bare_case(case: Case, map_file: str | None = None) -> Case:
    """The case with another file as its map; nothing computed goes along."""
    path = case.environment.path if map_file is None else map_file
    return replace(case, environment=replace(case.environment, path=path))


def _in_case(task: Task, case: Case, folder: str) -> Task:
    if isinstance(task, ReferenceTask):
        return ReferenceTask(case, folder)
    return replace(task, measurement=replace(task.measurement, case=case), folder=folder)


def carry_out(
    order: Order,
    map_file: tuple[str, bytes] | None,
    files: dict[str, bytes],
    scratch: str,
    threads: int,
) -> Delivery:
    """Do an order in this process, with one folder of its own; one at a time.

    map_file : name and content of the map's file, None for a map made from code
    files : what the tasks read, by path below the store's folder
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
        case = bare_case(order.tasks[0].case, str(place) if place else None)
        tasks = [_in_case(task, case, scratch) for task in order.tasks]
        if key_of(tasks) != order.key:
            raise EnvlightError(
                f"worker {socket.gethostname()}: it has other source code, library versions or "
                "files than the sender; install the same there and start its workers again"
            )
        outputs = [path for task in tasks for path in _outputs(task, folder)]
        try:
            for name, content in files.items():
                _write_new(folder / name, content)
            done = order.work(order.function, tasks)
            there = {path.relative_to(folder): path for path in outputs if path.is_file()}
            made = {str(name): path.read_bytes() for name, path in there.items()}
            made = {name: new for name, new in made.items() if new != files.get(name)}
        finally:
            for path in (*(folder / name for name in files), *outputs):
                path.unlink(missing_ok=True)
        return Delivery(done, made)


def needed(task: Task) -> list[Path]:
    """The files of the store's folder that a task reads, the map's aside."""
    if isinstance(task, ReferenceTask):
        return []
    folder, one = Path(task.folder), task.measurement
    found = [reference_path(folder, one.case), half_path(folder, one.case)]
    return [*found, stored_image(folder, one.key)] if task.rendered and task.metrics else found


def _outputs(task: Task, folder: Path) -> list[Path]:
    """The files that a task writes."""
    if isinstance(task, ReferenceTask):
        return [reference_path(folder, task.case), half_path(folder, task.case)]
    image = stored_image(folder, task.measurement.key)
    return [image] if task.keep_image and (not task.rendered or task.metrics) else []


def _write_new(path: Path, content: bytes) -> None:
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
