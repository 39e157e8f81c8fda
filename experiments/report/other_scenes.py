"""Whether an order of methods holds on other scenes, under the same maps.

A line is of one published run, whose scenes are compared two by two, or of two runs of one
experiment with images of one size that have no scene in common. Compared are mean ranks of the
methods that both scenes have, under the maps that both have, at each budget that both have.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import pandas as pd

from experiments.report.agreement import Agreement, Question, agreement_parts
from experiments.report.parts import Part
from experiments.report.summary import compared
from experiments.run.loaded_run import Run


def on_other_scenes(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two scenes can be compared."""
    yield from agreement_parts(QUESTION, runs)


def _pairs(grids: Sequence[Run]) -> Iterator[tuple[Run, Run]]:
    """Each run with itself, then those that have no scene in common."""
    yield from ((run, run) for run in grids)
    for one, two in combinations(grids, 2):
        apart = set(one.rows["scene"]).isdisjoint(two.rows["scene"])
        if apart and _alike(one, two):
            yield one, two


def _alike(one: Run, two: Run) -> bool:
    return (one.record["experiment"], one.image_size) == (two.record["experiment"], two.image_size)


def _sets(one: Run, two: Run, budget: str) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Of each two scenes of a run, or of each scene of one with each of another."""
    scenes, others = (sorted(set(run.rows["scene"])) for run in (one, two))
    here, there = one.at(budget), two.at(budget)
    for scene, other in combinations(scenes, 2) if one is two else product(scenes, others):
        mine, theirs = (
            compared(here[here["scene"] == scene]),
            compared(there[there["scene"] == other]),
        )
        maps = set(mine["environment"]) & set(theirs["environment"])
        yield mine[mine["environment"].isin(maps)], theirs[theirs["environment"].isin(maps)]


def _columns(one: Run, two: Run, agreements: Sequence[Agreement]) -> dict[str, object]:
    return {
        "run": ", ".join(dict.fromkeys(run.folder.name for run in (one, two))),
        "images": one.image_size,
        "scenes": ", ".join(sorted({*one.rows["scene"], *two.rows["scene"]})),
        "maps": max(found.maps for found in agreements),
    }


QUESTION = Question(
    "The same on other scenes",
    "on_other_scenes",
    "under the same maps and at the same budget",
    "two scenes",
    {"run": "s", "images": "s", "scenes": "s", "maps": "d"},
    {},
    _pairs,
    _sets,
    _columns,
)
