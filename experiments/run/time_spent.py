"""Where a run's processor time goes, by kind of work, in all its processes.

Code that does a kind of work says so: `with time_spent.on(JUDGING): …`. What all threads of the
process have used between two such changes goes in equal parts to what its threads were at, to
`OTHER` where none had said anything. Compiling is told by Numba, wherever it happens, and measured
by the clock of the thread that compiles. The parts of a process add up to what the system says it
used, threads and start-up included.

A process of an executor hands over what it used with the result of each task.
"""

import os
import socket
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from numba.core import event

from experiments.run.record import add_to_record

COMPILING = "compiling"
MAPS = "maps"
REFERENCES = "references"
LIGHTS = "preparing lights"
RENDERING = "rendering"
JUDGING = "judging"
KEEPING = "keeping results"
REPORT = "pictures and report"
OTHER = "start-up and other"

Seconds = Mapping[str, float]


@dataclass
class _Account:
    """What this process has used since it was last asked.

    at : what each thread says that it does, the innermost last
    settled : processor time of the process up to which `used` tells
    compiled : processor time of compiling that is not in `used` yet
    """

    used: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    at: dict[int, list[str]] = field(default_factory=dict)
    settled: float = 0.0
    compiled: float = 0.0
    lock: threading.RLock = field(default_factory=threading.RLock)

    def settle(self) -> None:
        """Hand out the time since the last change."""
        now = time.process_time()
        shared = now - self.settled - self.compiled
        kinds = [stack[-1] for stack in self.at.values()] or [OTHER]
        for kind in kinds:
            self.used[kind] += shared / len(kinds)
        self.used[COMPILING] += self.compiled
        self.settled, self.compiled = now, 0.0


_account = _Account()


@contextmanager
def on(kind: str) -> Iterator[None]:
    """What is done inside is `kind`, but for what says otherwise."""
    thread = threading.get_ident()
    with _account.lock:
        _account.settle()
        _account.at.setdefault(thread, []).append(kind)
    try:
        yield
    finally:
        with _account.lock:
            _account.settle()
            _account.at[thread].pop()
            if not _account.at[thread]:
                del _account.at[thread]


def taken() -> dict[str, float]:
    """Processor seconds by kind that this process used since this was last asked."""
    with _account.lock:
        _account.settle()
        used, _account.used = _account.used, defaultdict(float)
    return dict(used)


def add(kind: str, seconds: Seconds) -> None:
    """Count what another process used, whatever it said that it did, as `kind` here."""
    with _account.lock:
        _account.used[kind] += sum(seconds.values())


class _Compiling(event.Listener):
    """Adds the time of the outermost function that a thread compiles, with all that it calls."""

    def __init__(self) -> None:
        self._thread = threading.local()

    def on_start(self, event: event.Event) -> None:
        depth = getattr(self._thread, "depth", 0)
        if depth == 0:
            self._thread.started = time.thread_time()
        self._thread.depth = depth + 1

    def on_end(self, event: event.Event) -> None:
        self._thread.depth -= 1
        if self._thread.depth == 0:
            with _account.lock:
                _account.compiled += time.thread_time() - self._thread.started


event.register("numba:compile", _Compiling())


def _here() -> tuple[str, int]:
    return socket.gethostname(), os.getpid()


def handing_over(function: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, Seconds]]:
    """The function for an executor: it returns its result with what its process used for it.

    In this process itself, which asks for its own time at the end, that is nothing.
    """
    return partial(_with_time, function, _here())


def _with_time(
    function: Callable[[Any], Any], home: tuple[str, int], task: Any
) -> tuple[Any, Seconds]:
    result = function(task)
    return result, {} if _here() == home else taken()


def table(seconds: Seconds) -> str:
    """Processor seconds and shares by kind of work, the largest first, as lines to print."""
    whole = sum(seconds.values())
    lines = [
        f"  {kind:<20}{used:8.1f} s{used / (whole or 1.0):6.0%}"
        for kind, used in added(seconds).items()
    ]
    return "\n".join([f"processor time: {whole:.1f} s", *lines])


def tell(folder: Path, elsewhere: Seconds | None = None) -> None:
    """Add to a run's record, and print, what was used since its start.

    elsewhere : what other processes handed over
    """
    seconds = added(taken(), elsewhere or {})
    add_to_record(folder, {"processor_seconds": seconds})
    print(table(seconds), file=sys.stderr)


def added(*parts: Seconds) -> dict[str, float]:
    """The sum of several, the largest first."""
    total: Counter[str] = Counter()
    for part in parts:
        total.update(part)
    return dict(total.most_common())
