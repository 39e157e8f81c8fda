"""A `Table` as Markdown, LaTeX and text for a terminal: the same digits everywhere."""

import pandas as pd
from tabulate import tabulate

from experiments.report.parts import Table

SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "×": r"$\times$", "·": r"$\cdot$", "[": "{[}", "]": "{]}", "†": r"$^\dagger$",
    "±": r"$\pm$", "≤": r"$\le$", "≥": r"$\ge$", "−": "$-$", "²": "$^2$", "≈": r"$\approx$",
}  # fmt: skip
NUMBER = r"^[-−–\d.,e+×: \[\]±%/()†]+$"


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


def _heading(table: Table, column: str) -> str:
    return table.headings.get(column, column.replace("_", " "))


def as_markdown(table: Table) -> str:
    """The table in Markdown, digits as they are."""
    return _tabulated(text_of(table), "pipe")


def as_plain(table: Table) -> str:
    """The table as text with aligned columns."""
    return _tabulated(text_of(table), "simple")


def _tabulated(text: pd.DataFrame, style: str) -> str:
    numeric = [column.str.match(NUMBER).all() for _, column in text.items()]
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
