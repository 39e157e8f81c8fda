"""References that another run has rendered already: linked into this one's folder.

A reference's key tells all that determines it, so any run folder's image of that key will do whose
pixels are those that its store tells. The image comes by a hard link, or as a copy where the file
system has none; it appears whole or not at all, and the other run's folder is only read.
"""

import os
import shutil
from functools import partial
from pathlib import Path
from typing import Any

from experiments.measure import ReferenceTask, has_reference, reference_path
from experiments.store import DATABASE, Store
from renderer.image import write_whole
from samplers import EnvlightError


def take_reference(task: ReferenceTask, beside: str) -> dict[str, Any] | None:
    """Link a block's reference from one of the run folders in `beside`; its row, None without."""
    mine, key = Path(task.folder), task.block.key
    for folder in _run_folders(Path(beside)):
        there = reference_path(folder, task.block)
        if not there.is_file() or folder.resolve() == mine.resolve():
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


def _run_folders(place: Path) -> list[Path]:
    try:
        return sorted(folder for folder in place.iterdir() if (folder / DATABASE).is_file())
    except OSError:
        return []


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
