"""Running cells: what is stored already is left alone, the rest is measured and committed.

Tasks go to any `concurrent.futures.Executor`; results come back to the one process that writes. A
block's reference goes first, then its cells. The default executor works in this process, where
kernels already use all cores.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from experiments.run.measurement import Block, Cell
from experiments.run.schedule import Job, run_jobs
from experiments.run.store import Store, StoreError
from samplers import EnvlightError

if TYPE_CHECKING:
    from experiments.run.measure import CellTask


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

    slots = 1

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

    Cells with a budget of seconds come last, when nothing else runs, in this process whatever the
    executor: their times are of one machine and can be compared.

    beside : a folder of run folders whose references and cells may be taken

    Raises StoreError where results cannot be stored any more.
    """
    executor = executor or SerialExecutor()
    todo = missing_cells(store, cells)
    if beside is not None and todo:
        from experiments.run.shared_results import take_cells

        if take_cells(store, todo, keep_images, beside):
            todo = missing_cells(store, cells)
    run = _Run(store, progress or SilentProgress(), keep_images, beside)
    run.outcome.stored = len(cells) - len(todo)
    run.progress.begin(len(todo), run.outcome.stored)
    run_jobs(executor, run.jobs(todo))
    run_jobs(SerialExecutor(), run.timed_jobs())
    run.outcome.failures = [run.failed[cell.key] for cell in todo if cell.key in run.failed]
    return run.outcome


class _Run:
    """What jobs are made from, and what is done with their results."""

    def __init__(
        self, store: Store, progress: Progress, keep_images: bool, beside: Path | None
    ) -> None:
        self.store, self.progress = store, progress
        self.outcome = Outcome()
        self.failed: dict[str, str] = {}
        self._keep_images, self._beside = keep_images, beside
        self._timed: list[list[CellTask]] = []

    def jobs(self, cells: Iterable[Cell]) -> Iterator[Job]:
        """The references of all blocks, and, as they come, the cells that are not timed."""
        for block, members in groupby(cells, key=lambda cell: cell.block):
            group = list(members)
            self.progress.working_on(str(block))
            try:
                begun = self._begin_block(block, group)
            except StoreError:
                raise
            except Exception as error:
                begun = self._fail_all(group, error)
            yield from begun

    def timed_jobs(self) -> Iterator[Job]:
        """The timed cells of the blocks that have a reference, side by side per budget."""
        from experiments.run.timed import measure_timed

        for tasks in self._timed:
            self.progress.working_on(str(tasks[0].cell.block))
            yield Job(measure_timed, tasks, partial(self._keep_timed, tasks))

    def _begin_block(self, block: Block, cells: list[Cell]) -> list[Job]:
        """The block's cells where its reference is there, or else the reference."""
        from experiments.run.measure import ReferenceTask, has_reference, measure_reference
        from experiments.run.shared_results import take_reference

        task = ReferenceTask(block, str(self.store.folder))
        stored = self.store.get("reference", block.key)
        if stored and has_reference(task, stored["pixels"]):
            return self._cell_jobs(cells, stored)
        if self._beside is not None and (row := take_reference(task, self._beside)):
            return self._keep_reference(block, cells, lambda: row)
        return [
            Job(
                measure_reference,
                task,
                lambda future: self._keep_reference(block, cells, future.result),
            )
        ]

    def _keep_reference(
        self, block: Block, cells: list[Cell], result: Callable[[], dict[str, Any]]
    ) -> list[Job]:
        """Store the row of a reference; the jobs that it allows."""
        try:
            row = result()
            stored = self.store.get("reference", block.key)
            if stored is None:
                self.store.put("reference", block.key, block.identity, row)
            elif row["pixels"] != stored["pixels"]:
                raise EnvlightError(
                    f"{self.store.folder}: the reference image of {block} was lost, and rendering "
                    "it again gives another one; restore the folder, or start in a new one by "
                    "--output"
                )
        except StoreError:
            raise
        except Exception as error:
            return self._fail_all(cells, error)
        return self._cell_jobs(cells, row)

    def _cell_jobs(self, cells: list[Cell], reference: dict[str, Any]) -> list[Job]:
        from experiments.run.measure import CellTask, keeps_image, measure_cell

        folder, floor = str(self.store.folder), reference["noise_floor"]
        tasks = [
            CellTask(cell, folder, floor, self._keep_images and keeps_image(cell)) for cell in cells
        ]
        timed = [task for task in tasks if task.cell.budget.timed]
        for budget in dict.fromkeys(task.cell.budget for task in timed):
            self._timed.append([task for task in timed if task.cell.budget == budget])
        return [
            Job(measure_cell, task, partial(self._keep_cell, task))
            for task in tasks
            if not task.cell.budget.timed
        ]

    def _keep_cell(self, task: "CellTask", future: Future) -> None:
        try:
            cell = task.cell
            self.store.put("cell", cell.key, cell.identity, future.result())
        except StoreError:
            raise
        except Exception as error:
            self._fail(task.cell, error)
        else:
            self.outcome.measured += 1
            self.progress.advance()

    def _keep_timed(self, tasks: list["CellTask"], future: Future) -> None:
        try:
            measured: list[Future] = future.result()
        except Exception as error:
            self._fail_all([task.cell for task in tasks], error)
            return
        for task, row in zip(tasks, measured, strict=True):
            self._keep_cell(task, row)

    def _fail(self, cell: Cell, error: Exception) -> None:
        self.failed[cell.key] = f"{cell}: {_sentence(error)}"
        self.progress.advance()

    def _fail_all(self, cells: list[Cell], error: Exception) -> list[Job]:
        for cell in cells:
            self._fail(cell, error)
        return []


def _sentence(error: Exception) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, OSError) and error.strerror:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror}; check the permissions and the space left"
    return text if isinstance(error, EnvlightError) else f"{type(error).__name__}: {text}"


def run_folder(output: Path | None, experiment: str, scale: str) -> Path:
    """The folder of a run: the one asked for, or runs/EXPERIMENT-SCALE."""
    return output or Path("runs") / f"{experiment}-{scale}"
