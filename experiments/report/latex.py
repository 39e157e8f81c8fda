"""The summary as LaTeX: one `booktabs` table per budget, the best of each column in bold.

A dagger marks samplers whose mean rank Nemenyi's test does not tell apart from the best one's. The
numbers are the ones that the other tables print.
"""

import pandas as pd

from experiments.report.full_table import MEASURES, full_table
from experiments.report.rankings import BudgetResult, Ranking

SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "×": r"$\times$", "·": r"$\cdot$", "[": "{[}", "]": "{]}",
}  # fmt: skip
HEAD = "% Needs \\usepackage{booktabs}.\n"


def escaped(text: str) -> str:
    """Text in which nothing is LaTeX."""
    return "".join(SPECIAL.get(character, character) for character in text)


def latex(results: list[BudgetResult]) -> str:
    """All budgets' tables, ready for \\input."""
    return HEAD + "\n".join(_table(result) for result in results)


def _table(result: BudgetResult) -> str:
    text = full_table(result.table)
    body = [
        " & ".join(_cell(result, text, row, column) for column in text.columns) + r" \\"
        for row in range(len(text))
    ]
    headings = " & ".join(escaped(column.strip()) for column in text.columns)
    return "\n".join(
        [
            r"\begin{table}",
            r"\centering",
            r"\footnotesize",
            r"\setlength{\tabcolsep}{3pt}",
            rf"\caption{{{_caption(result)}}}",
            rf"\begin{{tabular}}{{l{'r' * (len(text.columns) - 1)}}}",
            r"\toprule",
            headings + r" \\",
            r"\midrule",
            *body,
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def _caption(result: BudgetResult) -> str:
    table = result.table.iloc[0]
    return (
        f"Mean errors and mean ranks over {table['maps']} maps ({table['cases']} cases of scene "
        f"and map) at {escaped(result.budget)}. Bold: best of its column. $\\dagger$: mean rank "
        "not told apart from the best by Nemenyi's test at 0.05. "
        r"$\times$ base: geometric mean over maps of the ratio to median cut, or to the "
        r"best-ranked sampler where that was not run, with the 95\,\% bootstrap interval."
    )


def _cell(result: BudgetResult, text: pd.DataFrame, row: int, column: str) -> str:
    words = escaped(str(text[column].iloc[row]))
    source = MEASURES.get(column)
    if source is None:
        return words
    values = result.table[source]
    best = bool(values.iloc[row] == values.min())
    if source.endswith("_rank"):
        found = result.rmse if source.startswith("rmse") else result.flip
        if not best and _tied(found, result.table["sampler"].iloc[row]):
            words += r"$^\dagger$"
    return rf"\textbf{{{words}}}" if best else words


def _tied(found: Ranking, sampler: str) -> bool:
    return found.tied[found.samplers.index(sampler)]
