"""Calling what may crash, hang or take all memory: in a process of its own, with limits.

The process serves many calls and is started anew when one of them ends it, so that each of
thousands of files costs a message and not a start.
"""

import multiprocessing
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from samplers import EnvlightError

MOST_BYTES = 2 << 30
"""Resident memory that no call may exceed; address space may grow by as much."""
FINE, REFUSED = "fine", "refused"
TRACEBACK, CRASH, HANG, MEMORY = "traceback", "crash", "hang", "memory"


@dataclass(frozen=True)
class Verdict:
    """How a call ended.

    kind : fine, refused (by a sentence of the project), traceback, crash, hang or memory
    text : what it returned, or the sentence, or what went wrong"""

    kind: str
    text: str = ""


class Guard:
    """A process that calls `function(argument)` for one argument after another.

    function : importable by name; returns what can be printed
    seconds : time limit of a call"""

    def __init__(self, function: Callable[[Any], Any], seconds: float = 20.0) -> None:
        self._function, self._seconds = function, seconds
        self._context = multiprocessing.get_context("spawn")
        self._process: Any = None
        self._connection: Connection | None = None
        self.slowest = 0.0
        self.peak_bytes = 0

    def __enter__(self) -> "Guard":
        return self

    def __exit__(self, *error: object) -> None:
        self._stop()

    def call(self, argument: Any) -> Verdict:
        """How function(argument) ended; faults are told, never raised."""
        if self._process is None:
            self._start()
        assert self._connection is not None
        started = time.perf_counter()
        self._connection.send(argument)
        # Twice, as both processes may have been stopped, or the machine asleep, the first time.
        if not any(self._connection.poll(self._seconds / 2.0) for _ in range(2)):
            self._stop()
            return Verdict(HANG, f"no answer within {self._seconds:g} s")
        try:
            kind, text, peak = self._connection.recv()
        except EOFError:
            self._process.join()
            code = self._process.exitcode
            self._stop()
            return Verdict(CRASH, f"the process ended with status {code}")
        self.slowest = max(self.slowest, time.perf_counter() - started)
        self.peak_bytes = max(self.peak_bytes, peak)
        if peak > MOST_BYTES:
            self._stop()  # the peak is the process's, so that the next would be blamed for it
            return Verdict(MEMORY, f"{peak / 2**30:.1f} GiB were taken")
        return Verdict(kind, text)

    def _start(self) -> None:
        here, there = self._context.Pipe()
        self._process = self._context.Process(
            target=_serve, args=(there, self._function), daemon=True
        )
        self._process.start()
        there.close()
        here.recv()  # it is ready: the first call is not charged with imports
        self._connection = here

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            assert self._connection is not None
            self._connection.close()
        self._process = self._connection = None


def _serve(connection: Connection, function: Callable[[Any], Any]) -> None:
    """Answer each argument with kind, text and the peak of resident memory so far."""
    _limit_memory()
    connection.send("ready")
    while True:
        try:
            argument = connection.recv()
        except EOFError:
            return
        try:
            kind, text = FINE, str(function(argument))
        except EnvlightError as error:
            kind, text = REFUSED, str(error)
        except BaseException as error:  # all that is not the project's own is what is looked for
            kind, text = TRACEBACK, f"{type(error).__name__}: {error}"
        connection.send((kind, text, _peak_bytes()))


def _limit_memory() -> None:
    """Let address space grow by the limit at most: a larger demand fails at once."""
    if not sys.platform.startswith("linux"):
        return
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 - not a path of a user
        pages = int(file.read().split()[0])
    most = pages * resource.getpagesize() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _peak_bytes() -> int:
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
