"""Pages that compare images, of runs whose images are at hand: as many as fit.

Published runs have no images, so the runs themselves have to be there. Of each the budget that its
ranking opens with is shown: the first scene under every map, then the second, and so on, until the
room is used.
"""

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest
from pathlib import Path

import pandas as pd

from experiments.report.case_pages import CasePage, contexts
from experiments.report.palette import Look
from experiments.report.run_data import RunData, load_run
from experiments.report.site.publications import Publication
from experiments.report.site.ranking_data import opening_budget
from experiments.run.store import DATABASE

WIDTH = 640
"""Wider images are reduced to so many columns, which still are stored without loss."""


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
    """Write pictures of runs that a folder holds under their published names; returns the pages.

    runs : the folder of runs, None for none; room : bytes that pictures may take
    """
    able = [one for one in ranked if runs is not None and (runs / one.name / DATABASE).is_file()]
    found: list[CaseSet] = []
    for place, one in enumerate(able):
        assert runs is not None
        data = _with_images(load_run(runs / one.name))
        if data is None:
            continue
        folder = site / "runs" / one.name
        share = (room - sum(_bytes(site / each.folder) for each in found)) // (len(able) - place)
        pages, skipped = _fitting(data, looks, folder, share)
        if pages:
            found.append(CaseSet(one.name, f"runs/{one.name}", pages, skipped))
    return found


def _with_images(data: RunData) -> RunData | None:
    """The run with the rows alone that are shown: one budget, and cases whose images are kept."""
    rows = data.rows[data.rows["budget"] == opening_budget(data.budgets)]
    kept = [
        data.reference(key) is not None and data.image(key, scene, environment) is not None
        for key, scene, environment in rows[["key", "scene", "environment"]].to_numpy(str)
    ]
    return replace(data, rows=rows[kept]) if any(kept) else None


def _fitting(
    data: RunData, looks: dict[str, Look], folder: Path, room: int
) -> tuple[list[CasePage], int]:
    """The pages of as many cases as fit into the room, and how many do not."""
    order = _in_order(data.rows)
    own = pd.MultiIndex.from_frame(data.rows[["scene", "environment"]])

    def made(count: int) -> list[CasePage]:
        chosen = own.isin(pd.MultiIndex.from_tuples(order[:count]))
        pages = contexts(replace(data, rows=data.rows[chosen]), looks, folder, WIDTH)
        return [_without_stored(page) for page in pages]

    count, pages = 1, made(1)
    if _bytes(folder) > room:
        shutil.rmtree(folder)
        return [], len(order)
    # The first case tells how many will fit; where they are too many after all, there are fewer.
    most = min(len(order), room // _bytes(folder))
    while most > 1:
        count, pages = most, made(most)
        if _bytes(folder) <= room:
            break
        most -= 1 + most // 10
    else:
        count, pages = 1, made(1)
    return pages, len(order) - count


def _in_order(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Cases: the first scene under every map, then the second, and so on."""
    scenes = [
        [(str(scene), str(name)) for scene in sorted(part["scene"].unique())]
        for name, part in rows.groupby("environment", sort=True)
    ]
    return [case for case in chain.from_iterable(zip_longest(*scenes)) if case is not None]


def _without_stored(page: CasePage) -> CasePage:
    """A page that does not link to stored images, which stay with the run."""
    budgets = {
        name: tuple(
            replace(method, pictures=method.pictures and replace(method.pictures, exr=""))
            for method in methods
        )
        for name, methods in page.budgets.items()
    }
    return replace(
        page, budgets=budgets, reference=page.reference and replace(page.reference, exr="")
    )


def _bytes(folder: Path) -> int:
    return size_of(folder.rglob("*"))


def size_of(files: Iterable[Path]) -> int:
    """Bytes of the files among them."""
    return sum(file.stat().st_size for file in files if file.is_file())
