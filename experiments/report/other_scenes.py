"""Whether an order of methods holds on other scenes, under the same maps.

A line is of one published run, whose scenes are compared two by two, or of two runs of one
experiment with images of one size that have no scene in common. Compared are mean ranks of the
methods that both scenes have, under the maps that both have, at each budget that both have.
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

FORMATS = {"run": "s", "images": "s", "scenes": "s", "maps": "d", **AGREEMENT_FORMATS}


def on_other_scenes(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two scenes can be compared."""
    grids = [run for run in runs if "planned" in run.record]
    pairs = [*((run, run) for run in grids), *combinations(grids, 2)]
    lines: list[dict[str, object]] = []
    found: list[Agreement] = []
    for (one, two), metric in product(pairs, ranked_metrics()):
        if agreements := list(_agreements(one, two, metric)):
            lines.append(_line(one, two, metric, agreements))
            found += agreements
    if not found:
        return
    yield Heading("The same on other scenes")
    sentence = (
        "Mean ranks of the same methods, under the same maps and at the same budget, were compared "
        f"{counted(len(found), 'time')} between two scenes: {told(found)}."
    )
    yield Items((sentence,))
    yield Table("on_other_scenes", pd.DataFrame(lines), FORMATS, AGREEMENT_HEADINGS)


def _line(one: Run, two: Run, metric: Metric, agreements: Sequence[Agreement]) -> dict[str, object]:
    return {
        "run": ", ".join(dict.fromkeys(run.folder.name for run in (one, two))),
        "images": one.image_size,
        "scenes": ", ".join(sorted({*one.rows["scene"], *two.rows["scene"]})),
        "maps": max(found.maps for found in agreements),
        **agreement_columns(agreements, metric),
    }


def _agreements(one: Run, two: Run, metric: Metric) -> Iterator[Agreement]:
    """Of each two scenes of a run, or of each scene of one with each of another."""
    scenes, others = (sorted(set(run.rows["scene"])) for run in (one, two))
    if one is two:
        pairs = list(combinations(scenes, 2))
    elif _alike(one, two) and not set(scenes) & set(others):
        pairs = list(product(scenes, others))
    else:
        return
    if metric.name not in one.rows or metric.name not in two.rows:
        return
    for budget in (budget for budget in one.budgets if budget in two.budgets):
        here, there = one.at(budget), two.at(budget)
        for scene, other in pairs:
            mine, others = _on_both_maps(
                here[here["scene"] == scene], there[there["scene"] == other]
            )
            if (found := agreement(mine, others, metric, budget)) is not None:
                yield found


def _on_both_maps(rows: pd.DataFrame, others: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    mine, theirs = compared(rows), compared(others)
    maps = set(mine["environment"]) & set(theirs["environment"])
    return mine[mine["environment"].isin(maps)], theirs[theirs["environment"].isin(maps)]


def _alike(one: Run, two: Run) -> bool:
    return (one.record["experiment"], one.image_size) == (two.record["experiment"], two.image_size)
