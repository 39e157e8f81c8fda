"""Whether an order of methods holds elsewhere: on other maps, scenes or in other image sizes.

Two selections of rows at one budget stand side by side, which differ in one of these. Mean ranks of
the methods that both have are compared. Where the two orders agree, an order is not one of the
maps, scenes or sizes that happened to be chosen.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import pandas as pd

from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sections.ranks import LEAST_FOR_ORDER
from experiments.report.summary import compared, errors_per_map, floors_per_map, resolved
from experiments.run.budget import Budget
from experiments.run.loaded_run import Run
from metrics.ranking import mean_ranks
from metrics.registry import Metric, ranked_metrics

FORMATS = {
    "between": "s", "metric": "s", "runs": "d", "compared": "d", "median": ".2f", "least": ".2f",
    "of": "s", "same_first": "d", "moved": "s",
}  # fmt: skip
HEADINGS = {
    "runs": "pairs of runs", "compared": "orders compared", "median": "median Spearman",
    "least": "least", "of": "of the runs", "same_first": "same first", "moved": "moves most",
}  # fmt: skip
Selections = Iterator[tuple[pd.DataFrame, pd.DataFrame]]


@dataclass(frozen=True)
class Agreement:
    """Mean ranks of the same methods in two selections of rows, by one metric.

    runs : what the rows are of; ranks, other_ranks : by method
    """

    runs: str
    ranks: pd.Series
    other_ranks: pd.Series

    @property
    def spearman(self) -> float:
        return float(self.ranks.corr(self.other_ranks, method="spearman"))

    @property
    def same_first(self) -> bool:
        """Whether some method has the best mean rank in both."""
        firsts = [set(one.index[one == one.min()]) for one in (self.ranks, self.other_ranks)]
        return not firsts[0].isdisjoint(firsts[1])

    @property
    def moves(self) -> pd.Series:
        """By how much the mean rank of each method is another, without sign."""
        return (self.other_ranks - self.ranks).abs()


def agreement(
    rows: pd.DataFrame, others: pd.DataFrame, metric: Metric, runs: str = ""
) -> Agreement | None:
    """Of two selections of rows; None where they share too few methods, or one has no order."""
    if metric.name not in rows or metric.name not in others:
        return None
    samplers = sorted(set(rows["sampler"]) & set(others["sampler"]))
    if len(samplers) < LEAST_FOR_ORDER:
        return None
    ranks = []
    for part in (rows, others):
        errors = resolved(errors_per_map(part, metric.name), floors_per_map(part, metric))
        ranks.append(pd.Series(mean_ranks(errors[samplers]), samplers))
    told = all(one.nunique() > 1 for one in ranks)
    return Agreement(runs, *ranks) if told else None


def elsewhere(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where nothing can be compared."""
    grids = [run for run in runs if "planned" in run.record]
    lines = [line for between in SELECTIONS for line in _lines(between, grids)]
    if lines:
        yield Heading("The same on other maps, scenes and image sizes")
        yield Text(
            "Mean ranks of the methods that two selections of measurements share, at the same "
            "budget, where the two differ in one thing: Spearman's correlation of the two orders, "
            "how often the same method is first, and the method that moves most, with its two mean "
            "ranks."
        )
        yield Table("elsewhere", pd.DataFrame(lines), FORMATS, HEADINGS)


def _lines(between: str, grids: Sequence[Run]) -> Iterator[dict[str, object]]:
    """A line per metric."""
    pairs = [(run, run) for run in grids] + list(combinations(grids, 2))
    selected = [
        (", ".join(dict.fromkeys(run.folder.name for run in (one, two))), selection)
        for one, two in pairs
        for budget in one.budgets
        if budget in two.budgets
        for selection in SELECTIONS[between](one, two, budget)
    ]
    for metric in ranked_metrics():
        tried = [agreement(*selection, metric, names) for names, selection in selected]
        if found := [one for one in tried if one is not None]:
            spearman = pd.Series([one.spearman for one in found])
            moved = max(found, key=lambda one: one.moves.max())
            name = str(moved.moves.idxmax())
            yield {
                "between": between,
                "metric": metric.label,
                "runs": len({one.runs for one in found}),
                "compared": len(found),
                "median": spearman.median(),
                "least": spearman.min(),
                "of": found[int(spearman.argmin())].runs,
                "same_first": sum(one.same_first for one in found),
                "moved": f"{name} ({moved.ranks[name]:.1f}, {moved.other_ranks[name]:.1f})",
            }


def _other_maps(one: Run, two: Run, budget: str) -> Selections:
    """Of two runs that share no map, what they have on the scenes that both have."""
    apart = set(one.rows["environment"]).isdisjoint(two.rows["environment"])
    if apart and one.image_size == two.image_size:
        yield _shared(one.at(budget), two.at(budget), "scene")


def _other_scenes(one: Run, two: Run, budget: str) -> Selections:
    """Of each two scenes of a run, or of two runs of one experiment that share no scene."""
    scenes, others = (sorted(set(run.rows["scene"])) for run in (one, two))
    alike = [(run.record["experiment"], run.image_size) for run in (one, two)]
    if one is not two and not (set(scenes).isdisjoint(others) and alike[0] == alike[1]):
        return
    here, there = one.at(budget), two.at(budget)
    for scene, other in combinations(scenes, 2) if one is two else product(scenes, others):
        yield _shared(here[here["scene"] == scene], there[there["scene"] == other], "environment")


def _other_sizes(one: Run, two: Run, budget: str) -> Selections:
    """Of two runs with images of two sizes, cases and methods that both have, the smaller first.

    A budget of seconds is left out: it allows fewer lights in a larger image.
    """
    if one.image_size == two.image_size or Budget.parse(budget).timed:
        return
    small, large = sorted((one, two), key=_pixels)
    rows, others = small.at(budget), large.at(budget)
    for name in ("sampler", "scene", "environment"):
        common = set(rows[name]) & set(others[name])
        rows, others = rows[rows[name].isin(common)], others[others[name].isin(common)]
    mine, theirs = compared(rows), compared(others)
    case = ["scene", "environment"]
    cases = mine[case].merge(theirs[case]).drop_duplicates()
    yield mine.merge(cases), theirs.merge(cases)


def _pixels(run: Run) -> int:
    return int(run.record["scale"]["width"]) * int(run.record["scale"]["height"])


def _shared(
    rows: pd.DataFrame, others: pd.DataFrame, name: str
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What can be compared of both, on the scenes or the maps that both have."""
    common = set(rows[name]) & set(others[name])
    mine, theirs = (compared(part[part[name].isin(common)]) for part in (rows, others))
    common = set(mine[name]) & set(theirs[name])
    return mine[mine[name].isin(common)], theirs[theirs[name].isin(common)]


SELECTIONS: dict[str, Callable[[Run, Run, str], Selections]] = {
    "maps": _other_maps,
    "scenes": _other_scenes,
    "image sizes": _other_sizes,
}
"""By what the two differ in, the selections of two runs at a budget; a run may be both."""
