"""Mean values and ranks of all samplers, budget by budget: the table that the field expects.

Errors of a map are averaged over seeds and scenes, then ranked, equal errors sharing the better
rank, as do those too near the floor to be ranked; ratios are geometric means over maps, to the
error of the baseline that the column names.

Two by two, nothing depends on which others took part, but for the correction of the p-values and
for which maps all have finished. The matrix of pairs is a heat map; its tables are CSV alone.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any

import pandas as pd

from experiments.report.figures import pareto_plot, pareto_points
from experiments.report.parts import Heading, Items, Part, Plot, Table, Text
from experiments.report.ranking_plots import difference_diagram, pair_matrix, rank_map
from experiments.report.rankings import BudgetResult, Ranking, results, results_of, verdict
from experiments.report.style import Looks, label_of, looks
from experiments.report.summary import (
    ALIKE,
    MOST_SPENT,
    OVER,
    compared,
    in_order,
    leagues_of,
    overspent,
    rank_column,
    spent,
    summary_columns,
    unranked,
)
from experiments.run.budget import opening_budget
from experiments.run.experiment import Published, Section
from experiments.run.kept_images import budget_in_file_name
from experiments.run.loaded_run import Run
from metrics.registry import NEAR, ranked_metrics

LEAST_FOR_ORDER = 3
TIME = "seconds per image: preparing the lights and rendering"
KEY = (
    "Errors are means over maps and scenes after each reference's exposure. `rank` is per map, "
    "equal errors sharing the better one, averaged over maps, ± half the width of its 95 % "
    "interval of a bootstrap over maps; seeds are averaged first, and all samplers share them. "
    f"`near` counts measurements within {NEAR:g}× of what their reference's "
    f"own noise gives; a map's error within {NEAR:g}× of it is ranked, and stands in ratios, as "
    f"{NEAR:g}× it. `×` is the geometric mean over maps of the ratio to the error of the sampler "
    "that its heading names, with the 95 % interval of a bootstrap over maps; "
    f"{ALIKE} marks who is not significantly different from the first (Wilcoxon's signed-rank test "
    "of the pair, Holm's correction over all pairs, 0.05), and p is of that test. `rays` are "
    "shadow and BRDF rays per sub-pixel."
)


def ranked(published: Published | None = None, leagues: bool = False) -> Section:
    """The section; with a paper's figures beside it where there are some.

    leagues : also the ranking within each league that has several samplers, as CSV
    """

    def section(run: Run) -> Iterator[Part]:
        yield Text(KEY)
        styles = looks(run.samplers, leagues_of(run.rows))
        found = results_of(run)
        opening = opening_budget(run.rows["budget"])
        for result in found:
            yield Heading(result.budget, 3)
            yield ranked_table(result)
            yield from map(Text, exceeded(run.at(result.budget)))
            lead_said = result.budget == opening  # at the head of the report
            yield Items(tuple(map(verdict, result.rankings[lead_said:])))
            if published is not None:
                yield from beside_paper(result, published)
            if leagues:
                yield from by_league(run.at(result.budget))
            for ranking in result.rankings:
                with_map = result.budget == opening
                yield from ranking_figures(ranking, result.budget, styles, with_map)

    return section


def ranking_figures(
    ranking: Ranking, budget: str, styles: Looks, with_map: bool = True, by: str = ""
) -> Iterator[Plot]:
    """Ranks on every map where asked for, and which differences are significant.

    by : the sampler by whose error maps stand in order, where not by the first one's lead
    """
    name, label = ranking.metric.name, ranking.metric.label
    stem = f"{name}_{budget_in_file_name(budget)}"
    if ranking.maps and with_map:
        order = ranking.per_map[by].to_numpy().argsort(kind="stable") if by else None
        how = "from the first sampler's clearest win to its clearest loss"
        how = f"maps by the error of {label_of(by)}, least first" if by else how
        draw = partial(rank_map, ranking, styles, order)
        yield Plot(f"rank_{stem}", draw, f"Rank on every map by {label} at {budget}, {how}.")
    if not math.isnan(ranking.difference):
        yield Plot(
            f"cd_{stem}",
            partial(difference_diagram, ranking, styles),
            f"Mean ranks by {label} at {budget}; bars join samplers that Nemenyi's test does not "
            "find significantly different.",
        )


def lead(run: Run) -> Iterator[Part]:
    """What a report on samplers begins with: the verdict, and a picture of error against time."""
    found = results_of(run)
    opening = opening_budget(run.rows["budget"])
    ranking = next(one for one in found if one.budget == opening).rankings[0]
    yield Text(verdict(ranking))
    points = pareto_points(found, ranking.metric)
    if len(ranking.samplers) > 1 and len(points):
        styles = looks(run.samplers, leagues_of(run.rows))
        yield Plot(
            f"pareto_{ranking.metric.name}",
            partial(pareto_plot, points, ranking.metric, styles, TIME),
            f"Mean {ranking.metric.label} against the mean time of an image; who is on the Pareto "
            "front has a colour.",
        )


def by_league(rows: pd.DataFrame) -> Iterator[Part]:
    """The ranked tables of the leagues of one budget, each as if nobody else took part."""
    leagues = leagues_of(rows)
    for league in in_order(leagues):
        members = [sampler for sampler, its in leagues.items() if its == league]
        if len(members) > 1:
            (result,) = results(rows[rows["sampler"].isin(members)])
            yield replace(ranked_table(result), stem="summary_by_league", shown=False)


def ranked_table(result: BudgetResult) -> Table:
    """The summary of one budget with ratios and costs.

    Bold are who is first and who ties with it, but where the test separates nobody.
    """
    table = result.table
    baselines = {ranking.metric.name: ranking.baseline for ranking in result.rankings}
    columns = summary_columns(table, baselines)
    shown = [column for column in columns if column.format]
    best = {
        name: list(table["sampler"].isin(one.tied))
        for one in result.rankings
        for name in (one.metric.name, rank_column(one.metric.name))
        if len(one.tied) < len(one.samplers)
    }
    caption = (
        f"Mean errors and mean ranks over {table['maps'].iloc[0]} maps "
        f"({table['cases'].iloc[0]} cases of scene and map) at {result.budget}."
        + (f" {OVER} Not ranked: over the budget." if unranked(table) else "")
    )
    return Table(
        "summary", pd.DataFrame({column.name: column.values(table) for column in columns}),
        {column.name: column.format for column in shown},
        {column.name: column.heading for column in shown}, best, caption,
    )  # fmt: skip


def exceeded(rows: pd.DataFrame) -> list[str]:
    """Which samplers are over the one budget of the rows, and how far."""
    fair = compared(rows)
    return [
        f"{label_of(sampler)} is not ranked: it takes "
        f"{spent(fair[fair['sampler'] == sampler]).mean():.2f} times the budget, and may take "
        f"{MOST_SPENT:g} times."
        for sampler in sorted(overspent(fair))
    ]


def beside_paper(result: BudgetResult, published: Published) -> Iterator[Part]:
    """A paper's figures beside these, and how far the orders agree; nothing where it prints none
    of the metrics by which samplers are ranked.
    """
    here = result.table.set_index("sampler")
    shared = [
        name for name in published.values if name in here.index and here.loc[name].notna().any()
    ]
    if not shared:
        return
    rows = pd.DataFrame({"budget": result.budget, "sampler": shared})
    formats: dict[str, str] = {"sampler": "s"}
    headings: dict[str, str] = {}
    agreements = []
    for metric in ranked_metrics():
        if metric.name not in here or not all(metric.name in published.values[s] for s in shared):
            continue
        printed = pd.Series({s: published.values[s][metric.name][0] for s in shared})
        ranks = [published.values[s][metric.name][1] for s in shared]
        with_ranks = not all(map(math.isnan, ranks))
        rows[f"paper_{metric.name}"] = [
            f"{value:.4f}" + ("" if math.isnan(rank) else f" ({rank:.2f})")
            for value, rank in zip(printed, ranks, strict=True)
        ]
        rows[f"{metric.name}_over_paper"] = (here.loc[shared, metric.name] / printed).to_numpy()
        formats |= {f"paper_{metric.name}": "s", f"{metric.name}_over_paper": ".2f"}
        headings |= {
            f"paper_{metric.name}": f"paper {metric.label}" + (" (rank)" if with_ranks else ""),
            f"{metric.name}_over_paper": f"{metric.label}, here / paper",
        }
        if len(shared) >= LEAST_FOR_ORDER:
            per_map = result.by(metric.name).resolved
            agreement = order_agreement(per_map, published, metric.name)
            agreements.append(f"{agreement:.2f} by {metric.label}")
    if not headings:
        return
    yield Text(f"{published.source}, measured on other scenes, maps and budgets:")
    yield Table("beside_paper", rows, formats, headings)
    if agreements:
        yield Text(
            "Spearman's correlation of the paper's order and that here over these "
            f"{len(shared)} samplers: {', '.join(agreements)}."
        )


def order_agreement(per_map: pd.DataFrame, published: Published, metric: str) -> float:
    """Spearman's correlation of mean values, here and in the paper, over the shared methods.

    per_map : (maps × samplers), as they are ranked. NaN where all are alike here.
    """
    from scipy.stats import spearmanr

    means = per_map.mean()
    shared = [name for name in published.values if name in means.index]
    if means[shared].nunique() < 2:
        return math.nan
    printed = [published.values[name][metric][0] for name in shared]
    return float(spearmanr(printed, means[shared]).statistic)


def pairwise(run: Run) -> Iterator[Part]:
    """A matrix by each ranked metric and budget; all pairs as CSV."""
    yield Heading("Pairs")
    for result in results_of(run):
        for found in result.rankings:
            if not found.maps or len(found.samplers) < 2:
                continue
            name, label = found.metric.name, found.metric.label
            # Every pair once: the one that stands later against the one before it.
            places = combinations(range(len(found.samplers)), 2)
            lines = [pair_line(found, worse, better) for better, worse in places]
            rows = pd.DataFrame(lines).assign(budget=result.budget, metric=name)
            yield Table("pairwise", rows, {}, shown=False)
            yield Plot(
                f"pairs_{name}_{budget_in_file_name(result.budget)}",
                partial(pair_matrix, found),
                f"{label} at {result.budget}: the row's over the column's, geometric mean over "
                f"{found.maps} maps, and wins · ties · losses of the row; bold where the "
                "difference is significant.",
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
        "p": pairs.p_value[one, other],
    }  # fmt: skip
