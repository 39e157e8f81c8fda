"""Work on several cores at once, and what is said of it meanwhile."""

import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from experiments.run.executors import PROCESSES, make_executor

SAID_EVERY = 10.0
"""Seconds between lines on what is being made, where nobody sees one line change."""


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


class Told:
    """Tells on the standard error what is being made, and how much of it is done."""

    def __init__(self) -> None:
        self._begun = self._last = time.monotonic()
        self._shown = sys.stderr.isatty()

    def __call__(self, what: str) -> None:
        now = time.monotonic()
        if self._shown:
            print(f"\r\033[Kpages: {what}", end="", file=sys.stderr, flush=True)
        elif now - self._last >= SAID_EVERY:
            print(
                f"envlight: pages: {what}, {now - self._begun:.0f} s", file=sys.stderr, flush=True
            )
            self._last = now

    def each(self, what: str, futures: Sequence[Future]) -> None:
        """Wait for all."""
        for place, future in enumerate(futures):
            self(f"{what}, {place} of {len(futures)}")
            future.result()

    def end(self) -> None:
        """Nothing is left to do."""
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
