"""Samplers two by two: who is better than whom, on how many maps, by how much, and how surely.

Of what is said about two samplers nothing depends on which others took part, but for the correction
of the p-values and for which maps all have finished. The matrix is a heat map; tables are
CSV alone.
"""

from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import Any

import pandas as pd

from experiments.report.parts import Heading, Part, Plot, Table
from experiments.report.ranking_plots import pair_matrix
from experiments.report.rankings import Ranking, results_of
from experiments.report.summary import interval
from experiments.run.loaded_run import Run

FIRST_FEW = 3
FORMATS = {
    "sampler": "s", "against": "s", "smaller": "d", "equal": "d", "larger": "d", "interval": "s",
    "p": ".2g",
}  # fmt: skip
HEADINGS = {"interval": "ratio to that of `against`", "p": "p (Holm)"}


def pairwise(run: Run) -> Iterator[Part]:
    """A matrix by each ranked metric and budget; the pairs against the first few and all as CSV."""
    yield Heading("Pairs")
    for result in results_of(run):
        for found in result.rankings:
            if not found.maps or len(found.samplers) < 2:
                continue
            name, label = found.metric.name, found.metric.label
            rows = all_pairs(found).assign(budget=result.budget, metric=name)
            few = rows[rows["against"].isin(found.samplers[:FIRST_FEW])]
            yield Table("pairwise", few, FORMATS, HEADINGS, shown=False)
            yield Table("pairwise_all", rows, FORMATS, HEADINGS, shown=False)
            yield Plot(
                f"pairs_{name}_{result.budget.replace('=', '')}",
                partial(pair_matrix, found),
                f"{label} at {result.budget}: the row's over the column's, geometric mean over "
                f"{found.maps} maps, and wins · ties · losses of the row; bold where the "
                "difference is significant.",
            )


def all_pairs(found: Ranking) -> pd.DataFrame:
    """Every pair once, the one that stands later in the ranking against the one before it."""
    names = found.samplers
    return pd.DataFrame(
        [pair_line(found, worse, better) for better, worse in combinations(range(len(names)), 2)]
    )


def pair_line(found: Ranking, one: int, other: int) -> dict[str, Any]:
    """How a sampler compares with another, both by their places in the ranking."""
    pairs = found.pairs
    ratio, low, high = (
        float(values[one, other]) for values in (pairs.ratio, pairs.low, pairs.high)
    )
    return {
        "sampler": found.samplers[one], "against": found.samplers[other],
        "smaller": pairs.wins[one, other], "equal": pairs.ties[one, other],
        "larger": pairs.losses[one, other], "ratio": ratio, "low": low, "high": high,
        "interval": interval(ratio, low, high), "p": pairs.p_value[one, other],
    }  # fmt: skip
