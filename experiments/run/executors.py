"""Who works on jobs: this process, several of this machine, or a Dask cluster.

So many jobs are worked on at once, each result handled in the calling thread, in turn. An executor
may tell by `slots` how many tasks it can work on at once, also while that changes. No more than
these are given to it, so that a stop finds little that is begun and not finished. Tasks that take
so little that sending them would take longer are sent several at a time.

`concurrent.futures.ProcessPoolExecutor` gives up everything that was submitted when one of its
processes dies. Here every process is a pool of its own, which is made anew: only the task that it
worked on was lost, and that runs once more. A task goes to the process that was idle last, which
has loaded what belongs to it.
"""

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from typing import Any

from experiments.run.machine import keep_freed_memory
from samplers import EnvlightError
from samplers.threads import core_count, set_thread_count

SHORT_SECONDS, SENT_SECONDS, MOST_SENT = 0.005, 0.1, 256
"""Tasks that take less than the first are sent together: what takes the second, and so many."""


@dataclass(frozen=True, eq=False)
class Job:
    """function(argument) on the executor; then(future) here, which gives the jobs that follow."""

    function: Callable[[Any], Any]
    argument: Any
    then: Callable[[Future], "Iterable[Job] | None"]


@dataclass(frozen=True)
class Done:
    """What became of tasks that were sent together: a result or an error of each; their seconds."""

    results: list[tuple[Any, Exception | None]]
    seconds: float


class SerialExecutor(Executor):
    """Runs each task in this thread at once."""

    slots = 1

    def submit(self, fn, /, *args, **kwargs) -> Future:
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def work_off(function: Callable[[Any], Any], arguments: Sequence[Any]) -> Done:
    """The function of each argument, one after another; an error is that of one of them."""
    started = time.perf_counter()
    results: list[tuple[Any, Exception | None]] = []
    for argument in arguments:
        try:
            results.append((function(argument), None))
        except Exception as error:
            results.append((None, error))
    return Done(results, time.perf_counter() - started)


def run_jobs(executor: Executor, lines: Iterable[Iterable[Job]]) -> None:
    """Run lines of jobs and those that follow from them. What follows goes before what is waiting.

    A line is worked off by one process at a time, which has loaded what belongs to it; so is what
    follows from its jobs. Where nothing else is waiting, the others take from the longest.

    An error of `then` ends it; what has not begun is called off.
    """
    coming = iter(lines)
    idle: deque[deque[Job]] = deque()
    running: dict[Future, tuple[list[Job], deque[Job]]] = {}
    alone: set[Job] = set()  # of a batch that was lost
    size = 1
    try:
        while True:
            while len(running) < slots(executor):
                line = idle.popleft() if idle else _new_line(coming, running, size)
                if not line:
                    break
                batch = [line.popleft()]
                while line and len(batch) < size and _together(batch[0], line[0], alone):
                    batch.append(line.popleft())
                arguments = [one.argument for one in batch]
                running[executor.submit(work_off, batch[0].function, arguments)] = batch, line
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                batch, line = running.pop(future)
                if len(batch) > 1 and future.exception() is not None:
                    alone.update(batch)
                    line.extendleft(reversed(batch))
                else:
                    size = _next_size(future, size)
                    follows = [job for one in _told(future, batch) for job in one]
                    line.extendleft(reversed(follows))
                if line:
                    idle.append(line)
    finally:
        for future in running:
            future.cancel()


def _told(future: Future, batch: list[Job]) -> Iterator[Iterable[Job]]:
    """Hand over the results of a batch; what follows from each."""
    error = future.exception()
    results = [(None, error)] if error else future.result().results
    for job, (result, failure) in zip(batch, results, strict=True):
        single: Future = Future()
        settle(single, result, failure)
        yield job.then(single) or ()


def _next_size(future: Future, size: int) -> int:
    """How many tasks are sent at a time after these."""
    if future.exception() is not None:
        return 1
    done: Done = future.result()
    each = done.seconds / len(done.results)
    if each > SHORT_SECONDS:
        return 1
    return max(1, min(2 * size, MOST_SENT, int(SENT_SECONDS / max(each, 1e-9))))


def _together(one: Job, other: Job, alone: set[Job]) -> bool:
    """Whether two jobs may be sent together."""
    return one.function == other.function and not {one, other} & alone


def _new_line(
    coming: Iterator[Iterable[Job]], running: dict[Future, tuple[list[Job], deque[Job]]], size: int
) -> deque[Job]:
    """The next line that has a job, or else the end of the longest that is worked on."""
    for jobs in coming:
        if line := deque(jobs):
            return line
    longest = max((line for _, line in running.values()), key=len, default=deque())
    taken = [longest.pop() for _ in range(min(size, (len(longest) + 1) // 2))]
    return deque(reversed(taken))


def settle(future: Future, result: Any = None, error: BaseException | None = None) -> None:
    """Give a future its result or error, unless it was called off."""
    if not future.set_running_or_notify_cancel():
        return
    if error is None:
        future.set_result(result)
    else:
        future.set_exception(error)


def slots(executor: Executor) -> int:
    """How many tasks an executor gets at once; for one that does not tell, as many as cores."""
    return int(getattr(executor, "slots", core_count()))


DEATHS = 2
"""A task whose process dies this often is given up."""


class ProcessExecutor(Executor):
    """`slots` processes, whose kernels run on `threads` threads each.

    A thread waits for each of them. It is the one that lets go of a pool whose process has died: a
    pool that is collected while it gives up its work waits for itself, in some Pythons for ever.
    """

    def __init__(self, slots: int, threads: int) -> None:
        self.slots, self._threads = slots, threads
        self._lifeline, self._keep_alive = multiprocessing.Pipe(duplex=False)
        self._idle = [self._new_pool() for _ in range(slots)]
        self._waiting = ThreadPoolExecutor(slots, "process")
        self._stopped = False

    def submit(self, fn, /, *args, **kwargs) -> Future:
        return self._waiting.submit(self._done, partial(fn, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when all is done; those that still work at once if `cancel_futures`."""
        if cancel_futures:
            self._stopped = True
            self._keep_alive.close()
        self._waiting.shutdown(wait, cancel_futures=cancel_futures)
        if wait:  # a thread that a sampler began holds no process up
            self._keep_alive.close()
        for pool in self._idle:
            pool.shutdown(wait)

    def __exit__(self, kind: Any, *_: Any) -> None:
        self.shutdown(cancel_futures=kind is not None)

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            1,
            multiprocessing.get_context("spawn"),
            initializer=_begin,
            initargs=(self._threads, self._lifeline),
        )

    def _done(self, work: Callable[[], Any]) -> Any:
        """What the process that was idle last makes of it; what dies with it runs once more."""
        pool = self._idle.pop()
        try:
            for _ in range(DEATHS):
                try:
                    with uninterrupted():  # it may begin a process
                        future = pool.submit(work)
                    return future.result()
                except BrokenProcessPool:
                    if self._stopped:
                        raise
                    pool.shutdown()
                    pool = self._new_pool()
        finally:
            self._idle.append(pool)
        raise EnvlightError(
            f"its process died {DEATHS} times; see whether the memory was used up, it was ended "
            "for its time, or something ended it from outside"
        )


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


SERIAL, PROCESSES, DASK = KINDS = "serial", "processes", "dask"


def shared_out(workers: int, threads: int) -> tuple[int, int]:
    """How many workers share out this machine, and the threads of each; 0 is for what it has."""
    cores = core_count()
    workers = workers or cores
    return workers, threads or max(1, cores // workers)


def undisturbed(workers: int, threads: int) -> int:
    """How many workers of so many threads have cores of their own; more wait for one another."""
    return min(workers, max(1, core_count() // threads))
