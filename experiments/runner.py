"""Running cells: what is stored already is left alone, the rest is measured and committed.

Tasks go to any `concurrent.futures.Executor`; results come back to the one process that writes. A
block's reference goes first, then its cells. The default executor works in this process, where
kernels already use all cores.
"""

from collections.abc import Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, Protocol

from experiments.cell import Block, Cell
from experiments.store import Store, StoreError
from samplers import EnvlightError


class Progress(Protocol):
    """What the runner tells while it works."""

    def begin(self, total: int, stored: int) -> None: ...
    def working_on(self, what: str) -> None: ...
    def advance(self) -> None: ...


class SilentProgress:
    """No output at all."""

    def begin(self, total: int, stored: int) -> None: ...
    def working_on(self, what: str) -> None: ...
    def advance(self) -> None: ...


class SerialExecutor(Executor):
    """Runs each task at once, in the calling thread."""

    def submit(self, fn, /, *args, **kwargs) -> Future:
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@dataclass
class Outcome:
    """What a run did.

    measured, stored : cells measured now, and found finished
    failures : one sentence per cell that could not be measured
    """

    measured: int = 0
    stored: int = 0
    failures: list[str] = field(default_factory=list)


def missing_cells(store: Store, cells: Iterable[Cell]) -> list[Cell]:
    """The cells that have no stored result, in their order."""
    return [cell for cell in cells if store.get("cell", cell.key) is None]


def run_cells(
    store: Store,
    cells: list[Cell],
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep_images: bool = True,
    beside: Path | None = None,
) -> Outcome:
    """Measure the cells that are not stored yet. A cell that fails is reported, not stored.

    beside : a folder of run folders whose references may be taken

    Raises StoreError where results cannot be stored any more.
    """
    executor = executor or SerialExecutor()
    progress = progress or SilentProgress()
    todo = missing_cells(store, cells)
    outcome = Outcome(stored=len(cells) - len(todo))
    progress.begin(len(todo), outcome.stored)
    for block, members in groupby(todo, key=lambda cell: cell.block):
        group = list(members)
        progress.working_on(str(block))
        try:
            reference = _reference(store, block, executor, beside)
        except StoreError:
            raise
        except Exception as error:
            outcome.failures += [f"{cell}: {_sentence(error)}" for cell in group]
            for _ in group:
                progress.advance()
            continue
        _run_group(store, group, reference, executor, progress, outcome, keep_images)
    return outcome


def _reference(
    store: Store, block: Block, executor: Executor, beside: Path | None
) -> dict[str, Any]:
    """The row of the block's reference.

    Where it or its image is missing or damaged, it is taken from another run, or rendered.
    """
    from experiments.measure import ReferenceTask, has_reference, measure_reference
    from experiments.shared_references import take_reference

    task = ReferenceTask(block, str(store.folder))
    stored = store.get("reference", block.key)
    if stored and executor.submit(has_reference, task, stored["pixels"]).result():
        return stored
    row: dict[str, Any] | None = None
    if beside is not None:
        row = executor.submit(take_reference, task, str(beside)).result()
    if row is None:
        row = executor.submit(measure_reference, task).result()
    assert row is not None
    if stored is None:
        store.put("reference", block.key, block.identity, row)
    elif row["pixels"] != stored["pixels"]:
        raise EnvlightError(
            f"{store.folder}: the reference image of {block} was lost, and rendering it again "
            "gives another one; restore the folder, or start in a new one by --output"
        )
    return row


def _run_group(
    store: Store,
    group: list[Cell],
    reference: dict[str, Any],
    executor: Executor,
    progress: Progress,
    outcome: Outcome,
    keep_images: bool,
) -> None:
    from experiments.measure import CellTask, measure_cell

    def start(cell: Cell) -> Future:
        keep = keep_images and cell.seed == 0
        task = CellTask(cell, str(store.folder), reference["noise_floor"], keep)
        return executor.submit(measure_cell, task)

    # A serial executor has done the work when `submit` returns, so each row is committed before
    # the next cell starts; others get the whole block at once.
    waiting = (
        ((cell, start(cell)) for cell in group)
        if isinstance(executor, SerialExecutor)
        else [(cell, start(cell)) for cell in group]
    )
    for cell, future in waiting:
        try:
            store.put("cell", cell.key, cell.identity, future.result())
            outcome.measured += 1
        except StoreError:
            raise
        except Exception as error:
            outcome.failures.append(f"{cell}: {_sentence(error)}")
        progress.advance()


def _sentence(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if isinstance(error, EnvlightError) else f"{type(error).__name__}: {text}"


def run_folder(output: Path | None, experiment: str, scale: str) -> Path:
    """The folder of a run: the one asked for, or runs/EXPERIMENT-SCALE."""
    return output or Path("runs") / f"{experiment}-{scale}"
