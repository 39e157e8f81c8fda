"""Whether an order of methods holds in images of another size: where a small image says enough.

A line is of two published runs with images of different sizes. Compared are mean ranks of the
methods that both have, in the cases of a scene and a map that both have, at each budget of lights
or rays that both have. A budget of seconds is left out: it allows fewer lights in a larger image.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import pandas as pd

from experiments.report.agreement import Agreement, Line, Question, agreement, agreement_parts
from experiments.report.parts import Part
from experiments.report.summary import compared
from experiments.run.budget import Budget
from experiments.run.loaded_run import Run
from metrics.registry import Metric, ranked_metrics

QUESTION = Question(
    "The same in images of another size",
    "in_other_sizes",
    "on the same scenes, under the same maps and with as many lights or rays",
    "images of two sizes",
    {"run": "s", "images": "s", "other": "s", "its_images": "s", "scenes": "s", "maps": "d"},
    {"other": "other run", "its_images": "its images"},
)


def in_other_sizes(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs can be compared."""
    grids = sorted((run for run in runs if "planned" in run.record), key=_pixels)
    lines = []
    for (one, two), metric in product(combinations(grids, 2), ranked_metrics()):
        if agreements := list(_agreements(one, two, metric)):
            columns = {
                "run": one.folder.name,
                "images": one.image_size,
                "other": two.folder.name,
                "its_images": two.image_size,
                "scenes": ", ".join(sorted(set(one.rows["scene"]) & set(two.rows["scene"]))),
                "maps": max(found.maps for found in agreements),
            }
            lines.append(Line(columns, metric, agreements))
    yield from agreement_parts(QUESTION, lines)


def _pixels(run: Run) -> int:
    return int(run.record["scale"]["width"]) * int(run.record["scale"]["height"])


def _agreements(one: Run, two: Run, metric: Metric) -> Iterator[Agreement]:
    if one.image_size == two.image_size:
        return
    for budget in (budget for budget in one.budgets if budget in two.budgets):
        if Budget.parse(budget).timed:
            continue
        mine, others = _of_both(one.at(budget), two.at(budget))
        if (found := agreement(mine, others, metric)) is not None:
            yield found


def _of_both(rows: pd.DataFrame, others: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What both have of the methods, and of the cases of all these methods, that both have."""
    for name in ("sampler", "scene", "environment"):
        common = set(rows[name]) & set(others[name])
        rows, others = rows[rows[name].isin(common)], others[others[name].isin(common)]
    mine, theirs = compared(rows), compared(others)
    case = ["scene", "environment"]
    cases = mine[case].merge(theirs[case]).drop_duplicates()
    return mine.merge(cases), theirs.merge(cases)
