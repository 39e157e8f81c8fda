"""In which order methods come out on some rows: what runs are compared by."""

from collections.abc import Sequence

import pandas as pd

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
