"""How orders of the same methods on two sets of rows agree: a sentence and a table of many such.

The sets differ in one thing, in their maps, scenes or image size; a file for each says which runs
are set side by side and what of their rows is compared.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from experiments.report.order_of_methods import first_of, is_order, ranks_of
from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.sections.ranks import LEAST_FOR_ORDER
from experiments.report.sentences import counted
from experiments.run.loaded_run import Run
from metrics.registry import Metric, ranked_metrics

FORMATS = {
    "metric": "s", "methods": "d", "compared": "d", "least": ".2f", "median": ".2f",
    "same_first": "d", "moved": "s",
}  # fmt: skip
HEADINGS = {"least": "least Spearman", "same_first": "same first", "moved": "moves most"}


@dataclass(frozen=True)
class Agreement:
    """Mean ranks of the same methods on two sets of rows, by one metric.

    maps, other_maps : how many maps each is a mean over
    ranks, other_ranks : by method
    """

    maps: int
    other_maps: int
    ranks: pd.Series
    other_ranks: pd.Series

    @property
    def spearman(self) -> float:
        return float(self.ranks.corr(self.other_ranks, method="spearman"))

    @property
    def same_first(self) -> bool:
        """Whether some method has the best mean rank in both."""
        return not set(first_of(self.ranks)).isdisjoint(first_of(self.other_ranks))

    @property
    def moves(self) -> pd.Series:
        """By how much the mean rank of each method is another, without sign."""
        return (self.other_ranks - self.ranks).abs()


@dataclass(frozen=True)
class Question:
    """What is asked of pairs of runs, and the columns of its table that tell them apart.

    alike, between : words of the sentence: what is the same in both sets, and what they are
    pairs : of grids, those that can be compared
    sets : of two runs at a budget, the rows that are compared: none, or one pair or more
    columns : what a line says of its two runs
    """

    title: str
    table: str
    alike: str
    between: str
    formats: dict[str, str]
    headings: dict[str, str]
    pairs: Callable[[Sequence[Run]], Iterable[tuple[Run, Run]]]
    sets: Callable[[Run, Run, str], Iterable[tuple[pd.DataFrame, pd.DataFrame]]]
    columns: Callable[[Run, Run, Sequence[Agreement]], dict[str, object]]


@dataclass(frozen=True)
class Line:
    """Agreements of two runs that stand in one line of a table."""

    columns: dict[str, object]
    metric: Metric
    agreements: Sequence[Agreement]


def agreement(rows: pd.DataFrame, others: pd.DataFrame, metric: Metric) -> Agreement | None:
    """Of rows at one budget; None where they share too few methods or one is no order."""
    if metric.name not in rows or metric.name not in others:
        return None
    samplers = sorted(set(rows["sampler"]) & set(others["sampler"]))
    if len(samplers) < LEAST_FOR_ORDER:
        return None
    ranks, other_ranks = (ranks_of(part, metric, samplers) for part in (rows, others))
    if not (is_order(ranks) and is_order(other_ranks)):
        return None
    maps, other_maps = (part["environment"].nunique() for part in (rows, others))
    return Agreement(maps, other_maps, ranks, other_ranks)


def agreement_parts(question: Question, runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no two runs can be compared."""
    grids = [run for run in runs if "planned" in run.record]
    lines = [line for pair in question.pairs(grids) for line in _lines(question, *pair)]
    found = [one for line in lines for one in line.agreements]
    if not found:
        return
    yield Heading(question.title)
    spearman = pd.Series([one.spearman for one in found])
    same = sum(one.same_first for one in found)
    sentence = (
        f"Mean ranks of the same methods, {question.alike}, were compared "
        f"{counted(len(found), 'time')} between {question.between}: Spearman's correlation of the "
        f"two orders is {spearman.min():.2f} to {spearman.max():.2f}, median "
        f"{spearman.median():.2f}, and {counted(same, 'time')} the same method is first. "
        "The method that moves most, by mean rank, stands in the table with both ranks."
    )
    yield Items((sentence,))
    rows = pd.DataFrame([line.columns | _told(line) for line in lines])
    formats, headings = question.formats | FORMATS, question.headings | HEADINGS
    yield Table(question.table, rows, formats, headings)


def _lines(question: Question, one: Run, two: Run) -> Iterator[Line]:
    budgets = [budget for budget in one.budgets if budget in two.budgets]
    sets = [found for budget in budgets for found in question.sets(one, two, budget)]
    for metric in ranked_metrics():
        tried = [agreement(rows, others, metric) for rows, others in sets]
        if agreements := [found for found in tried if found is not None]:
            yield Line(question.columns(one, two, agreements), metric, agreements)


def _told(line: Line) -> dict[str, object]:
    spearman = pd.Series([one.spearman for one in line.agreements])
    return {
        "metric": line.metric.label,
        "methods": max(len(one.ranks) for one in line.agreements),
        "compared": len(line.agreements),
        "least": spearman.min(),
        "median": spearman.median(),
        "same_first": sum(one.same_first for one in line.agreements),
        "moved": _most_moved(line.agreements),
    }


def _most_moved(agreements: Sequence[Agreement]) -> str:
    """The method whose mean rank differs most, and both ranks."""
    one = max(agreements, key=lambda one: one.moves.max())
    name = str(one.moves.idxmax())
    return f"{name} ({one.ranks[name]:.1f}, {one.other_ranks[name]:.1f})"
