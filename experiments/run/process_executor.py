"""Measurements in processes of this machine. A process that dies takes no measurement with it.

`concurrent.futures.ProcessPoolExecutor` gives up everything that was submitted when one of its
processes dies. Here the pool is made anew, and what was lost runs again, one task at a time and by
itself, so that a task which brings down its process each time is told from those that were only
beside it.
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

LONE_DEATHS = 2
"""A task whose process dies this often, with no other task beside it, is given up."""


@dataclass(eq=False)
class _Job:
    work: Callable[[], Any]
    future: Future = field(default_factory=Future)
    lone_deaths: int = 0


class ProcessExecutor(Executor):
    """A pool of `slots` processes, whose kernels run on `threads` threads each."""

    def __init__(self, slots: int, threads: int) -> None:
        self.slots = slots
        self._threads = threads
        self._lock = threading.RLock()
        self._lifeline, self._keep_alive = multiprocessing.Pipe(duplex=False)
        self._pool = self._new_pool(slots)
        self._suspects: deque[_Job] = deque()
        self._quarantine: ProcessPoolExecutor | None = None
        self._alone: _Job | None = None
        self._closed = False

    def submit(self, fn, /, *args, **kwargs) -> Future:
        job = _Job(partial(fn, *args, **kwargs))
        with self._lock:
            if self._closed:
                raise RuntimeError("the executor is shut down")
            try:
                inner = _submit(self._pool, job)
            except BrokenProcessPool:
                self._pool = self._new_pool(self.slots)
                inner = _submit(self._pool, job)
            inner.add_done_callback(partial(self._done, job))
        return job.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; those that still work are stopped where `cancel_futures`."""
        with self._lock:
            self._closed = True
            pools = [pool for pool in (self._pool, self._quarantine) if pool]
        if cancel_futures:
            self._keep_alive.close()
        for pool in pools:
            pool.shutdown(wait=wait, cancel_futures=cancel_futures)

    def __exit__(self, kind: Any, *_: Any) -> None:
        self.shutdown(cancel_futures=kind is not None)

    def _new_pool(self, processes: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            processes,
            multiprocessing.get_context("spawn"),
            initializer=_begin,
            initargs=(self._threads, self._lifeline),
        )

    def _done(self, job: _Job, inner: Future) -> None:
        """Pass a result on; what was lost with a pool joins the suspects."""
        if inner.cancelled():
            job.future.cancel()
            job.future.set_running_or_notify_cancel()
        elif isinstance(inner.exception(), BrokenProcessPool) and not self._closed:
            with self._lock:
                self._suspects.append(job)
                self._next_suspect()
        else:
            _pass_on(inner, job.future)

    def _next_suspect(self) -> None:
        """Start one suspect in a process of its own, unless another is there already."""
        with self._lock:
            if self._alone or not self._suspects or self._closed:
                return
            job = self._alone = self._suspects.popleft()
            self._quarantine = self._quarantine or self._new_pool(1)
            inner = _submit(self._quarantine, job)
            inner.add_done_callback(partial(self._suspect_done, job))

    def _suspect_done(self, job: _Job, inner: Future) -> None:
        died = not inner.cancelled() and isinstance(inner.exception(), BrokenProcessPool)
        with self._lock:
            self._alone = None
            if died:
                self._quarantine = None
            job.lone_deaths += died
            if died and job.lone_deaths < LONE_DEATHS:
                self._suspects.append(job)
            self._next_suspect()
        if inner.cancelled():
            job.future.cancel()
            job.future.set_running_or_notify_cancel()
        elif died and job.lone_deaths >= LONE_DEATHS:
            sentence = (
                f"its process died {job.lone_deaths} times, with no other measurement beside it; "
                "see whether the memory was used up, it was ended for its time, or something ended "
                "it from outside"
            )
            settle(job.future, error=EnvlightError(sentence))
        elif not died:
            _pass_on(inner, job.future)


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


def _pass_on(inner: Future, outer: Future) -> None:
    error = inner.exception()
    settle(outer, None if error else inner.result(), error)


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
