"""Whether an order of methods holds on other scenes, under the same maps.

A line is of one published run, whose scenes are compared two by two, or of two runs of one
experiment with images of one size that have no scene in common. Compared are mean ranks of the
methods that both scenes have, under the maps that both have, at each budget that both have.
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
    "The same on other scenes",
    "on_other_scenes",
    "under the same maps and at the same budget",
    "two scenes",
    {"run": "s", "images": "s", "scenes": "s", "maps": "d"},
    {},
)


def on_other_scenes(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two scenes can be compared."""
    grids = [run for run in runs if "planned" in run.record]
    pairs = [*((run, run) for run in grids), *combinations(grids, 2)]
    lines = []
    for (one, two), metric in product(pairs, ranked_metrics()):
        if agreements := list(_agreements(one, two, metric)):
            columns = {
                "run": ", ".join(dict.fromkeys(run.folder.name for run in (one, two))),
                "images": one.image_size,
                "scenes": ", ".join(sorted({*one.rows["scene"], *two.rows["scene"]})),
                "maps": max(found.maps for found in agreements),
            }
            lines.append(Line(columns, metric, agreements))
    yield from agreement_parts(QUESTION, lines)


def _agreements(one: Run, two: Run, metric: Metric) -> Iterator[Agreement]:
    """Of each two scenes of a run, or of each scene of one with each of another."""
    scenes, others = (sorted(set(run.rows["scene"])) for run in (one, two))
    if one is two:
        pairs = list(combinations(scenes, 2))
    elif _alike(one, two) and not set(scenes) & set(others):
        pairs = list(product(scenes, others))
    else:
        return
    for budget in (budget for budget in one.budgets if budget in two.budgets):
        here, there = one.at(budget), two.at(budget)
        for scene, other in pairs:
            on_scene, on_other = here[here["scene"] == scene], there[there["scene"] == other]
            mine, theirs = _on_common_maps(compared(on_scene), compared(on_other))
            if (found := agreement(mine, theirs, metric)) is not None:
                yield found


def _on_common_maps(rows: pd.DataFrame, others: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    maps = set(rows["environment"]) & set(others["environment"])
    return rows[rows["environment"].isin(maps)], others[others["environment"].isin(maps)]


def _alike(one: Run, two: Run) -> bool:
    return (one.record["experiment"], one.image_size) == (two.record["experiment"], two.image_size)
