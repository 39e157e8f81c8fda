"""Measurements on many machines, by Dask's `distributed`.

A worker process works on one measurement at a time, with as many kernel threads as it was given
(`dask worker --nthreads`). A worker that is lost takes no measurement with it: its task goes to
another. What is measured there comes back as `shipping` says, so no folder needs to be shared.
Whoever reaches a port of such a cluster can have it run anything: one that is begun here listens to
this machine alone, unless it is told otherwise, and TLS keeps out those without a certificate.
"""

import importlib.util
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.run.identity import file_digest
from experiments.run.process_executor import uninterrupted
from experiments.run.schedule import settle
from experiments.run.shipping import Delivery, Order, Task, bare, carry_out, case_of, key_of, needed
from renderer.image import write_whole
from samplers import EnvlightError

if TYPE_CHECKING:
    from distributed import Client
    from distributed import Future as Remote
    from distributed.security import Security

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
CERTIFICATES = {"ca_file": "ca.pem", "cert": "cert.pem", "key": "key.pem"}
EXTRA = "the cluster needs the package distributed: pip install 'envlight[cluster]'"


@contextmanager
def cluster_executor(
    address: str, workers: int, threads: int, host: str = "", tls: Path | None = None
) -> Iterator["ClusterExecutor"]:
    """An executor on the cluster of a scheduler.

    address : of the scheduler (tcp://HOST:PORT) or its scheduler file; empty for a cluster of this
        machine, with so many workers of so many threads each
    host : where a cluster of this machine listens; empty for this machine alone
    tls : a folder with certificates, which all parts of the cluster must have; None for none

    Raises EnvlightError where there is no scheduler, or a certificate is missing.
    """
    if importlib.util.find_spec("distributed") is None:
        raise EnvlightError(EXTRA)
    from distributed import Client, LocalCluster

    security = _security(tls)
    if not address:
        with uninterrupted():
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=threads, dashboard_address=None,
                host=host or LOOPBACK, security=security,
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
            security=security,
        )
    except (OSError, ValueError, TypeError) as error:
        raise EnvlightError(
            f"cluster '{address}': no scheduler answers there; start one by 'dask scheduler', and "
            "give its tcp:// address or scheduler file"
        ) from error
    with client, ClusterExecutor(client) as executor:
        yield executor


def _security(tls: Path | None) -> "Security | None":
    """Encrypted connections alone, to those that have a certificate of the same authority."""
    from distributed.security import Security

    if tls is None:
        return None
    files = {kind: tls / name for kind, name in CERTIFICATES.items()}
    for file in files.values():
        if not file.is_file():
            raise EnvlightError(
                f"--tls {tls}: there is no {file.name}; give a folder with "
                f"{', '.join(CERTIFICATES.values())}"
            )
    pairs = {
        f"tls_{role}_{kind}": str(files[kind])
        for role in ("client", "scheduler", "worker")
        for kind in ("cert", "key")
    }
    return Security(tls_ca_file=str(files["ca_file"]), require_encryption=True, **pairs)


class ClusterExecutor(Executor):
    """Sends the functions of `measure` with their tasks to a Dask cluster."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._held: OrderedDict[str, Remote] = OrderedDict()
        self._busy: Counter[str] = Counter()
        self._lock = threading.RLock()

    @property
    def slots(self) -> int:
        """How many workers there are now, at least 1."""
        return max(1, len(self._workers()))

    def _workers(self) -> list[str]:
        try:
            return list(self._client.scheduler_info(n_workers=-1)["workers"])
        except Exception as error:  # of whatever layer: it does not answer
            raise EnvlightError(GONE) from error

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        """The future result of `fn(task)`; what it writes is then in the task's folder."""
        (task,) = args
        future: Future = Future()
        self._send(Order(fn, bare(task, ""), key_of(task)), task, future, 0)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let go of what is held on the cluster; the workers belong to whoever started them."""
        self._held.clear()

    def _send(self, order: Order, task: Task, future: Future, losses: int) -> None:
        """Give the order to the worker that has least to do; to another where that one is lost."""
        try:
            with self._lock:
                map_file, files = self._map_file(task), self._files(task)
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
            lambda done: self._receive(done, order, task, name, future, losses, (map_file, files))
        )

    def _receive(
        self,
        remote: "Remote",
        order: Order,
        task: Task,
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
                self._send(order, task, future, losses + 1)
            return
        try:
            for path, content in delivery.files.items():
                write_whole(Path(task.folder) / path, partial(_write, content))
        except Exception as error:
            settle(future, error=error)
        else:
            settle(future, delivery.result)

    def _map_file(self, task: Task) -> "Remote | None":
        path = case_of(task).environment.path
        if not path:
            return None
        name = f"{file_digest(Path(path))}/{Path(path).name}"
        return self._hold(_map_key(task), lambda: (name, Path(path).read_bytes()))

    def _files(self, task: Task) -> "Remote | None":
        """What the task reads from the run's folder; the files of a case's reference once."""
        paths, folder = needed(task), Path(task.folder)
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
    return f"map {case_of(task).environment.path}"


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
