"""The one writer of reports: `report.md`, with its tables as CSV and LaTeX, and its plots.

A report opens with what was measured and closes with how far the times can be trusted and on which
machine it was; between stand the parts of the experiment's sections.
"""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import pandas as pd

from experiments.report.figures import save_plot
from experiments.report.frame import closing, opening
from experiments.report.parts import Heading, Items, Part, Picture, Plot, Table, Text
from experiments.report.tables import as_latex, as_markdown
from experiments.run.experiment import Experiment
from experiments.run.loaded_run import Run
from experiments.run.record import write_csv, write_text

REPORT = "report.md"
NEEDS = "% Needs \\usepackage{booktabs}.\n"


def write_report(experiment: Experiment, run: Run) -> list[Path]:
    """Write the report of a run into its folder, from rows and record alone; returns the files.

    What images are needed for is drawn where they are, and left as it is where not. The report
    comes first.
    """
    parts = [*opening(experiment, run), *sections(experiment, run), *closing(run)]
    report = run.folder / REPORT
    write_text(report, "\n\n".join(filter(None, (_markdown(part, run) for part in parts))) + "\n")
    return [report, *write_tables(parts, run.folder)]


def sections(experiment: Experiment, run: Run) -> list[Part]:
    """The parts of an experiment's sections."""
    return [part for section in experiment.sections for part in section(run)]


def tables_of(parts: Iterable[Part]) -> list[Table]:
    """The tables among the parts."""
    return [part for part in parts if isinstance(part, Table)]


def as_text(part: Part) -> str:
    """A part that draws nothing, as Markdown; nothing for one that does."""
    match part:
        case Heading(text, level):
            return f"{'#' * level} {text}"
        case Text(text):
            return text
        case Items(sentences):
            return "\n".join(f"- {sentence}" for sentence in sentences)
        case Table(shown=True):
            return f"{as_markdown(part)}\n\n{part.caption}".strip()
    return ""


def _markdown(part: Part, run: Run) -> str:
    """A part as Markdown; what it draws is drawn."""
    match part:
        case Plot(stem, draw, caption):
            save_plot(run.folder, stem, draw)
            return _image(f"{stem}.svg", caption)
        case Picture(file, caption, draw):
            place = run.folder / file
            if draw is not None:
                place.parent.mkdir(parents=True, exist_ok=True)
                draw(place)
            return _image(file, caption) if place.is_file() else ""
    return as_text(part)


def _image(file: str, caption: str) -> str:
    return f"![{caption}]({file})" + (f"\n\n*{caption}*" if caption else "")


def write_tables(parts: Iterable[Part], folder: Path) -> list[Path]:
    """Write the tables among the parts, those of one stem together; returns the files."""
    files = []
    by_stem = sorted(tables_of(parts), key=lambda table: table.stem)
    for stem, members in groupby(by_stem, key=lambda table: table.stem):
        group = list(members)
        frame = pd.concat([table.rows for table in group], ignore_index=True)
        write_csv(folder / f"{stem}.csv", frame)
        write_text(folder / f"{stem}.tex", NEEDS + "\n".join(map(as_latex, group)))
        files += [folder / f"{stem}.csv", folder / f"{stem}.tex"]
    return files
