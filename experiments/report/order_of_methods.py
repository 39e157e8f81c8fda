"""In which order methods come out on some rows, and how two such orders agree."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from experiments.report.sections.ranks import LEAST_FOR_ORDER
from experiments.report.sentences import counted
from experiments.report.summary import errors_per_map, floors_per_map, resolved
from metrics.ranking import mean_ranks
from metrics.registry import Metric


def ranks_of(rows: pd.DataFrame, metric: Metric, samplers: Sequence[str]) -> pd.Series:
    """Mean ranks of samplers among each other, ranked as in tables."""
    errors = resolved(errors_per_map(rows, metric.name), floors_per_map(rows, metric))
    return pd.Series(mean_ranks(errors[list(samplers)]), list(samplers))


def first_of(ranks: pd.Series) -> list[str]:
    """The methods of the best mean rank, of which there can be several."""
    return ranks.index[ranks == ranks.min()].tolist()


def is_order(ranks: pd.Series) -> bool:
    """Whether not all methods share one place."""
    return ranks.nunique() > 1


@dataclass(frozen=True)
class Agreement:
    """How the orders of the same methods on two sets of rows agree, at one budget.

    maps, other_maps : how many maps each order is a mean over
    first, other_first : the methods of the best mean rank
    """

    budget: str
    maps: int
    other_maps: int
    methods: int
    spearman: float
    first: tuple[str, ...]
    other_first: tuple[str, ...]

    @property
    def same_first(self) -> bool:
        return not {*self.first}.isdisjoint(self.other_first)


def agreement(
    rows: pd.DataFrame, others: pd.DataFrame, metric: Metric, budget: str
) -> Agreement | None:
    """Of two sets of rows at a budget; None where one has too few methods or no order."""
    samplers = sorted(set(rows["sampler"]) & set(others["sampler"]))
    if len(samplers) < LEAST_FOR_ORDER:
        return None
    here, there = (ranks_of(part, metric, samplers) for part in (rows, others))
    if not (is_order(here) and is_order(there)):
        return None
    return Agreement(
        budget,
        rows["environment"].nunique(),
        others["environment"].nunique(),
        len(samplers),
        float(here.corr(there, method="spearman")),
        tuple(first_of(here)),
        tuple(first_of(there)),
    )


AGREEMENT_FORMATS = {
    "budgets": "d", "metric": "s", "methods": "d", "comparisons": "d", "least": ".2f",
    "median": ".2f", "same_first": "d",
}  # fmt: skip
AGREEMENT_HEADINGS = {"least": "least Spearman", "same_first": "the same is first"}


def agreement_columns(agreements: Sequence[Agreement], metric: Metric) -> dict[str, object]:
    """What a line of a table tells of its agreements, which are at least one."""
    spearman = pd.Series([one.spearman for one in agreements])
    return {
        "budgets": len({one.budget for one in agreements}),
        "metric": metric.label,
        "methods": max(one.methods for one in agreements),
        "comparisons": len(agreements),
        "least": spearman.min(),
        "median": spearman.median(),
        "same_first": sum(one.same_first for one in agreements),
    }


def told(agreements: Sequence[Agreement]) -> str:
    """The clause that sums up at least one agreement."""
    spearman = pd.Series([one.spearman for one in agreements])
    same = sum(one.same_first for one in agreements)
    return (
        f"Spearman's correlation of the two orders is {spearman.min():.2f} to "
        f"{spearman.max():.2f}, median {spearman.median():.2f}, and {counted(same, 'time')} the "
        "same method is first"
    )
