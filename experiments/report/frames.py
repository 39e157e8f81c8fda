"""Any table as CSV with all digits, and as Markdown, LaTeX and text with those worth reading."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from tabulate import tabulate

from experiments.run.record import write_csv, write_text

LATEX = {"–": "--", "×": r"$\times$", "·": r"$\cdot$"}


def rounded(rows: pd.DataFrame, formats: Mapping[str, str]) -> pd.DataFrame:
    """The columns of `formats`, in their order, as text; missing values become dashes."""
    present = [column for column in formats if column in rows]
    return pd.DataFrame(
        {
            column: [
                "–" if pd.isna(value) else format(value, formats[column]) for value in rows[column]
            ]
            for column in present
        }
    )


def table(text: pd.DataFrame, style: str) -> str:
    """The table in one of tabulate's styles, digits as they are."""
    heads = [str(column).replace("_", " ") for column in text.columns]
    cells = text.to_numpy().tolist()
    numeric = [column.str.match(r"^[-–\d.,e+×:]+$").all() for _, column in text.items()]
    align = ["right" if is_number else "left" for is_number in numeric]
    return tabulate(cells, headers=heads, tablefmt=style, disable_numparse=True, colalign=align)


def write_frame(
    folder: Path, stem: str, rows: pd.DataFrame, text: pd.DataFrame, title: str, notes: list[str]
) -> list[Path]:
    """Write `rows` as CSV, and `text` as Markdown, with its title and notes, and as LaTeX."""
    latex = table(text, "latex_booktabs")
    for sign, command in LATEX.items():
        latex = latex.replace(sign, command)
    contents = {
        ".md": "\n\n".join([f"# {title}", table(text, "pipe"), *notes]) + "\n",
        ".tex": "% Needs \\usepackage{booktabs}.\n" + latex + "\n",
    }
    write_csv(folder / f"{stem}.csv", rows)
    for suffix, content in contents.items():
        write_text(folder / f"{stem}{suffix}", content)
    return [folder / f"{stem}{suffix}" for suffix in (".csv", *contents)]


def present(
    folder: Path, stem: str, rows: pd.DataFrame, formats: Mapping[str, str], title: str,
    notes: list[str],
) -> list[Path]:  # fmt: skip
    """Print a table and write it in all formats; returns the files."""
    text = rounded(rows, formats)
    print("\n".join([title, "", table(text, "simple"), "", *notes]))
    return write_frame(folder, stem, rows, text, title, notes)
