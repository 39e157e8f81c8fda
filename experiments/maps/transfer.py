"""How far a transfer is, on the terminal: on stderr, and silent elsewhere."""

from collections.abc import Iterator
from contextlib import contextmanager


class Transfer:
    """How far a transfer is; says nothing."""

    def working_on(self, what: str) -> None: ...
    def reached(self, count: int) -> None: ...


@contextmanager
def transfer_progress(what: str, total: int, in_bytes: bool = False) -> Iterator[Transfer]:
    """A progress bar over `total` steps or bytes where stderr is a terminal, nothing otherwise."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal or not total:
        yield Transfer()
        return
    counts = (DownloadColumn(), TransferSpeedColumn()) if in_bytes else (MofNCompleteColumn(),)
    columns = (TextColumn("{task.description}"), BarColumn(), *counts, TimeRemainingColumn())
    with Bar(*columns, console=console) as bar:
        yield _TerminalTransfer(bar, bar.add_task(what, total=total))


class _TerminalTransfer(Transfer):
    def __init__(self, bar, task) -> None:
        self._bar, self._task = bar, task

    def working_on(self, what: str) -> None:
        self._bar.update(self._task, description=what)

    def reached(self, count: int) -> None:
        self._bar.update(self._task, completed=count)
