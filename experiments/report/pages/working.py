"""Work on several cores at once, and what is said of it meanwhile."""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from experiments.progress import Told
from experiments.run.executors import PROCESSES, make_executor


@contextmanager
def workers(count: int) -> Iterator[Executor]:
    """Processes with a thread each; for 1 this one, which works as it is asked."""
    if count == 1:
        yield AtOnce()
        return
    with make_executor(PROCESSES, count, threads=1) as executor:
        assert executor is not None
        yield executor


class AtOnce(Executor):
    """Works in this process, when it is asked."""

    def submit(self, fn, /, *args, **kwargs) -> Future:
        return done(fn(*args, **kwargs))


def done(result: Any) -> Future:
    future: Future = Future()
    future.set_result(result)
    return future


def wait_for(told: Told, what: str, futures: Sequence[Future]) -> None:
    """Wait for all, and tell how many are there."""
    told.working_on(f"pages: {what}")
    told.done, told.total = 0, len(futures)
    for future in futures:
        future.result()
        told.advance()
