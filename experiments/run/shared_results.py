"""Results that another run has already: taken into this one's folder instead of measured again.

A key tells all that determines a reference, an image or a score, so any run folder's will do: a
reference's image must have the pixels that its store tells, a measurement its image where images
are kept. Images come by a hard link, or as a copy where the file system has none; they appear whole
or not at all, and the other run's folder is only read.
"""

import os
import shutil
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from experiments.run.case import Case
from experiments.run.kept_images import half_path, has_reference, image_path, reference_path
from experiments.run.measurement import Measurement
from experiments.run.store import DATABASE, Store
from metrics.registry import find_metric
from renderer.image import write_whole
from samplers import EnvlightError

Row = dict[str, Any]


def take_reference(case: Case, mine: Path, beside: Path) -> Row | None:
    """Link a case's reference from one of the run folders in `beside`; its row, None without."""
    for folder in run_folders(beside, mine):
        if not reference_path(folder, case).is_file():
            continue
        try:
            with Store.reading(folder) as store:
                row = store.get("reference", case.reference_key)
            if row and has_reference(folder, case, row):
                link_reference(case, mine, folder)
                return row
        except (EnvlightError, OSError):
            continue  # such a folder is of no use; the reference is rendered instead
    return None


def link_reference(case: Case, mine: Path, other: Path) -> None:
    """Put a case's reference from the other folder into mine, the whole image last."""
    for path in (half_path, reference_path):
        write_whole(path(mine, case), partial(_link, path(other, case)))


def take_measurements(
    store: Store, measurements: list[Measurement], images: bool, beside: Path
) -> int:
    """Store images' rows and scores that run folders in `beside` hold; returns how many images.

    Of a case whose reference is nowhere, none is taken; times are always measured.
    images : whether images are kept
    """
    wanted = [
        one for one in measurements if not one.budget.timed and store.get("image", one.key) is None
    ]
    found: dict[Measurement, tuple[Path, Row, dict[str, Row]]] = {}
    for folder in run_folders(beside, store.folder):
        try:
            with Store.reading(folder) as other:
                for one in wanted:
                    row = None if one in found else other.get("image", one.key)
                    if row and (not images or image_path(folder, one).is_file()):
                        found[one] = folder, row, _scores(other, one)
        except EnvlightError:
            continue  # such a folder is of no use; its measurements are measured instead
    taken = 0
    for case, members in groupby(found, key=lambda one: one.case):
        if not _has_reference(store, case, beside):
            continue
        for one in members:
            folder, row, scores = found[one]
            if images:
                link = partial(_link, image_path(folder, one))
                write_whole(image_path(store.folder, one), link)
            with store.together():
                store.put("image", one.key, one.identity, row)
                identities = {
                    key: one.score_identity(find_metric(name))
                    for name, key in one.score_keys.items()
                }
                for name, key in one.case.features_keys.items():
                    identities[key] = one.case.features_identities[name]
                for key, score in scores.items():
                    if store.get("score", key) is None:
                        store.put("score", key, identities[key], score)
            taken += 1
    return taken


def _scores(store: Store, one: Measurement) -> dict[str, Row]:
    """The scores of an image that are there, and the features of its case, by their keys."""
    keys = [*one.score_keys.values(), *one.case.features_keys.values()]
    found = {key: store.get("score", key) for key in keys}
    return {key: score for key, score in found.items() if score is not None}


def _has_reference(store: Store, case: Case, beside: Path) -> bool:
    """Whether the case's reference is in the run's folder, now at the latest."""
    stored = store.get("reference", case.reference_key)
    if stored is not None:
        return has_reference(store.folder, case, stored)
    row = take_reference(case, store.folder, beside)
    if row is not None:
        store.put("reference", case.reference_key, case.reference_identity, row)
    return row is not None


def run_folders(place: Path, mine: Path) -> list[Path]:
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
