"""Jobs on an executor: so many at once, each result handled in the calling thread, in turn.

An executor may tell by `slots` how many tasks it can work on at once, also while that changes. No
more than these are given to it, so that a stop finds little that is begun and not finished.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable
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

    An error of `then` ends it; what has not begun is called off.
    """
    coming = iter(jobs)
    following: deque[Job] = deque()
    running: dict[Future, Job] = {}
    try:
        while True:
            while len(running) < slots(executor):
                job = following.popleft() if following else next(coming, None)
                if job is None:
                    break
                running[executor.submit(job.function, job.argument)] = job
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                following.extendleft(reversed(list(running.pop(future).then(future) or ())))
    finally:
        for future in running:
            future.cancel()


def slots(executor: Executor) -> int:
    """How many tasks an executor gets at once; for one that does not tell, as many as cores."""
    return int(getattr(executor, "slots", os.cpu_count() or 1))
