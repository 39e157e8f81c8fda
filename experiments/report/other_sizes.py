"""Whether an order of methods holds in images of another size: where a small image says enough.

A line is of two published runs with images of different sizes. Compared are mean ranks of the
methods that both have, in the cases of a scene and a map that both have, at each budget of lights
or rays that both have. A budget of seconds is left out: it allows fewer lights in a larger image.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import pandas as pd

from experiments.report.agreement import Agreement, Question, agreement_parts
from experiments.report.parts import Part
from experiments.report.summary import compared
from experiments.run.budget import Budget
from experiments.run.loaded_run import Run


def in_other_sizes(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs can be compared."""
    yield from agreement_parts(QUESTION, runs)


def _pairs(grids: Sequence[Run]) -> Iterator[tuple[Run, Run]]:
    """The run of the smaller images first."""
    for one, two in combinations(sorted(grids, key=_pixels), 2):
        if one.image_size != two.image_size:
            yield one, two


def _pixels(run: Run) -> int:
    return int(run.record["scale"]["width"]) * int(run.record["scale"]["height"])


def _sets(one: Run, two: Run, budget: str) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    if not Budget.parse(budget).timed:
        yield _of_both(one.at(budget), two.at(budget))


def _of_both(rows: pd.DataFrame, others: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What both have of the methods, and of the cases of all these methods, that both have."""
    for name in ("sampler", "scene", "environment"):
        common = set(rows[name]) & set(others[name])
        rows, others = rows[rows[name].isin(common)], others[others[name].isin(common)]
    mine, theirs = compared(rows), compared(others)
    case = ["scene", "environment"]
    cases = mine[case].merge(theirs[case]).drop_duplicates()
    return mine.merge(cases), theirs.merge(cases)


def _columns(one: Run, two: Run, agreements: Sequence[Agreement]) -> dict[str, object]:
    return {
        "run": one.folder.name,
        "images": one.image_size,
        "other": two.folder.name,
        "its_images": two.image_size,
        "scenes": ", ".join(sorted(set(one.rows["scene"]) & set(two.rows["scene"]))),
        "maps": max(found.maps for found in agreements),
    }


QUESTION = Question(
    "The same in images of another size",
    "in_other_sizes",
    "on the same scenes, under the same maps and with as many lights or rays",
    "images of two sizes",
    {"run": "s", "images": "s", "other": "s", "its_images": "s", "scenes": "s", "maps": "d"},
    {"other": "other run", "its_images": "its images"},
    _pairs,
    _sets,
    _columns,
)
