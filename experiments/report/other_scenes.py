"""Whether an order of methods holds on other scenes, under the same maps.

A line is of one published run, whose scenes are compared two by two, or of two runs of one
experiment with images of one size that have no scene in common. Compared are mean ranks of the
methods that both scenes have, under the maps that both have, at each budget that both have.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import pandas as pd

from experiments.report.order_of_methods import first_of, is_order, ranks_of
from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.sections.ranks import LEAST_FOR_ORDER
from experiments.report.sentences import counted
from experiments.report.summary import compared
from experiments.run.loaded_run import Run
from metrics.registry import Metric, ranked_metrics

FORMATS = {
    "run": "s", "images": "s", "scenes": "s", "maps": "d", "budgets": "d", "metric": "s",
    "methods": "d", "comparisons": "d", "least": ".2f", "median": ".2f", "same_first": "d",
}  # fmt: skip
HEADINGS = {"least": "least Spearman", "same_first": "the same is first"}


@dataclass(frozen=True)
class Agreement:
    """How the orders on two scenes agree, by one metric.

    same_first : whether some method has the best mean rank on both
    """

    budget: str
    maps: int
    methods: int
    spearman: float
    same_first: bool


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
    spearman = pd.Series([one.spearman for one in found])
    same = sum(one.same_first for one in found)
    yield Heading("The same on other scenes")
    sentence = (
        "Mean ranks of the same methods, under the same maps and at the same budget, were compared "
        f"{counted(len(found), 'time')} between two scenes: Spearman's correlation of the two "
        f"orders is {spearman.min():.2f} to {spearman.max():.2f}, median {spearman.median():.2f}, "
        f"and {counted(same, 'time')} the same method is first."
    )
    yield Items((sentence,))
    yield Table("on_other_scenes", pd.DataFrame(lines), FORMATS, HEADINGS)


def _line(one: Run, two: Run, metric: Metric, agreements: Sequence[Agreement]) -> dict[str, object]:
    spearman = pd.Series([agreement.spearman for agreement in agreements])
    return {
        "run": ", ".join(dict.fromkeys(run.folder.name for run in (one, two))),
        "images": one.image_size,
        "scenes": ", ".join(sorted({*one.rows["scene"], *two.rows["scene"]})),
        "maps": max(agreement.maps for agreement in agreements),
        "budgets": len({agreement.budget for agreement in agreements}),
        "metric": metric.label,
        "methods": max(agreement.methods for agreement in agreements),
        "comparisons": len(agreements),
        "least": spearman.min(),
        "median": spearman.median(),
        "same_first": sum(agreement.same_first for agreement in agreements),
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
            mine, theirs = here[here["scene"] == scene], there[there["scene"] == other]
            agreement = _agreement(compared(mine), compared(theirs), budget, metric)
            if agreement is not None:
                yield agreement


def _alike(one: Run, two: Run) -> bool:
    return (one.record["experiment"], one.image_size) == (two.record["experiment"], two.image_size)


def _agreement(
    mine: pd.DataFrame, others: pd.DataFrame, budget: str, metric: Metric
) -> Agreement | None:
    """None where too few methods, or no maps, or no order is there."""
    maps = set(mine["environment"]) & set(others["environment"])
    samplers = sorted(set(mine["sampler"]) & set(others["sampler"]))
    if not maps or len(samplers) < LEAST_FOR_ORDER:
        return None
    here, there = (
        ranks_of(rows[rows["environment"].isin(maps)], metric, samplers) for rows in (mine, others)
    )
    if not (is_order(here) and is_order(there)):
        return None
    return Agreement(
        budget,
        len(maps),
        len(samplers),
        float(here.corr(there, method="spearman")),
        bool({*first_of(here)} & {*first_of(there)}),
    )
