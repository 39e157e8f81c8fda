"""Ranks map by map: a line a sampler, how ranks are distributed, and which differ surely.

A case of the statistics is a map, its error the mean over scenes: scenes under one map are not
independent. The critical-difference diagram is that of Demšar 2006 (see `metrics.ranking`).
"""

import math
from collections.abc import Iterator
from functools import partial

import pandas as pd

from experiments.report.figures import difference_diagram
from experiments.report.leagues import leagues_of
from experiments.report.palette import looks
from experiments.report.parts import Heading, Items, Part, Plot, Table
from experiments.report.rank_distribution import rank_distribution
from experiments.report.rank_map import rank_map
from experiments.report.rankings import Ranking, results_of
from experiments.report.sentences import doubt, remarks, verdict
from experiments.run.experiment import Published, Section
from experiments.run.loaded_run import Run

FORMATS = {
    "sampler": "s", "mean_rank": ".2f", "paper_rank": ".2f", "first": "d", "worst_rank": ".0f",
}  # fmt: skip
LONG = {"environment": "s", "sampler": "s", "error": ".4f", "rank": ".0f"}


def rank_plots(order_by: str, published: Published | None = None) -> Section:
    """The section.

    order_by : the sampler by whose error maps stand in order; the winner where it was not run
    published : whose mean ranks stand beside ours
    """

    def section(run: Run) -> Iterator[Part]:
        styles = looks(run.samplers, leagues_of(run.rows))
        for result in results_of(run):
            for ranking in result.rankings:
                metric, maps = ranking.metric, len(ranking.per_map)
                yield Heading(f"{metric.label}, {result.budget}", 3)
                words = [verdict(ranking), doubt(ranking), *remarks(ranking)]
                yield Items(tuple(filter(None, words)))
                if not maps:
                    continue
                stem = f"{metric.name}_{result.budget.replace('=', '')}"
                yield Table("rank_counts", rank_counts(result.budget, ranking, published), FORMATS)
                yield Table("ranks", ranks_per_map(result.budget, ranking), LONG, shown=False)
                name = order_by if order_by in ranking.samplers else ranking.winner
                order = ranking.per_map[name].to_numpy().argsort(kind="stable")
                yield Plot(
                    f"rank_{stem}", partial(rank_map, ranking, styles, order),
                    f"Rank on each map; maps by the error of {name}, least first.",
                )  # fmt: skip
                yield Plot(
                    f"distribution_{stem}", partial(rank_distribution, ranking),
                    "Distribution of the ranks.",
                )  # fmt: skip
                if not math.isnan(ranking.difference):
                    yield Plot(
                        f"cd_{stem}", partial(difference_diagram, ranking, styles),
                        f"Mean ranks over {maps} cases (maps) of {len(ranking.samplers)} samplers; "
                        "bars join those that Nemenyi's test at 5 % does not tell apart, critical "
                        f"difference {ranking.difference:.2f}.",
                    )  # fmt: skip

    return section


def rank_counts(budget: str, ranking: Ranking, published: Published | None) -> pd.DataFrame:
    """A line a sampler: its mean rank, beside the paper's, how often it is first, and its worst."""
    printed = published.values if published else {}
    nothing = {ranking.metric.name: (math.nan, math.nan)}
    return pd.DataFrame(
        {
            "budget": budget,
            "metric": ranking.metric.name,
            "sampler": ranking.samplers,
            "mean_rank": ranking.ranks.mean(axis=0),
            "paper_rank": [
                printed.get(name, nothing)[ranking.metric.name][1] for name in ranking.samplers
            ],
            "first": ranking.firsts,
            "worst_rank": ranking.ranks.max(axis=0),
        }
    )


def ranks_per_map(budget: str, ranking: Ranking) -> pd.DataFrame:
    """Error and rank of every sampler on every map, one line each."""
    errors = ranking.per_map
    ranks = pd.DataFrame(ranking.ranks, errors.index, errors.columns)
    both = pd.DataFrame({"error": errors.stack(), "rank": ranks.stack()}).reset_index()
    both.insert(0, "metric", ranking.metric.name)
    both.insert(0, "budget", budget)
    return both
