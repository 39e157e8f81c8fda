"""What is told on stderr of work that takes long: what is worked on, and how far it is.

On a terminal a line that moves; elsewhere, as in a log, a sentence soon and every half minute.
"""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any

SHOWN_SECONDS, SAID_SECONDS = 0.1, 30.0
"""Between two looks at what is done: for the line on a terminal, and for a sentence elsewhere."""
SHORT_SECONDS, SOON_SECONDS = 0.5, 1.0
"""What takes no longer is not told: on a terminal, and elsewhere."""


class Told:
    """What is worked on, and so many of its steps or bytes; 0 of them where nobody knows."""

    def __init__(self, what: str, total: int = 0, in_bytes: bool = False) -> None:
        self.what, self.total, self.done, self.in_bytes = what, total, 0, in_bytes

    def working_on(self, what: str) -> None:
        """Say what is worked on now."""
        self.what = what

    def advance(self) -> None:
        """One step more is done."""
        self.done += 1

    def __str__(self) -> str:
        if not self.total:
            return self.what
        unit, name = (1e6, " MB") if self.in_bytes else (1, "")
        return f"{self.what}, {self.done / unit:.0f} of {self.total / unit:.0f}{name}"


_told: list[Told] = []


@contextmanager
def telling(what: str, total: int = 0, in_bytes: bool = False) -> Iterator[Told]:
    """Tell of what is done inside; where something is told already, instead of that.

    total : steps or bytes that it takes, 0 where nobody knows
    """
    told = Told(what, total, in_bytes)
    _told.append(told)
    try:
        with _teller() if len(_told) == 1 else nullcontext():
            yield told
    finally:
        _told.remove(told)


@contextmanager
def _teller() -> Iterator[None]:
    ended = threading.Event()
    tell = _show if sys.stderr.isatty() else _say
    thread = threading.Thread(target=tell, args=(ended,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _say(ended: threading.Event) -> None:
    begun = time.monotonic()
    pause = SOON_SECONDS
    while not ended.wait(pause):
        pause = SAID_SECONDS
        seconds = time.monotonic() - begun
        with suppress(OSError, ValueError):  # nobody hears it
            print(f"envlight: {_told[-1]}, {seconds:.0f} s", file=sys.stderr, flush=True)


def _show(ended: threading.Event) -> None:
    if ended.wait(SHORT_SECONDS):
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as Remaining

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), Remaining()
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, redirect_stdout=False) as line:
        shown: Any = None
        while not ended.wait(SHOWN_SECONDS):
            told = _told[-1]
            if told is not shown:
                shown, task = told, line.add_task("", total=told.total or None)
                for other in line.task_ids[:-1]:
                    line.remove_task(other)
            text = str(told).replace("[", "\\[")
            line.update(task, description=text, completed=told.done, total=told.total or None)
