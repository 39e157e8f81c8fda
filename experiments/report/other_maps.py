"""Whether an order of methods holds on other maps: runs that have no map in common, side by side.

A line is of two published runs, with images of one size. Compared are mean ranks of the methods
that both have, on the scenes that both have, at each budget that both have. Where these agree, the
order is not one of the maps that happened to be chosen.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import pandas as pd

from experiments.report.order_of_methods import (
    AGREEMENT_FORMATS,
    AGREEMENT_HEADINGS,
    Agreement,
    agreement,
    agreement_columns,
    told,
)
from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.sentences import counted
from experiments.report.summary import compared
from experiments.run.loaded_run import Run
from metrics.registry import Metric, ranked_metrics

FORMATS = {
    "run": "s", "maps": "d", "other": "s", "other_maps": "d", "images": "s", "scenes": "s",
    **AGREEMENT_FORMATS,
}  # fmt: skip
HEADINGS = {"other": "other run", "other_maps": "its maps", **AGREEMENT_HEADINGS}


def on_other_maps(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs can be compared."""
    grids = [run for run in runs if "planned" in run.record]
    lines: list[dict[str, object]] = []
    found: list[Agreement] = []
    for (one, two), metric in product(combinations(grids, 2), ranked_metrics()):
        scenes = sorted(set(one.rows["scene"]) & set(two.rows["scene"]))
        if agreements := list(_agreements(one, two, scenes, metric)):
            lines.append({
                "run": one.folder.name,
                "maps": max(one.maps for one in agreements),
                "other": two.folder.name,
                "other_maps": max(one.other_maps for one in agreements),
                "images": one.image_size,
                "scenes": ", ".join(scenes),
                **agreement_columns(agreements, metric),
            })  # fmt: skip
            found += agreements
    if not found:
        return
    yield Heading("The same on other maps")
    sentence = (
        "Mean ranks of the same methods, on the same scenes and at the same budget, were compared "
        f"{counted(len(found), 'time')} between two sets of maps with none in common: "
        f"{told(found)}. Runs of different commits are compared, too."
    )
    yield Items((sentence,))
    yield Table("on_other_maps", pd.DataFrame(lines), FORMATS, HEADINGS)


def _agreements(one: Run, two: Run, scenes: Sequence[str], metric: Metric) -> Iterator[Agreement]:
    if one.image_size != two.image_size or not scenes:
        return
    if set(one.rows["environment"]) & set(two.rows["environment"]):
        return
    if metric.name not in one.rows or metric.name not in two.rows:
        return
    for budget in (budget for budget in one.budgets if budget in two.budgets):
        mine, others = (_of_scenes(run.at(budget), scenes) for run in (one, two))
        if (found := agreement(mine, others, metric, budget)) is not None:
            yield found


def _of_scenes(rows: pd.DataFrame, scenes: Sequence[str]) -> pd.DataFrame:
    return compared(rows[rows["scene"].isin(scenes)])
