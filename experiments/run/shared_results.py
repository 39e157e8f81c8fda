"""Results that another run has already: taken into this one's folder instead of measured again.

A key tells all that determines a reference or a cell, so any run folder's will do: a reference's
image must have the pixels that its store tells, a cell its image where images are kept. Images come
by a hard link, or as a copy where the file system has none; they appear whole or not at all, and
the other run's folder is only read.
"""

import os
import shutil
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from experiments.run.measure import (
    ReferenceTask,
    has_reference,
    image_path,
    keeps_image,
    reference_path,
)
from experiments.run.measurement import Block, Cell
from experiments.run.store import DATABASE, Store
from renderer.image import write_whole
from samplers import EnvlightError


def take_reference(task: ReferenceTask, beside: Path) -> dict[str, Any] | None:
    """Link a block's reference from one of the run folders in `beside`; its row, None without."""
    mine, key = Path(task.folder), task.block.key
    for folder in _run_folders(beside, mine):
        there = reference_path(folder, task.block)
        if not there.is_file():
            continue
        try:
            with Store.reading(folder) as store:
                row = store.get("reference", key)
            if row and has_reference(ReferenceTask(task.block, str(folder)), row["pixels"]):
                write_whole(reference_path(mine, task.block), partial(_link, there))
                return row
        except (EnvlightError, OSError):
            continue  # such a folder is of no use; the reference is rendered instead
    return None


def take_cells(store: Store, cells: list[Cell], images: bool, beside: Path) -> int:
    """Store the rows of missing cells that run folders in `beside` hold; returns how many.

    Of a block whose reference is nowhere, none is taken; times are always measured.
    images : whether images are kept
    """
    cells = [cell for cell in cells if not cell.budget.timed]
    found: dict[Cell, tuple[Path, dict[str, Any]]] = {}
    for folder in _run_folders(beside, store.folder):
        try:
            with Store.reading(folder) as other:
                for cell in cells:
                    if cell in found or (row := other.get("cell", cell.key)) is None:
                        continue
                    if not (images and keeps_image(cell)) or image_path(folder, cell).is_file():
                        found[cell] = folder, row
        except EnvlightError:
            continue  # such a folder is of no use; its cells are measured instead
    taken = 0
    for block, members in groupby(found, key=lambda cell: cell.block):
        if not _has_reference(store, block, beside):
            continue
        for cell in members:
            folder, row = found[cell]
            if images and keeps_image(cell):
                write_whole(
                    image_path(store.folder, cell), partial(_link, image_path(folder, cell))
                )
            store.put("cell", cell.key, cell.identity, row)
            taken += 1
    return taken


def _has_reference(store: Store, block: Block, beside: Path) -> bool:
    """Whether the block's reference is in the run's folder, now at the latest."""
    task = ReferenceTask(block, str(store.folder))
    stored = store.get("reference", block.key)
    if stored is not None:
        return has_reference(task, stored["pixels"])
    row = take_reference(task, beside)
    if row is not None:
        store.put("reference", block.key, block.identity, row)
    return row is not None


def _run_folders(place: Path, mine: Path) -> list[Path]:
    """The run folders in a place, without one's own."""
    try:
        found = sorted(folder for folder in place.iterdir() if (folder / DATABASE).is_file())
    except OSError:
        return []
    return [folder for folder in found if folder.resolve() != mine.resolve()]


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
