"""A `Table` as Markdown, LaTeX and text: the same digits everywhere; the summary on a terminal."""

import json
import math
import re
from collections.abc import Iterable, Mapping

import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text
from tabulate import tabulate

from experiments.report.parts import Table
from experiments.report.summary import errors_in, rank_column
from metrics.registry import find_metric

SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "×": r"$\times$", "·": r"$\cdot$", "[": "{[}", "]": "{]}", "†": r"$^\dagger$",
    "±": r"$\pm$", "≤": r"$\le$", "≥": r"$\ge$", "−": "$-$", "²": "$^2$", "≈": r"$\approx$",
}  # fmt: skip
CODE = r"(?<!`)(?P<ticks>`+)(?!`)(?:.*?)(?<!`)(?P=ticks)(?!`)"
RAW = re.compile(rf"(?P<kept>\\.|{CODE})|<|\](?=\(\s*(?:[A-Za-z][\w+.-]*:|//))", re.DOTALL)
"""Where HTML or a link to another place begins, outside of escapes and code."""
IN_CELL = re.compile(r"[\\`<|]|\](?=\()")
ESCAPED = re.compile(rf"(?P<kept>{CODE})|\\([!-/:-@\[-`{{-~])", re.DOTALL)
NUMBER = r"^[-−–\d.,e+×: \[\]±%/()†]+$"
COSTS = {
    "lights": ("lights", 1, 1.0),
    "rays": ("rays", 1, 1.0),
    "seconds_lights": ("prep ms", 1, 1e3),
    "seconds_render": ("rend ms", 0, 1e3),
}
"""Heading, decimals and unit: narrow, so that the table fits into 80 columns."""


def text_of(table: Table) -> pd.DataFrame:
    """The printed columns as text under their headings; missing values are dashes."""
    present = [column for column in table.formats if column in table.rows]
    return pd.DataFrame(
        {
            _heading(table, column): [
                "–" if pd.isna(value) else format(value, table.formats[column])
                for value in table.rows[column]
            ]
            for column in present
        }
    )


def with_milliseconds(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with medians and quartiles of `seconds` as `ms`, `ms_lower` and `ms_upper`."""
    return rows.assign(
        **{f"ms{end}": 1e3 * rows[f"seconds{end}"] for end in ("", "_lower", "_upper")}
    )


def _heading(table: Table, column: str) -> str:
    return table.headings.get(column, column.replace("_", " "))


def as_markdown(table: Table) -> str:
    """The table in Markdown, digits as they are, and nothing in its cells is Markdown."""
    text = text_of(table)
    return _tabulated(text.map(_cell).rename(columns=_markdown_heading), "pipe")


def markdown_text(text: str) -> str:
    """A paragraph that names may stand in: it stays one, and holds no HTML and no link outside."""
    one = re.sub(r"\s*[\r\n]+\s*", " ", text)
    return RAW.sub(lambda found: found[0] if found["kept"] else f"\\{found[0]}", one)


def _cell(text: str) -> str:
    return IN_CELL.sub(lambda found: f"\\{found[0]}", " ".join(text.split()))


def _markdown_heading(text: str) -> str:
    return markdown_text(text).replace("|", r"\|")


def without_escapes(text: str) -> str:
    """What Markdown that was written here shows, but for its code."""
    return ESCAPED.sub(lambda found: found["kept"] or found[3], text)


def as_plain(table: Table) -> str:
    """The table as text with aligned columns."""
    return _tabulated(text_of(table), "simple")


def numeric_columns(text: pd.DataFrame) -> list[bool]:
    """Whether each column of texts holds numbers alone, which stand to the right."""
    return [all(re.match(NUMBER, word) for word in column) for _, column in text.items()]


def _tabulated(text: pd.DataFrame, style: str) -> str:
    numeric = numeric_columns(text)
    return tabulate(
        text.to_numpy().tolist(), headers=[name.strip() for name in text.columns], tablefmt=style,
        disable_numparse=True, colalign=["right" if number else "left" for number in numeric],
    )  # fmt: skip


def as_latex(table: Table) -> str:
    """The table as a `booktabs` table, the best of each column of `best` in bold."""
    text = text_of(table)
    bold = {
        _heading(table, name): _best(table.rows[name], which)
        for name, which in table.best.items()
        if name in table.rows
    }
    lines = []
    for place in range(len(text)):
        words = []
        for column in text.columns:
            word = latex_escaped(str(text[column].iloc[place]))
            marked = column in bold and bool(bold[column].iloc[place])
            words.append(rf"\textbf{{{word}}}" if marked else word)
        lines.append(" & ".join(words) + r" \\")
    headings = " & ".join(latex_escaped(name.strip()) for name in text.columns)
    return "\n".join(
        [
            r"\begin{table}",
            r"\centering",
            r"\footnotesize",
            r"\setlength{\tabcolsep}{3pt}",
            *([rf"\caption{{{latex_escaped(table.caption)}}}"] if table.caption else []),
            rf"\begin{{tabular}}{{l{'r' * (len(text.columns) - 1)}}}",
            r"\toprule",
            headings + r" \\",
            r"\midrule",
            *lines,
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def _best(values: pd.Series, which: str) -> pd.Series:
    return values == (values.min() if which == "less" else values.max())


def latex_escaped(text: str) -> str:
    """Text in which nothing is LaTeX."""
    return "".join(SPECIAL.get(character, character) for character in text)


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
