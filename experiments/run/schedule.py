"""Jobs on an executor: so many at once, each result handled in the calling thread, in turn.

An executor may tell by `slots` how many tasks it can work on at once, also while that changes. No
more than these are given to it, so that a stop finds little that is begun and not finished.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Job:
    """function(argument) on the executor; then(future) here, which gives the jobs that follow."""

    function: Callable[[Any], Any]
    argument: Any
    then: Callable[[Future], "Iterable[Job] | None"]


def run_jobs(executor: Executor, jobs: Iterable[Job]) -> None:
    """Run the jobs and those that follow from them. What follows goes before what is waiting.

    What follows from a job stays in line behind it, so that the process which did the one, and has
    loaded what belongs to it, gets the others as well; lines that have run out take from the
    longest when nothing else is waiting.

    An error of `then` ends it; what has not begun is called off.
    """
    coming = iter(jobs)
    lines: list[deque[Job]] = []
    running: dict[Future, tuple[Job, deque[Job]]] = {}
    try:
        while True:
            idle = [line for line in lines if all(line is not busy for _, busy in running.values())]
            while len(running) < slots(executor):
                line = idle.pop(0) if idle else deque()
                job = _next(line, coming, lines)
                if job is None:
                    break
                if all(line is not known for known in lines):
                    lines.append(line)
                running[executor.submit(job.function, job.argument)] = job, line
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                job, line = running.pop(future)
                line.extendleft(reversed(list(job.then(future) or ())))
    finally:
        for future in running:
            future.cancel()


def _next(line: deque[Job], coming: Iterator[Job], lines: list[deque[Job]]) -> Job | None:
    """The next job of a line, or else a new one, or else the last of the longest line."""
    if line:
        return line.popleft()
    job = next(coming, None)
    if job is None and any(lines):
        job = max(lines, key=len).pop()
    return job


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
