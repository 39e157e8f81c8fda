"""Whether an order of methods holds on other maps: runs that have no map in common, side by side.

A line is of two published runs, with images of one size. Compared are mean ranks of the methods
that both have, on the scenes that both have, at each budget that both have. Where these agree, the
order is not one of the maps that happened to be chosen.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import pandas as pd

from experiments.report.agreement import Agreement, Question, agreement_parts
from experiments.report.parts import Part
from experiments.report.summary import compared
from experiments.run.loaded_run import Run


def on_other_maps(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs can be compared."""
    yield from agreement_parts(QUESTION, runs)


def _pairs(grids: Sequence[Run]) -> Iterator[tuple[Run, Run]]:
    for one, two in combinations(grids, 2):
        apart = set(one.rows["environment"]).isdisjoint(two.rows["environment"])
        if apart and one.image_size == two.image_size:
            yield one, two


def _scenes(one: Run, two: Run) -> list[str]:
    return sorted(set(one.rows["scene"]) & set(two.rows["scene"]))


def _sets(one: Run, two: Run, budget: str) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    scenes = _scenes(one, two)
    mine, others = one.at(budget), two.at(budget)
    yield (
        compared(mine[mine["scene"].isin(scenes)]),
        compared(others[others["scene"].isin(scenes)]),
    )


def _columns(one: Run, two: Run, agreements: Sequence[Agreement]) -> dict[str, object]:
    return {
        "run": one.folder.name,
        "maps": max(found.maps for found in agreements),
        "other": two.folder.name,
        "other_maps": max(found.other_maps for found in agreements),
        "images": one.image_size,
        "scenes": ", ".join(_scenes(one, two)),
    }


QUESTION = Question(
    "The same on other maps",
    "on_other_maps",
    "on the same scenes and at the same budget",
    "two sets of maps with none in common",
    {"run": "s", "maps": "d", "other": "s", "other_maps": "d", "images": "s", "scenes": "s"},
    {"other": "other run", "other_maps": "its maps"},
    _pairs,
    _sets,
    _columns,
)
