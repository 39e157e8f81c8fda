"""Whether an order of methods holds on other maps: runs that have no map in common, side by side.

A line is of two published runs, with images of one size. Compared are mean ranks of the methods
that both have, on the scenes that both have, at each budget that both have. Where these agree, the
order is not one of the maps that happened to be chosen.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import pandas as pd

from experiments.report.agreement import Agreement, Line, Question, agreement, agreement_parts
from experiments.report.parts import Part
from experiments.report.summary import compared
from experiments.run.loaded_run import Run
from metrics.registry import Metric, ranked_metrics

QUESTION = Question(
    "The same on other maps",
    "on_other_maps",
    "on the same scenes and at the same budget",
    "two sets of maps with none in common",
    {"run": "s", "maps": "d", "other": "s", "other_maps": "d", "images": "s", "scenes": "s"},
    {"other": "other run", "other_maps": "its maps"},
)


def on_other_maps(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs can be compared."""
    grids = [run for run in runs if "planned" in run.record]
    lines = []
    for (one, two), metric in product(combinations(grids, 2), ranked_metrics()):
        scenes = sorted(set(one.rows["scene"]) & set(two.rows["scene"]))
        if agreements := list(_agreements(one, two, scenes, metric)):
            columns = {
                "run": one.folder.name,
                "maps": max(found.maps for found in agreements),
                "other": two.folder.name,
                "other_maps": max(found.other_maps for found in agreements),
                "images": one.image_size,
                "scenes": ", ".join(scenes),
            }
            lines.append(Line(columns, metric, agreements))
    yield from agreement_parts(QUESTION, lines)


def _agreements(one: Run, two: Run, scenes: Sequence[str], metric: Metric) -> Iterator[Agreement]:
    if one.image_size != two.image_size:
        return
    if set(one.rows["environment"]) & set(two.rows["environment"]):
        return
    for budget in (budget for budget in one.budgets if budget in two.budgets):
        mine, others = (_of_scenes(run.at(budget), scenes) for run in (one, two))
        if (found := agreement(mine, others, metric)) is not None:
            yield found


def _of_scenes(rows: pd.DataFrame, scenes: Sequence[str]) -> pd.DataFrame:
    return compared(rows[rows["scene"].isin(scenes)])
