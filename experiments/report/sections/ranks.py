"""Mean values and ranks of all samplers, budget by budget: the table that the field expects.

Errors of a map are averaged over seeds and scenes, then ranked, equal errors sharing the better
rank, as do those too near the floor to be ranked; ratios are geometric means over maps, to the
error of the baseline that the column names.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import pandas as pd

from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.rankings import BudgetResult, Ranking, results, results_of
from experiments.report.sentences import doubt, remarks, verdict
from experiments.report.summary import ALIKE, in_order, leagues_of, summary_columns
from experiments.run.budget import Budget
from experiments.run.experiment import Published, Section
from experiments.run.loaded_run import Run
from metrics.registry import NEAR, ranked_metrics

LEAST_FOR_ORDER = 3
KEY = (
    "Errors are means over maps and scenes after each reference's exposure. `rank` is per map, "
    "equal errors sharing the better one, averaged over maps; seeds are averaged first, and all "
    f"samplers share them. `near` counts measurements within {NEAR:g}× of what their reference's "
    f"own noise gives; a map's error within {NEAR:g}× of it is ranked, and stands in ratios, as "
    f"{NEAR:g}× it. `×` is the geometric mean over maps of the ratio to the error of the sampler "
    "that its heading names, with the 95 % interval of a bootstrap over maps; "
    f"{ALIKE} marks who is not told apart from the first (Wilcoxon's signed-rank test of the pair, "
    "Holm's correction over all pairs, 0.05). `rays` are shadow and BRDF rays per sub-pixel."
)


def ranked(published: Published | None = None, leagues: bool = False) -> Section:
    """The section; with a paper's figures beside it where there are some.

    leagues : also the ranking within each league that has several samplers, where the rows tell
    """

    def section(run: Run) -> Iterator[Part]:
        yield Text(KEY)
        for result in results_of(run):
            yield Heading(result.budget, 3)
            yield ranked_table(result)
            yield from map(Text, exceeded(run.at(result.budget)))
            for ranking in result.rankings:
                yield Items(words(ranking))
            if published is not None:
                yield from beside_paper(result, published)
            if leagues:
                yield from by_league(run.at(result.budget))

    return section


def words(ranking: Ranking) -> tuple[str, ...]:
    """All that is said about a ranking."""
    return tuple(filter(None, [verdict(ranking), doubt(ranking), *remarks(ranking)]))


def by_league(rows: pd.DataFrame) -> Iterator[Part]:
    """The ranked tables of the leagues of one budget, each as if nobody else took part."""
    leagues = leagues_of(rows)
    for league in in_order(leagues):
        members = [sampler for sampler, its in leagues.items() if its == league]
        if len(members) < 2:
            continue
        (result,) = results(rows[rows["sampler"].isin(members)])
        yield Heading(f"{result.budget}: {league}", 4)
        yield replace(ranked_table(result), stem="summary_by_league")
        for ranking in result.rankings:
            yield Items(words(ranking))


def ranked_table(result: BudgetResult) -> Table:
    """The summary of one budget with ratios and costs.

    The best are bold but where the test separates nobody from the first.
    """
    table = result.table
    baselines = {ranking.metric.name: ranking.baseline for ranking in result.rankings}
    columns = summary_columns(table, baselines)
    shown = [column for column in columns if column.format]
    tied = {one.metric.name for one in result.rankings if all(one.like_first)}
    best = {
        column.name: column.better
        for column in shown
        if column.better and column.name.removesuffix("_rank") not in tied
    }
    caption = (
        f"Mean errors and mean ranks over {table['maps'].iloc[0]} maps "
        f"({table['cases'].iloc[0]} cases of scene and map) at {result.budget}."
    )
    return Table(
        "summary", pd.DataFrame({column.name: column.values(table) for column in columns}),
        {column.name: column.format for column in shown},
        {column.name: column.heading for column in shown}, best, caption,
    )  # fmt: skip


def exceeded(rows: pd.DataFrame) -> list[str]:
    """Which samplers cannot go down to the budget, and how far they can."""
    over = rows[rows["over_budget"]]
    if over.empty:
        return []
    timed = Budget.parse(rows["budget"].iloc[0]).timed
    column, unit = ("seconds_render", "s") if timed else ("rays", "rays")
    lines = []
    for sampler, part in over.groupby("sampler"):
        took = dict.fromkeys(f"{end:.3g}" for end in (part[column].min(), part[column].max()))
        lines.append(
            f"{sampler} is rendered at its smallest number of lights, {part['count'].min()}, which "
            f"costs more than the budget, on {len(part)} of {(rows['sampler'] == sampler).sum()} "
            f"measurements: {' to '.join(took)} {unit}."
        )
    return lines


def beside_paper(result: BudgetResult, published: Published) -> Iterator[Part]:
    """A paper's figures beside these, and how far the orders agree; nothing where it prints none
    of the metrics by which samplers are ranked."""
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
