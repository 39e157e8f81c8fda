"""Samplers two by two: who is better than whom, on how many maps, by how much, and how surely.

Of what is said about two samplers nothing depends on which others took part, but for the correction
of the p-values and for which maps all have finished. The full matrix is a picture; the table holds
the pairs against the first few.
"""

from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import Any

import pandas as pd

from experiments.report.parts import Heading, Part, Plot, Table, Text
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
    """A table and a matrix by each ranked metric and budget, and all pairs as CSV."""
    yield Heading("Pairs")
    yield Text(
        "On so many maps the sampler's error is smaller than, equal to and larger than that of the "
        "one it stands against; the ratio is the geometric mean over maps of its error to that "
        "one's, with the 95 % interval of a bootstrap over maps; p is that of Wilcoxon's "
        "signed-rank test of the logarithms of the ratio, by Holm's correction over all pairs."
    )
    for result in results_of(run):
        for found in result.rankings:
            if not found.maps or len(found.samplers) < 2:
                continue
            name, label = found.metric.name, found.metric.label
            rows = all_pairs(found).assign(budget=result.budget, metric=name)
            few = rows[rows["against"].isin(found.samplers[:FIRST_FEW])]
            yield Heading(f"{label}, {result.budget}", 3)
            caption = (
                f"{label} at {result.budget}, {found.maps} maps: each sampler against the first "
                f"{min(FIRST_FEW, len(found.samplers) - 1)} by mean rank."
            )
            yield Table("pairwise", few, FORMATS, HEADINGS, caption=caption)
            yield Table("pairwise_all", rows, FORMATS, HEADINGS, shown=False)
            yield Plot(
                f"pairs_{name}_{result.budget.replace('=', '')}",
                partial(pair_matrix, found),
                f"{label} at {result.budget}: the row's over the column's, geometric mean over "
                f"{found.maps} maps; bold where the pair's test tells them apart.",
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
