"""Rank of every sampler on every map, and which differ surely.

Reproduces Fig. 8 of Wu 2025 by RMSE and by FLIP: one line a method over the maps, in order of the
error of the paper's full method. To that come how often each is first and the
critical-difference diagram of Demšar 2006. A case of the statistics is a map, its error the mean
over scenes: scenes under one map are not independent. The paper prints no ranks per map; the mean
ranks of its Table 1, among seven methods on 32 other maps and four other scenes, stand beside ours.
"""

import math
from collections.abc import Iterator

import pandas as pd

from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.rankings import Ranking, results_of, verdict
from experiments.report.sections.ranks import ranking_figures
from experiments.report.style import label_of, looks
from experiments.report.summary import leagues_of
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.loaded_run import Run
from experiments.wu2025.published import TABLE1

FORMATS = {
    "sampler": "s", "mean_rank": ".2f", "paper_rank": ".2f", "first": "d", "worst_rank": ".0f",
}  # fmt: skip
LONG = {"environment": "s", "sampler": "s", "error": ".4f", "rank": ".0f"}
OWN = "ours"
"""By whose error maps stand in order; by the winner's where it was not run."""
ENDINGS = {1: "st", 2: "nd", 3: "rd"}


@experiment("ranking")
def ranking() -> GridExperiment:
    """Rank of every sampler on every map, with the statistics of the differences."""
    return GridExperiment(
        title="Ranks per map (Wu 2025, Fig. 8)",
        sections=(rank_plots,),
        quick_scenes=2,
        published=TABLE1,
        figures=(PaperFigure("Fig. 8", "ranks on every map", among_the_papers),),
    )


def among_the_papers(run: Run) -> tuple[str, str]:
    """The place and mean rank of the paper's method among those of the paper, by each metric."""
    result = results_of(run)[0]
    first, places, told = [], [], []
    for ranking in result.rankings:
        name = ranking.metric.name
        shared = [label for label in TABLE1.values if label in ranking.samplers]
        means = ranking.resolved[shared].rank(axis="columns", method="min").mean()
        place = int(means.rank(method="min")[OWN])
        first.append(place == 1)
        places.append(f"{place}{ENDINGS.get(place, 'th')} by {ranking.metric.label}")
        told.append(
            f"by {ranking.metric.label} {label_of(OWN)} {means[OWN]:.2f} "
            f"({TABLE1.values[OWN][name][1]:.2f}), least {label_of(str(means.idxmin()))} "
            f"{means.min():.2f}"
        )
    return (
        f"{answer(sum(first), len(first))}: {', '.join(places)}",
        f"Mean ranks among the paper's methods at {result.budget}, in brackets the paper's: "
        f"{'; '.join(told)}.",
    )


def rank_plots(run: Run) -> Iterator[Part]:
    """Words, tables and plots of every ranking, the maps in order of the error of `OWN`."""
    styles = looks(run.samplers, leagues_of(run.rows))
    for result in results_of(run):
        for ranking in result.rankings:
            yield Heading(f"{ranking.metric.label}, {result.budget}", 3)
            yield Text(verdict(ranking))
            if not ranking.maps:
                continue
            yield Table("rank_counts", rank_counts(result.budget, ranking), FORMATS)
            yield Table("ranks", ranks_per_map(result.budget, ranking), LONG, shown=False)
            name = OWN if OWN in ranking.samplers else ranking.winner
            yield from ranking_figures(ranking, result.budget, styles, by=name)


def rank_counts(budget: str, ranking: Ranking) -> pd.DataFrame:
    """A line a sampler: its mean rank, beside the paper's, how often it is first, and its worst."""
    printed, metric = TABLE1.values, ranking.metric.name
    nothing = {metric: (math.nan, math.nan)}
    return pd.DataFrame(
        {
            "budget": budget,
            "metric": metric,
            "sampler": ranking.samplers,
            "mean_rank": ranking.ranks.mean(axis=0),
            "paper_rank": [printed.get(name, nothing)[metric][1] for name in ranking.samplers],
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
