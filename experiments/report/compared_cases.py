"""Cases whose images can be compared without their run: pictures, and all that their pages say.

A folder holds previews and error maps, as reports have them (`previews`), and `cases.json`, from
which pages are made again. A run's own images are not part of it.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.maps.patterns import select
from experiments.report.case_pages import CasePage, Method, Value, contexts
from experiments.report.previews import Pictures
from experiments.report.run_data import RunData, load_run
from experiments.report.style import Look, looks
from experiments.report.summary import leagues_of
from experiments.run.record import write_text
from metrics.registry import find_metric
from samplers import EnvlightError

FOLDER, INDEX = "compared", "cases.json"
WIDTH = 640
"""Wider images are reduced to so many columns, and stored without loss."""
PREFERRED_BUDGET = "lights=16"
"""What is shown of a run at first, where it has it."""


def opening_budget(budgets: Sequence[str]) -> str:
    """The budget of which a run's images are compared, and with which its ranking opens."""
    return PREFERRED_BUDGET if PREFERRED_BUDGET in budgets else budgets[0]


def with_images(run: Path) -> RunData | None:
    """A run with the rows alone that can be shown: of one budget, and with images; None without.

    Raises EnvlightError where the folder holds no run.
    """
    data = load_run(run)
    rows = data.rows[data.rows["budget"] == opening_budget(data.budgets)]
    kept = [
        data.reference(key) is not None and data.image(key, scene, environment) is not None
        for key, scene, environment in rows[["key", "scene", "environment"]].to_numpy(str)
    ]
    return replace(data, rows=rows[kept]) if any(kept) else None


def compared_pages(
    data: RunData, looks: dict[str, Look], folder: Path, cases: Sequence[tuple[str, str]]
) -> list[CasePage]:
    """Write pictures of cases (scene and map); returns their pages, without links to the run's
    images. Pictures that are there are kept, those of other cases removed."""
    own = pd.MultiIndex.from_frame(data.rows[["scene", "environment"]])
    rows = data.rows[own.isin(pd.MultiIndex.from_tuples(cases))]
    pages = contexts(replace(data, rows=rows), looks, folder, WIDTH)
    return [_without_stored(page) for page in pages]


def _without_stored(page: CasePage) -> CasePage:
    budgets = {
        name: tuple(
            replace(method, pictures=method.pictures and replace(method.pictures, exr=""))
            for method in methods
        )
        for name, methods in page.budgets.items()
    }
    reference = page.reference and replace(page.reference, exr="")
    return replace(page, budgets=budgets, reference=reference)


def publish_compared(run: Path, target: Path, patterns: Sequence[str]) -> list[Path]:
    """Write pictures and pages of a run's cases into a published folder; returns the files.

    patterns : of maps' names, or of scene and map as in "vase_noon-desert"

    Raises EnvlightError where no images are kept, or a pattern matches no case.
    """
    data = with_images(run)
    if data is None:
        raise EnvlightError(f"{run}: no images are kept there; run it without --no-images")
    cases = sorted(set(data.rows[["scene", "environment"]].itertuples(index=False, name=None)))
    names = {case: {case[1], f"{case[0]}_{case[1]}"} for case in cases}
    asked = set(select(sorted(set().union(*names.values())), list(patterns), "case"))
    chosen = [case for case in cases if names[case] & asked]
    look = looks(sorted(data.rows["sampler"].unique()), leagues_of(data.rows))
    folder = target / FOLDER
    pages = compared_pages(data, look, folder, chosen)
    text = json.dumps([_plain(page) for page in pages], indent=1, ensure_ascii=False)
    write_text(folder / INDEX, text + "\n")
    return sorted(file for file in folder.rglob("*") if file.is_file())


def read_compared(folder: Path) -> list[CasePage]:
    """The pages of such a folder; EnvlightError where it is damaged."""
    try:
        found = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        return [_page(one) for one in found]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise EnvlightError(
            f"{folder / INDEX}: it cannot be read ({error}); publish the run again"
        ) from error


def _plain(page: CasePage) -> dict[str, Any]:
    """A page as JSON has it; metrics by their names."""
    names = [metric.name for metric in page.metrics]
    return asdict(replace(page, metrics=())) | {"metrics": names}


def _page(found: dict[str, Any]) -> CasePage:
    def pictures(one: dict[str, Any] | None) -> Pictures | None:
        return Pictures(**one) if one else None

    def method(one: dict[str, Any]) -> Method:
        values = {name: Value(**value) for name, value in one["values"].items()}
        return Method(**one | {"values": values, "pictures": pictures(one["pictures"])})

    return CasePage(
        **found
        | {
            "size": tuple(found["size"]),
            "metrics": tuple(map(find_metric, found["metrics"])),
            "reference": pictures(found["reference"]),
            "budgets": {
                name: tuple(map(method, methods)) for name, methods in found["budgets"].items()
            },
        }
    )
