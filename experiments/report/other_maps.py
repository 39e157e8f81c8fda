"""Whether an order of methods holds on other maps: runs alike in all but their maps, side by side.

A line compares two published runs of one experiment, with images of one size, that have no map in
common: mean ranks of the methods that both have, on the scenes and at a budget that both have.
Where these agree, the order is not one of the maps that happened to be chosen.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import pandas as pd

from experiments.report.order_of_methods import first_of, is_order, ranks_of
from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.sections.ranks import LEAST_FOR_ORDER
from experiments.report.sentences import counted
from experiments.report.summary import compared
from experiments.run.loaded_run import Run
from metrics.registry import ranked_metrics

FORMATS = {
    "run": "s", "maps": "d", "other": "s", "other_maps": "d", "images": "s", "scenes": "s",
    "budget": "s", "metric": "s", "methods": "d", "spearman": ".2f", "first": "s",
    "other_first": "s",
}  # fmt: skip
HEADINGS = {
    "other": "other run", "other_maps": "its maps", "spearman": "Spearman", "other_first": "there",
}  # fmt: skip


def on_other_maps(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs differ in their maps."""
    grids = [run for run in runs if "planned" in run.record]
    rows = pd.DataFrame([line for pair in combinations(grids, 2) for line in _of_pair(*pair)])
    if rows.empty:
        return
    same = int(rows["same_first"].sum())
    yield Heading("The same on other maps")
    sentence = (
        "Mean ranks of the same methods, on the same scenes and at the same budget, were measured "
        f"{counted(len(rows), 'time')} on two sets of maps with none in common: Spearman's "
        f"correlation of the two orders is {rows['spearman'].min():.2f} to "
        f"{rows['spearman'].max():.2f}, median {rows['spearman'].median():.2f}, and "
        f"{counted(same, 'time')} the same method is first. Runs of different commits are "
        "compared, too."
    )
    yield Items((sentence,))
    yield Table("on_other_maps", rows, FORMATS, HEADINGS)


def _of_pair(one: Run, two: Run) -> Iterator[dict[str, object]]:
    """A line for each budget and metric that two runs share, if they differ in their maps."""
    alike = [(run.record["experiment"], run.image_size) for run in (one, two)]
    if alike[0] != alike[1]:
        return
    if set(one.rows["environment"]) & set(two.rows["environment"]):
        return
    scenes = sorted(set(one.rows["scene"]) & set(two.rows["scene"]))
    for budget in (budget for budget in one.budgets if budget in two.budgets):
        mine, others = (_of_scenes(run.at(budget), scenes) for run in (one, two))
        samplers = sorted(set(mine["sampler"]) & set(others["sampler"]))
        if len(samplers) < LEAST_FOR_ORDER:
            continue
        for metric in ranked_metrics():
            if metric.name not in mine or metric.name not in others:
                continue
            here, there = (ranks_of(rows, metric, samplers) for rows in (mine, others))
            if not (is_order(here) and is_order(there)):
                continue
            yield {
                "run": one.folder.name, "maps": mine["environment"].nunique(),
                "other": two.folder.name, "other_maps": others["environment"].nunique(),
                "images": one.image_size, "scenes": ", ".join(scenes), "budget": budget,
                "metric": metric.label, "methods": len(samplers),
                "spearman": here.corr(there, method="spearman"),
                "first": ", ".join(first_of(here)), "other_first": ", ".join(first_of(there)),
                "same_first": bool({*first_of(here)} & {*first_of(there)}),
            }  # fmt: skip


def _of_scenes(rows: pd.DataFrame, scenes: Sequence[str]) -> pd.DataFrame:
    return compared(rows[rows["scene"].isin(scenes)])
