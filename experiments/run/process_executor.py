"""Measurements in processes of this machine. A process that dies takes no measurement with it.

`concurrent.futures.ProcessPoolExecutor` gives up everything that was submitted when one of its
processes dies. Here every process is a pool of its own, which is made anew: only the task that it
worked on was lost, and that runs once more. A task goes to the process that was idle last, which
has loaded what belongs to it.
"""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from typing import Any

from experiments.run.memory import keep_freed_memory
from experiments.run.schedule import settle
from samplers import EnvlightError
from samplers.threads import set_thread_count

DEATHS = 2
"""A task whose process dies this often is given up."""


@dataclass(eq=False)
class _Job:
    work: Callable[[], Any]
    future: Future = field(default_factory=Future)
    deaths: int = 0


class ProcessExecutor(Executor):
    """`slots` processes, whose kernels run on `threads` threads each."""

    def __init__(self, slots: int, threads: int) -> None:
        self.slots, self._threads = slots, threads
        self._lifeline, self._keep_alive = multiprocessing.Pipe(duplex=False)
        self._changed = threading.Condition()
        self._idle = [self._new_pool() for _ in range(slots)]
        self._busy: set[ProcessPoolExecutor] = set()
        self._waiting: deque[_Job] = deque()
        self._closed = self._stopped = False

    def submit(self, fn, /, *args, **kwargs) -> Future:
        job = _Job(partial(fn, *args, **kwargs))
        with self._changed:
            if self._closed:
                raise RuntimeError("the executor is shut down")
            self._waiting.append(job)
            self._begin_waiting()
        return job.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when all is done; those that still work at once if `cancel_futures`."""
        with self._changed:
            self._closed, self._stopped = True, self._stopped or cancel_futures
            if cancel_futures:
                self._keep_alive.close()
                while self._waiting:
                    _call_off(self._waiting.popleft().future)
            self._changed.wait_for(lambda: self._stopped or not (self._waiting or self._busy))
            pools = [*self._idle, *self._busy]
        for pool in pools:
            pool.shutdown(wait=wait, cancel_futures=cancel_futures)

    def __exit__(self, kind: Any, *_: Any) -> None:
        self.shutdown(cancel_futures=kind is not None)

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            1,
            multiprocessing.get_context("spawn"),
            initializer=_begin,
            initargs=(self._threads, self._lifeline),
        )

    def _begin_waiting(self) -> None:
        """Give what waits to idle processes; under the lock."""
        while self._waiting and self._idle:
            job = self._waiting.popleft()
            if job.future.cancelled():
                _call_off(job.future)
                continue
            pool = self._idle.pop()
            try:
                inner = _submit(pool, job)
            except BrokenProcessPool:  # it died while it was idle
                pool = self._new_pool()
                inner = _submit(pool, job)
            self._busy.add(pool)
            inner.add_done_callback(partial(self._done, job, pool))

    def _done(self, job: _Job, pool: ProcessPoolExecutor, inner: Future) -> None:
        """Pass a result on; what was lost with its process runs once more."""
        error = None if inner.cancelled() else inner.exception()
        died = isinstance(error, BrokenProcessPool) and not self._stopped
        job.deaths += died
        again = died and job.deaths < DEATHS
        with self._changed:
            self._busy.discard(pool)
            self._idle.append(self._new_pool() if died else pool)
            if again:
                self._waiting.appendleft(job)
            self._begin_waiting()
            self._changed.notify_all()
        if inner.cancelled():
            _call_off(job.future)
        elif died and not again:
            sentence = (
                f"its process died {job.deaths} times; see whether the memory was used up, it was "
                "ended for its time, or something ended it from outside"
            )
            settle(job.future, error=EnvlightError(sentence))
        elif not again:
            settle(job.future, None if error else inner.result(), error)


def _call_off(future: Future) -> None:
    future.cancel()
    future.set_running_or_notify_cancel()


def _submit(pool: ProcessPoolExecutor, job: _Job) -> Future:
    with uninterrupted():  # it may begin a process
        return pool.submit(job.work)


def _begin(threads: int, lifeline: Connection) -> None:
    """Set up a process of a pool. Interrupts are for the main process to act on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_thread_count(threads)
    keep_freed_memory()
    threading.Thread(target=_end_with_parent, args=(lifeline,), daemon=True).start()


def _end_with_parent(lifeline: Connection) -> None:
    """End this process when the other end of the pipe is closed, if only by its owner's end."""
    lifeline.poll(None)
    os._exit(1)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Processes and threads that are begun inside get no interrupts from the keyboard: those are
    for the main thread to act on. Systems without signals of this kind leave it at that.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which lets interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
