"""Jobs on an executor: so many at once, each result handled in the calling thread, in turn.

An executor may tell by `slots` how many tasks it can work on at once, also while that changes. No
more than these are given to it, so that a stop finds little that is begun and not finished. Tasks
that take so little that sending them would take longer are sent several at a time.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from typing import Any

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
    """Runs each task at once, in the calling thread."""

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
    coming: Iterator[Iterable[Job]],
    running: dict[Future, tuple[list[Job], deque[Job]]],
    size: int,
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
    return int(getattr(executor, "slots", os.cpu_count() or 1))
