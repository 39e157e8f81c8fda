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
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.run.case import Case, environment_identity
from experiments.run.executors import Done, settle, uninterrupted
from experiments.run.identity import digest
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
KEPT = 32
"""Map files and images that are held on the cluster at most, the newest."""
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
    """Work for a worker: `work` of tasks of one case by a function.

    key : of all their results; map_file : what a worker calls the file of their map, if any
    """

    work: Callable[[Callable[[Any], Any], Sequence[Any]], Done]
    function: Callable[[Any], Any]
    tasks: list[Task]
    key: str
    map_file: str = ""


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
        self._send(
            Order(fn, function, bare(tasks), key_of(tasks), map_name(tasks[0].case)),
            tasks,
            future,
            0,
        )
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let go of what is held on the cluster; the workers belong to whoever started them."""
        self._held.clear()

    def _send(self, order: Order, tasks: list[Task], future: Future, losses: int) -> None:
        """Give the order to the worker that has least to do; to another where that one is lost."""
        try:
            with self._lock:
                needs = {name: path for task in tasks for name, path in needed(task).items()}
                held = {name: self._hold(name, path) for name, path in needs.items()}
                name = min(self._workers(), key=lambda name: self._busy[name], default="")
                self._busy[name] += 1
            remote = self._client.submit(
                _carry_out, order, held, pure=False,
                workers=[name] if name else None, allow_other_workers=bool(name),
            )  # fmt: skip
        except Exception as error:
            settle(future, error=error)
            return
        remote.add_done_callback(
            lambda done: self._receive(done, order, tasks, name, future, losses, held)
        )

    def _receive(
        self,
        remote: "Remote",
        order: Order,
        tasks: list[Task],
        name: str,
        future: Future,
        losses: int,
        needs: dict[str, "Remote"],
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
                write_whole(Path(tasks[0].folder) / path, methodcaller("write_bytes", content))
        except Exception as error:
            settle(future, error=error)
        else:
            settle(future, delivery.done)

    def _hold(self, name: str, path: Path) -> "Remote":
        """A file on the cluster, from where all workers can fetch it; sent there once."""
        if name not in self._held:
            (self._held[name],) = self._client.scatter([path.read_bytes()], hash=False)
            if len(self._held) > KEPT:
                self._held.popitem(last=False)
        self._held.move_to_end(name)
        return self._held[name]

    def _forget(self, lost: dict[str, "Remote"]) -> None:
        """Send these anew when they are needed, unless another order has done so already."""
        with self._lock:
            for name in [name for name, held in lost.items() if self._held.get(name) is held]:
                del self._held[name]


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


def _carry_out(order: Order, files: dict[str, bytes]) -> Delivery:
    """Runs on a worker, in its own folder and with its own number of threads."""
    from distributed import get_worker

    worker = get_worker()
    scratch = Path(worker.local_directory) / "envlight"
    return carry_out(order, files, str(scratch), worker.state.nthreads)


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


def carry_out(order: Order, files: dict[str, bytes], scratch: str, threads: int) -> Delivery:
    """Do an order in this process, with one folder of its own; one at a time.

    files : what the tasks read, by `needed`'s names; threads : how many the kernels may use

    Raises EnvlightError where this process would not measure what the sender means.
    """
    folder = Path(scratch)
    with _one_at_a_time:
        set_thread_count(threads)
        if order.map_file:
            _write_new(folder / order.map_file, files[order.map_file])
        place = str(folder / order.map_file) if order.map_file else None
        case = bare_case(order.tasks[0].case, place)
        tasks = [_in_case(task, case, scratch) for task in order.tasks]
        if key_of(tasks) != order.key:
            raise EnvlightError(
                f"worker {socket.gethostname()}: it has other source code, library versions or "
                "files than the sender; install the same there and start its workers again"
            )
        outputs = [path for task in tasks for path in _outputs(task, folder)]
        others = {name: content for name, content in files.items() if name != order.map_file}
        try:
            for name, content in others.items():
                _write_new(folder / name, content)
            done = order.work(order.function, tasks)
            there = {path.relative_to(folder): path for path in outputs if path.is_file()}
            made = {str(name): path.read_bytes() for name, path in there.items()}
            made = {name: new for name, new in made.items() if new != files.get(name)}
        finally:
            for path in (*(folder / name for name in others), *outputs):
                path.unlink(missing_ok=True)
        return Delivery(done, made)


def needed(task: Task) -> dict[str, Path]:
    """The files that a task reads, by the names that a worker has for them."""
    folder, name = Path(task.folder), map_name(task.case)
    found = {name: Path(task.case.environment.path)} if name else {}
    if isinstance(task, ReferenceTask):
        return found
    paths = [reference_path(folder, task.case), half_path(folder, task.case)]
    if task.rendered and task.metrics:
        paths.append(stored_image(folder, task.measurement.key))
    return found | {str(path.relative_to(folder)): path for path in paths}


def map_name(case: Case) -> str:
    """What a worker calls the file of a case's map; empty for a map made from code."""
    source = case.environment
    content = environment_identity(source)["file"] if source.path else ""
    return f"maps/{content}/{Path(source.path).name}" if content else ""


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
