"""What a report is made of. Sections give these; `write` alone turns them into files.

    def means(run: Run) -> Iterator[Part]:
        table = run.rows.groupby("sampler", as_index=False)["flip"].mean()
        yield Heading("Means")
        yield Table("means", table, {"sampler": "s", "flip": ".4f"})
        yield Plot("flip", lambda: bar_plot(table), "Mean FLIP.")

A sentence that states a figure is made from the rows, by a function that a test holds to them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from metrics.registry import Better

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Heading:
    """A heading; the report's title is of level 1."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Text:
    """A paragraph, in Markdown."""

    text: str


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    sentences: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Table:
    """A table: all digits as CSV, those worth reading in Markdown, LaTeX and on the terminal.

    stem : name of its files. Tables of one stem go into the same files, one after another.
    rows : the values
    formats : how the columns that are printed are printed, in their order; as for `format`
    headings : what columns are called, where not by their name with spaces for underscores
    best : columns of which the best value is bold in LaTeX: which that is, or by row whether it is
    caption : in Markdown below the table, in LaTeX above it
    shown : whether it stands in the report; else only its CSV is written
    """

    stem: str
    rows: pd.DataFrame
    formats: Mapping[str, str]
    headings: Mapping[str, str] = field(default_factory=dict)
    best: Mapping[str, Better | Sequence[bool]] = field(default_factory=dict)
    caption: str = ""
    shown: bool = True


@dataclass(frozen=True, eq=False)
class Plot:
    """A figure, as SVG in the report and also as PDF and PNG. draw : under the report's style"""

    stem: str
    draw: Callable[[], "Figure"]
    caption: str = ""


@dataclass(frozen=True, eq=False)
class Picture:
    """A raster picture.

    file : its place below the run's folder
    draw : writes it to a path; None, or where it cannot be drawn any more because the run's images
        are gone, what is there already is shown, and nothing where there is nothing
    """

    file: str
    caption: str = ""
    draw: Callable[[Path], None] | None = None


Part = Heading | Text | Items | Table | Plot | Picture

MOST_NAMED = 4


def listed(names: Sequence[str], most: int = MOST_NAMED) -> str:
    """Names in words, the first `most` of more."""
    more = len(names) - most
    if more > 0:
        return f"{', '.join(names[:most])} and {more} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def counted(count: int, noun: str) -> str:
    """How many, with the noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
