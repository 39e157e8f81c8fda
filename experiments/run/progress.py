"""Progress on the terminal: counts, rate and remaining time, on stderr; silent elsewhere."""

from collections.abc import Iterator
from contextlib import contextmanager

from experiments.run.runner import Progress, SilentProgress


@contextmanager
def terminal_progress() -> Iterator[Progress]:
    """A progress bar where stderr is a terminal, nothing otherwise."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal:
        yield SilentProgress()
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TaskProgressColumn(show_speed=True),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=console) as bar:
        yield _TerminalProgress(bar)


class _TerminalProgress:
    def __init__(self, bar) -> None:
        self._bar = bar
        self._task = bar.add_task("measurements", total=None)

    def begin(self, total: int, stored: int) -> None:
        self._bar.update(self._task, total=total)
        if stored:
            self._bar.console.print(f"{stored} measurements are stored already, {total} are left")

    def working_on(self, what: str) -> None:
        self._bar.update(self._task, description=what)

    def advance(self) -> None:
        self._bar.advance(self._task)
