"""Results that another run has already: taken into this one's folder instead of measured again.

A key tells all that determines a reference or a measurement, so any run folder's will do: a
reference's image must have the pixels that its store tells, a measurement its image where images
are kept. Images come by a hard link, or as a copy where the file system has none; they appear
whole or not at all, and the other run's folder is only read.
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
from experiments.run.measurement import Case, Measurement
from experiments.run.store import DATABASE, Store
from renderer.image import write_whole
from samplers import EnvlightError


def take_reference(task: ReferenceTask, beside: Path) -> dict[str, Any] | None:
    """Link a case's reference from one of the run folders in `beside`; its row, None without."""
    mine, key = Path(task.folder), task.case.key
    for folder in _run_folders(beside, mine):
        there = reference_path(folder, task.case)
        if not there.is_file():
            continue
        try:
            with Store.reading(folder) as store:
                row = store.get("reference", key)
            if row and has_reference(ReferenceTask(task.case, str(folder)), row["pixels"]):
                write_whole(reference_path(mine, task.case), partial(_link, there))
                return row
        except (EnvlightError, OSError):
            continue  # such a folder is of no use; the reference is rendered instead
    return None


def take_measurements(
    store: Store, measurements: list[Measurement], images: bool, beside: Path
) -> int:
    """Store the rows of missing measurements that run folders in `beside` hold; returns how many.

    Of a case whose reference is nowhere, none is taken; times are always measured.
    images : whether images are kept
    """
    measurements = [measurement for measurement in measurements if not measurement.budget.timed]
    found: dict[Measurement, tuple[Path, dict[str, Any]]] = {}
    for folder in _run_folders(beside, store.folder):
        try:
            with Store.reading(folder) as other:
                for measurement in measurements:
                    if (
                        measurement in found
                        or (row := other.get("measurement", measurement.key)) is None
                    ):
                        continue
                    if (
                        not (images and keeps_image(measurement))
                        or image_path(folder, measurement).is_file()
                    ):
                        found[measurement] = folder, row
        except EnvlightError:
            continue  # such a folder is of no use; its measurements are measured instead
    taken = 0
    for case, members in groupby(found, key=lambda measurement: measurement.case):
        if not _has_reference(store, case, beside):
            continue
        for measurement in members:
            folder, row = found[measurement]
            if images and keeps_image(measurement):
                write_whole(
                    image_path(store.folder, measurement),
                    partial(_link, image_path(folder, measurement)),
                )
            store.put("measurement", measurement.key, measurement.identity, row)
            taken += 1
    return taken


def _has_reference(store: Store, case: Case, beside: Path) -> bool:
    """Whether the case's reference is in the run's folder, now at the latest."""
    task = ReferenceTask(case, str(store.folder))
    stored = store.get("reference", case.key)
    if stored is not None:
        return has_reference(task, stored["pixels"])
    row = take_reference(task, beside)
    if row is not None:
        store.put("reference", case.key, case.identity, row)
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
