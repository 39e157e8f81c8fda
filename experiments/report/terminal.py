"""Tables on a terminal, and as JSON for machines."""

import json
import math
from collections.abc import Iterable, Mapping

import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from experiments.report.parts import Table
from experiments.report.summary import errors_in, rank_column
from experiments.report.tables import as_plain
from metrics.registry import find_metric

COSTS = {
    "lights": ("lights", 1, 1.0),
    "rays": ("rays", 1, 1.0),
    "seconds_lights": ("prep ms", 1, 1e3),
    "seconds_render": ("rend ms", 0, 1e3),
}
"""Heading, decimals and unit: narrow, so that the table fits into 80 columns."""


def print_summary(table: pd.DataFrame, title: str) -> None:
    """The summary, a table per budget."""
    console = Console()
    if not console.is_terminal:  # a file has no width, and figures must not be cut to a guessed one
        console = Console(width=200)
    for budget, part in table.groupby("budget", sort=False):
        shown = RichTable(title=f"{title} · {budget}", box=SIMPLE, padding=0, show_edge=False)
        columns = {"sampler": list(part["sampler"])}
        for name in errors_in(part):
            metric = find_metric(name)
            columns[metric.label] = _digits(part[name], metric.digits)
            columns[f"rank by {name}"] = _digits(part[rank_column(name)], 2)
        for name, (heading, places, unit) in COSTS.items():
            columns[heading] = _digits(unit * part[name], places)
        for heading in columns:
            justify = "left" if heading == "sampler" else "right"
            words = "rank" if heading.startswith("rank by") else heading
            shown.add_column(words, justify=justify, no_wrap=True)  # type: ignore[arg-type]
        for line in zip(*columns.values(), strict=True):
            shown.add_row(*map(Text, line))  # brackets are no markup
        console.print(shown)


def _digits(values: pd.Series, places: int) -> list[str]:
    return ["–" if math.isnan(value) else f"{value:.{places}f}" for value in values]


def print_tables(tables: Iterable[Table]) -> None:
    """A study's tables, with their captions."""
    for table in tables:
        if table.shown:
            print("\n".join(filter(None, [as_plain(table), table.caption, ""])))


def as_json(table: pd.DataFrame, facts: Mapping[str, object]) -> str:
    """Facts and the summary's rows as JSON; what is not a number there is null."""
    rows = json.loads(table.to_json(orient="records", double_precision=15))
    return json.dumps({**facts, "summary": rows}, indent=2, ensure_ascii=False)
