"""A `Table` as Markdown, LaTeX and text: the same digits everywhere; the summary on a terminal."""

import json
import math
import re
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
from rich.console import Console
from tabulate import tabulate

from experiments.report.parts import Table
from experiments.report.style import label_of
from experiments.report.summary import MOST_SPENT, as_printed, summary_columns, unranked

SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "×": r"$\times$", "·": r"$\cdot$", "[": "{[}", "]": "{]}", "†": r"$^\dagger$",
    "±": r"$\pm$", "≤": r"$\le$", "≥": r"$\ge$", "−": "$-$", "²": "$^2$", "≈": r"$\approx$",
}  # fmt: skip
CODE = r"(?<!`)(?P<ticks>`+)(?!`)(?:.*?)(?<!`)(?P=ticks)(?!`)"
RAW = re.compile(rf"(?P<kept>\\.|{CODE})|<|\](?=\(\s*(?:[A-Za-z][\w+.-]*:|//))", re.DOTALL)
"""Where HTML or a link to another place begins, outside of escapes and code."""
CENTERED, SMALL = r"\centering", r"\footnotesize" + "\n" + r"\setlength{\tabcolsep}{3pt}"
IN_CELL = re.compile(r"[\\`<|]|\](?=\()")
NUMBER = r"^[-−–\d.,e+×: \[\]±%/()†*]+$"


def text_of(table: Table) -> pd.DataFrame:
    """The printed columns as text under their headings, some of which may be alike; missing values
    are dashes.
    """
    present = _present(table)
    text = pd.DataFrame(
        {
            column: [
                as_printed(value, table.formats[column], column) for value in table.rows[column]
            ]
            for column in present
        }
    )
    named = (table.headings.get(one) or label_of(one.replace("_", " ")) for one in present)
    return text.set_axis(list(named), axis="columns")


def _present(table: Table) -> list[str]:
    return [column for column in table.formats if column in table.rows]


def with_milliseconds(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with medians and quartiles of `seconds` as `ms`, `ms_lower` and `ms_upper`."""
    return rows.assign(
        **{f"ms{end}": 1e3 * rows[f"seconds{end}"] for end in ("", "_lower", "_upper")}
    )


def as_markdown(table: Table) -> str:
    """The table in Markdown, digits as they are, and nothing in its cells is Markdown."""
    text = text_of(table)
    cells = text.map(_cell)
    cells.columns = pd.Index(markdown_text(name).replace("|", r"\|") for name in text.columns)
    return _tabulated(cells, "pipe")


def markdown_text(text: str) -> str:
    """A paragraph that names may stand in: it stays one, and holds no HTML and no link outside."""
    one = re.sub(r"\s*[\r\n]+\s*", " ", text)
    return RAW.sub(lambda found: found[0] if found["kept"] else f"\\{found[0]}", one)


def _cell(text: str) -> str:
    return IN_CELL.sub(lambda found: f"\\{found[0]}", " ".join(text.split()))


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


def _close_by(text: pd.DataFrame) -> str:
    """A table on a terminal, as narrow as it can be."""
    lines = [list(text.columns), *text.to_numpy().tolist()]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, ["-" * width for width in widths])
    sides = [str.rjust if number else str.ljust for number in numeric_columns(text)]
    together = [zip(sides, line, widths, strict=True) for line in lines]
    return "\n".join(" ".join(side(cell, width) for side, cell, width in one) for one in together)


def as_latex(table: Table, columns: str = "") -> str:
    """The table as a `booktabs` table, the best of each column of `best` in bold.

    columns : LaTeX's format of the columns, where it is not the usual one; they stand closer then
    """
    text, names = text_of(table).map(latex_escaped), _present(table)
    headings = dict(zip(names, map(latex_escaped, text.columns), strict=True))
    text.columns = pd.Index(names)
    bold = pd.DataFrame("", text.index, names)
    for name, which in table.best.items():
        if name in names:
            values = table.rows[name]
            if isinstance(which, str):
                which = values == (values.min() if which == "less" else values.max())
            bold.loc[np.asarray(which), name] = "textbf:--rwrap;"
    set_in = (
        text.style.hide(axis="index")
        .apply(lambda _: bold, axis=None)
        .format_index(lambda name: headings[str(name)], axis="columns")
        .to_latex(
            hrules=True,
            position_float="centering",
            column_format=columns or "l" + "r" * (len(names) - 1),
            caption=latex_escaped(table.caption) or None,
        )
    )
    small = SMALL.replace("3pt", "2pt") if columns else SMALL
    return set_in.replace(CENTERED, f"{CENTERED}\n{small}", 1)


def latex_escaped(text: str) -> str:
    """Text in which nothing is LaTeX."""
    return "".join(SPECIAL.get(character, character) for character in text)


def print_summary(table: pd.DataFrame, title: str) -> None:
    """The summary, a table per budget; samplers go by their names where labels have no room."""
    console = Console()
    width = console.width if console.is_terminal else math.inf
    shown = [column for column in summary_columns(table, {}) if column.short]
    for budget, part in table.groupby("budget", sort=False):
        text = pd.DataFrame({one.name: list(map(one.text, one.values(part))) for one in shown})
        names = text.assign(sampler=list(part["sampler"]))
        for variant in (text, names):
            variant.columns = pd.Index([one.short for one in shown])
        wide = _close_by(text)
        fits = max(map(len, wide.splitlines())) <= width
        print(f"{title} · {budget} (± is half of a rank's 95 % interval over maps)")
        print(f"{wide if fits else _close_by(names)}\n")
        if over := unranked(part):
            words = f"Not ranked, more than {100 * (MOST_SPENT - 1):.0f} % over the budget: "
            print(words + ", ".join(over))


def print_tables(tables: Iterable[Table]) -> None:
    """A study's tables, with their captions."""
    for table in tables:
        if table.shown:
            print("\n".join(filter(None, [as_plain(table), table.caption, ""])))


def as_json(table: pd.DataFrame, facts: Mapping[str, object]) -> str:
    """Facts and the summary's rows as JSON; what is not a number there is null."""
    rows = json.loads(table.to_json(orient="records", double_precision=15))
    return json.dumps({**facts, "summary": rows}, indent=2, ensure_ascii=False)
