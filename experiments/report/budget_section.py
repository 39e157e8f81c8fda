"""What a report says about one budget: the table, the tests, and the paper's figures beside ours.

Ratios ours / paper compare errors from other scenes, maps and budgets, so that only their order is
comparable: Spearman's rank correlation over the samplers that both have says how far it agrees.
"""

import math

import pandas as pd

from experiments.report.full_table import full_table
from experiments.report.ranking_table import sentence
from experiments.report.rankings import NAMES, BudgetResult, Ranking
from experiments.run.budget import Budget
from experiments.run.grid_experiment import GridRun
from experiments.wu2025.table1 import PAPER

PAPER_COLUMN = {"rmse": 0, "flip": 2}
"""Where an error stands in the rows of `PAPER`; its rank follows it."""
LEAST_FOR_ORDER = 3


def budget_lines(run: GridRun, result: BudgetResult) -> list[str]:
    """Lines of Markdown."""
    text = full_table(result.table)
    text["floor"] = [f"{value:.4f}" for value in result.table["noise_floor"]]
    text["near"] = [_count(value) for value in result.table["near_floor"]]
    kind = Budget.parse(result.budget)
    note = ", the paper's" if kind == Budget(8) else ""
    return [
        f"### {result.budget}{note}",
        "",
        text.to_markdown(index=False, disable_numparse=True),
        "",
        *_exceeded(run.rows[run.rows["budget"] == result.budget]),
        *(line for found in result.rankings for line in _tests(found)),
        "",
        *paper_lines(result),
    ]


def _count(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.0f}"


def _tests(found: Ranking) -> list[str]:
    """Who won by one measure, and what the tests say."""
    name = NAMES[found.measure]
    words = [f"- {name}: {sentence(found)}"]
    if found.friedman is not None:
        words.append(
            f"Friedman's test over {found.friedman.blocks} maps: χ² = "
            f"{found.friedman.statistic:.1f}, p = {found.friedman.p_value:.2g}."
        )
    if not math.isnan(found.difference):
        words.append(f"Nemenyi's critical difference at 5 %: {found.difference:.2f} ranks.")
    return [" ".join(words)]


def _exceeded(rows: pd.DataFrame) -> list[str]:
    """Which samplers cannot go down to the budget, and how far they can."""
    over = rows[rows["over_budget"]]
    if over.empty:
        return []
    timed = Budget.parse(rows["budget"].iloc[0]).timed
    column, unit = ("seconds_render", "s") if timed else ("rays", "rays")
    lines = ["Rendered at their smallest number of lights, which costs more than the budget:", ""]
    for sampler, part in over.groupby("sampler"):
        least = part["count"].min()
        lines.append(
            f"- {sampler}: {least} lights, on {len(part)} of {(rows['sampler'] == sampler).sum()} "
            f"measurements; {part[column].min():.3g} to {part[column].max():.3g} {unit}"
        )
    return [*lines, ""]


def paper_lines(result: BudgetResult) -> list[str]:
    """The paper's Table 1 beside ours, and how far the orders agree."""
    ours = result.table.set_index("sampler")
    shared = [name for name in PAPER if name in ours.index and not math.isnan(ours["rmse"][name])]
    if not shared:
        return []
    text = pd.DataFrame({"sampler": shared})
    agreements = []
    for measure, place in PAPER_COLUMN.items():
        name = NAMES[measure]
        paper = pd.Series({sampler: PAPER[sampler][place] for sampler in shared})
        values = ours[measure][shared]
        rank = {sampler: PAPER[sampler][place + 1] for sampler in shared}
        text[f"paper {name}"] = [f"{paper[s]:.4f} ({rank[s]:.2f})" for s in shared]
        text[f"{name}, ours / paper"] = [f"{values[s] / paper[s]:.2f}" for s in shared]
        if len(shared) >= LEAST_FOR_ORDER:
            from scipy.stats import spearmanr

            agreements.append(f"{spearmanr(paper, values).statistic:.2f} by {name}")
    order = (
        f"Spearman's correlation of the paper's order and ours over these {len(shared)} samplers: "
        f"{', '.join(agreements)}."
    )
    return [
        "Table 1 of Wu 2025 (ranks in brackets), measured on other scenes, maps and budgets:",
        "",
        text.to_markdown(index=False, disable_numparse=True),
        "",
        *([order, ""] if agreements else []),
    ]
