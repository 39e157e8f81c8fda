"""Tables of a run: terminal, CSV and Markdown, all from the same rows."""

import math
from collections.abc import Mapping

import pandas as pd

from experiments.run.identity import digest
from experiments.run.store import Store
from experiments.wu2025.table1 import PAPER

COLUMNS = {
    "sampler": "sampler",
    "rmse": "RMSE",
    "rmse_rank": "rank",
    "flip": "FLIP",
    "flip_rank": "rank ",
    "lights": "lights",
    "rays": "rays",
    "seconds_lights": "prepare ms",
    "seconds_render": "render ms",
    "paper": "paper RMSE · FLIP",
}
NARROW = {"prepare ms": "prep ms", "render ms": "rend ms"}
"""Headings on a terminal, so that the table fits into 80 columns."""


def measurement_rows(store: Store) -> pd.DataFrame:
    """One row per finished measurement, with its key, in a fixed order."""
    measurements = [
        {"key": key, "reference": digest(identity["case"]), **result}
        for key, identity, result in store.rows()
        if "case" in identity
    ]
    rows = pd.DataFrame(measurements)
    if rows.empty:
        return rows
    order = ["scale", "scene", "environment", "budget", "sampler", "seed", "key"]
    return rows.sort_values(order, kind="stable").reset_index(drop=True)


def rows_of(store: Store, keys: list[str]) -> pd.DataFrame:
    """The finished rows of these measurements alone; what else the folder holds stays out."""
    rows = measurement_rows(store)
    return rows if rows.empty else rows[rows["key"].isin(keys)].reset_index(drop=True)


def _paper(sampler: str) -> str:
    if sampler not in PAPER:
        return ""
    rmse, rmse_rank, flip, flip_rank = PAPER[sampler]
    return f"{rmse:.4f} ({rmse_rank:.2f}) · {flip:.4f} ({flip_rank:.2f})"


def _digits(values: pd.Series, places: int) -> pd.Series:
    return values.map(lambda value: "–" if math.isnan(value) else f"{value:.{places}f}")


def printable(table: pd.DataFrame) -> pd.DataFrame:
    """The summary of one budget as text, under the headings people read."""
    text = pd.DataFrame(
        {
            "sampler": table["sampler"],
            "rmse": _digits(table["rmse"], 4),
            "rmse_rank": _digits(table["rmse_rank"], 2),
            "flip": _digits(table["flip"], 4),
            "flip_rank": _digits(table["flip_rank"], 2),
            "lights": _digits(table["lights"], 1),
            "rays": _digits(table["rays"], 1),
            "seconds_lights": _digits(1e3 * table["seconds_lights"], 1),
            "seconds_render": _digits(1e3 * table["seconds_render"], 0),
            "paper": table["sampler"].map(_paper),
        }
    )
    return text.rename(columns=COLUMNS)


def print_summary(summary: pd.DataFrame, title: str) -> None:
    """The summary on the terminal."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if not console.is_terminal:  # a file has no width, and figures must not be cut to a guessed one
        console = Console(width=200)
    for budget, part in summary.groupby("budget", sort=False):
        table = Table(title=f"{title} · {budget}", box=SIMPLE, padding=0, show_edge=False)
        text = printable(part).drop(columns=COLUMNS["paper"])
        for column in text.columns:
            justify = "left" if column == "sampler" else "right"
            heading = NARROW.get(column, column.strip())
            table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
        for line in text.itertuples(index=False):
            table.add_row(*(Text(str(value)) for value in line))  # brackets are no markup
        console.print(table)


def as_text(summary: pd.DataFrame, facts: Mapping[str, object]) -> str:
    """Facts and the summary's rows as JSON; what is not a number there is null."""
    import json

    rows = json.loads(summary.to_json(orient="records", double_precision=15))
    return json.dumps({**facts, "summary": rows}, indent=2, ensure_ascii=False)
