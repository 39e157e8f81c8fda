"""Pages that compare images: of what was published of them, and of runs whose images are at hand.

Of a run that is at hand the first scene under every map is shown, then the second, and so on, until
the room is used.
"""

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest
from pathlib import Path

import pandas as pd

from experiments.report.case_pages import CasePage
from experiments.report.compared_cases import (
    FOLDER,
    INDEX,
    compared_pages,
    read_compared,
    with_images,
)
from experiments.report.run_data import RunData
from experiments.report.site.publications import Publication
from experiments.report.style import Look
from experiments.run.store import is_run_folder


@dataclass(frozen=True)
class CaseSet:
    """The pages of a run's cases. folder : theirs in the site; skipped : cases for want of room"""

    name: str
    folder: str
    pages: list[CasePage]
    skipped: int


def write_cases(
    ranked: Sequence[Publication], runs: Path | None, site: Path, looks: dict[str, Look], room: int
) -> list[CaseSet]:
    """Write the pictures of all cases that can be shown; returns their pages.

    runs : a folder of runs under their published names, which are preferred to what was published
        of their images; None for none
    room : bytes that pictures may take
    """
    data = {one.name: _at_hand(one, runs) for one in ranked}
    found: list[CaseSet] = []
    for one in ranked:
        published = one.run.folder / FOLDER
        if data[one.name] is None and (published / INDEX).is_file():
            folder = f"runs/{one.name}"
            shutil.copytree(published, site / folder, ignore=shutil.ignore_patterns(INDEX))
            found.append(CaseSet(one.name, folder, read_compared(published), 0))
            room -= _bytes(site / folder)
    able = {name: run for name, run in data.items() if run is not None}
    for place, (name, run) in enumerate(able.items()):
        folder = f"runs/{name}"
        pages, skipped = _fitting(run, looks, site / folder, room // (len(able) - place))
        if pages:
            found.append(CaseSet(name, folder, pages, skipped))
            room -= _bytes(site / folder)
    return found


def _at_hand(one: Publication, runs: Path | None) -> RunData | None:
    """The run that was published, where it is there with its images."""
    there = runs is not None and is_run_folder(runs / one.name)
    return with_images(runs / one.name) if runs is not None and there else None


def _fitting(
    data: RunData, looks: dict[str, Look], folder: Path, room: int
) -> tuple[list[CasePage], int]:
    """The pages of as many cases as fit into the room, and how many do not."""
    order = _in_order(data.rows)
    count, pages = 1, compared_pages(data, looks, folder, order[:1])
    if _bytes(folder) > room:
        shutil.rmtree(folder)
        return [], len(order)
    # The first case tells how many will fit; where they are too many after all, there are fewer.
    most = min(len(order), room // _bytes(folder))
    while most > 1:
        count, pages = most, compared_pages(data, looks, folder, order[:most])
        if _bytes(folder) <= room:
            break
        most -= 1 + most // 10
    else:
        count, pages = 1, compared_pages(data, looks, folder, order[:1])
    return pages, len(order) - count


def _in_order(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Cases: the first scene under every map, then the second, and so on."""
    scenes = [
        [(str(scene), str(name)) for scene in sorted(part["scene"].unique())]
        for name, part in rows.groupby("environment", sort=True)
    ]
    return [case for case in chain.from_iterable(zip_longest(*scenes)) if case is not None]


def _bytes(folder: Path) -> int:
    return size_of(folder.rglob("*"))


def size_of(files: Iterable[Path]) -> int:
    """Bytes of the files among them."""
    return sum(file.stat().st_size for file in files if file.is_file())
