"""The summary as text, with intervals and groups: Markdown, LaTeX and the pages print the same."""

import math

import pandas as pd

from experiments.report.rankings import BudgetResult
from experiments.report.tables import COLUMNS, printable

RATIOS = {"rmse": "× base", "flip": "× base "}
GROUPS = {"rmse": "group", "flip": "group "}
MEASURES = {
    COLUMNS[name]: name
    for name in ("rmse", "rmse_rank", "flip", "flip_rank", "seconds_lights", "seconds_render")
}
"""Headings of columns of which the smallest value is the best, and where the values stand."""


def interval(ratio: float, low: float, high: float) -> str:
    """A ratio with its interval: "1.35 [1.20, 1.52]"."""
    return "–" if math.isnan(ratio) else f"{ratio:.2f} [{low:.2f}, {high:.2f}]"


def full_table(table: pd.DataFrame, paper: bool = False) -> pd.DataFrame:
    """The extended summary of one budget as text.

    paper : with what the paper printed for the same samplers, as the last column
    """
    text = printable(table)
    if not paper or not text[COLUMNS["paper"]].any():
        text = text.drop(columns=COLUMNS["paper"])
    for measure in ("rmse", "flip"):
        columns = (f"{measure}_ratio", f"{measure}_low", f"{measure}_high")
        place = int(text.columns.get_loc(COLUMNS[f"{measure}_rank"])) + 1  # type: ignore[arg-type]
        ratios = [interval(*values) for values in table[list(columns)].itertuples(index=False)]
        text.insert(place, RATIOS[measure], ratios)
        text.insert(place + 1, GROUPS[measure], table[f"{measure}_group"].to_numpy())
    return text


def markdown_tables(results: list[BudgetResult]) -> str:
    """All budgets' tables as Markdown."""
    return "\n".join(
        f"### {result.budget}\n\n"
        f"{full_table(result.table, True).to_markdown(index=False, disable_numparse=True)}\n"
        for result in results
    )
