"""The one writer of reports: `report.md`, with its tables as CSV and LaTeX, and its plots.

A report opens with what was found, what was measured and what is missing, and closes with how far
the times can be trusted and on which machine it was; between stand the parts of the experiment's
sections.
"""

import re
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from experiments.report import figures
from experiments.report.parts import (
    Heading,
    Items,
    Part,
    Picture,
    Plot,
    Table,
    Text,
    counted,
    listed,
)
from experiments.report.sections.ranks import lead
from experiments.report.style import label_of
from experiments.report.suite import title_of, together
from experiments.report.summary import MOST_RANKED, compared, machine_sentence
from experiments.report.tables import as_latex, as_markdown, markdown_text
from experiments.run.bench import load_sentence, noise_sentence, time_used_sentence
from experiments.run.budget import sorted_budgets
from experiments.run.experiment import Experiment, GridExperiment, findings_of
from experiments.run.loaded_run import (
    PACKED_ROWS,
    RECORD,
    REPORT,
    REPORT_FILES,
    ROWS,
    Run,
    add_to_record,
    listed_files,
    read_record,
    write_csv,
    write_text,
)
from experiments.run.outputs import remove_listed

NOT_IN_LINK = re.compile(r"[\s()<>\\`%]")
NEEDS = "% Needs \\usepackage{booktabs}.\n"
KEPT_ALWAYS = (ROWS, PACKED_ROWS, RECORD)
LOADS = ("load_average", "load_average_end")
MOST_NAMED = 20
"""More cases than these are counted, not named."""


def write_report(experiment: Experiment, run: Run) -> list[Path]:
    """Write the report of a run into its folder, from rows and record alone; returns report and
    tables.

    What images are needed for is drawn where they are, and left as it is where not. The record
    lists the files before any is written, so that a report that was cut short is written over;
    those of an earlier report that are not of this one are removed. A file of the same name that
    the record does not list is somebody's: it stays, which is told.
    """
    parts = [*opening(experiment, run), *sections(experiment, run), *closing(run)]
    for one in together(run)[1:]:
        title = title_of(one.folder, one.folder.name)
        parts += [Heading(title), Text(size_sentence(one)), *_gaps(one), *closing(one)]
    suffixes = figures.KEPT if run.packed else figures.SUFFIXES
    others = _files_of_others(run)
    names = dict.fromkeys([REPORT, *(name for part in parts for name in _files(part, suffixes))])
    for name in names.keys() & others:
        place = run.folder / name
        print(f"envlight: {place} was not made here: it stays as it is", file=sys.stderr)
    mine = [name for name in names if name not in others]
    recorded = read_record(run.folder)  # a damaged one is as none
    listed = listed_files(recorded, REPORT_FILES)
    if recorded:
        add_to_record(run.folder, {REPORT_FILES: list(dict.fromkeys([*listed, *mine]))})
    texts = filter(None, [_markdown(part, run, suffixes, others) for part in parts])
    write_text(run.folder / REPORT, "\n\n".join(texts) + "\n")
    files = [run.folder / REPORT, *write_tables(parts, run.folder, others)]
    tables = [file.relative_to(run.folder).as_posix() for file in files]
    made = [name for name in dict.fromkeys([*tables, *mine]) if (run.folder / name).is_file()]
    remove_listed(run.folder, set(listed) - {*made, *KEPT_ALWAYS})
    if recorded:
        add_to_record(run.folder, {REPORT_FILES: made})
    return files


def _files_of_others(run: Run) -> set[str]:
    """The files of a run's folder that its record does not list; none where it lists none though a
    report is there, or where all was published.
    """
    record = read_record(run.folder)
    if run.packed or (REPORT_FILES not in record and (run.folder / REPORT).is_file()):
        return set()
    there = (file for file in run.folder.rglob("*") if file.is_file())
    names = {file.relative_to(run.folder).as_posix() for file in there}
    return names - {REPORT, *listed_files(record, REPORT_FILES)}


def _files(part: Part, suffixes: Sequence[str]) -> list[str]:
    """The files of a part, relative to the run's folder. suffixes : of plots"""
    match part:
        case Plot(stem):
            return [f"{stem}.{suffix}" for suffix in suffixes]
        case Picture(file):
            return [file]
        case Table(stem, shown=shown):
            return [f"{stem}.csv", f"{stem}.tex"][: 1 + shown]
    return []


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
            return f"{'#' * level} {markdown_text(text)}"
        case Text(text):
            return markdown_text(text)
        case Items(sentences):
            return "\n".join(f"- {markdown_text(sentence)}" for sentence in sentences)
        case Table(shown=True):
            return f"{as_markdown(part)}\n\n{markdown_text(part.caption)}".strip()
    return ""


def _markdown(part: Part, run: Run, suffixes: Sequence[str], others: Collection[str]) -> str:
    """A part as Markdown; what it draws is drawn."""
    mine = not set(_files(part, suffixes)) & set(others)
    match part:
        case Plot(stem, draw, caption):
            if mine:
                figures.save_plot(run.folder, stem, draw, suffixes)
            return _image(f"{stem}.svg", caption)
        case Picture(file, caption, draw):
            place = run.folder / file
            if draw is not None and mine:
                place.parent.mkdir(parents=True, exist_ok=True)
                draw(place)
            return _image(file, caption) if place.is_file() else ""
    return as_text(part)


def _image(file: str, caption: str) -> str:
    told, place = markdown_text(caption), NOT_IN_LINK.sub(lambda found: quote(found[0]), file)
    return f"![{told}]({place})" + (f"\n\n*{told}*" if told else "")


def write_tables(parts: Iterable[Part], folder: Path, others: Collection[str] = ()) -> list[Path]:
    """Write the tables among the parts, those of one stem together; returns the files.

    Those that the report leaves out are data for other programs, and not set in LaTeX.

    others : files that are not to be written
    """
    files = []
    by_stem = sorted(tables_of(parts), key=lambda table: table.stem)
    for stem, members in groupby(by_stem, key=lambda table: table.stem):
        group = list(members)
        frame = pd.concat([table.rows for table in group], ignore_index=True)
        if f"{stem}.csv" not in others:
            write_csv(folder / f"{stem}.csv", frame)
            files.append(folder / f"{stem}.csv")
        shown = [table for table in group if table.shown]
        if shown and f"{stem}.tex" not in others:
            write_text(folder / f"{stem}.tex", NEEDS + "\n".join(map(as_latex, shown)))
            files.append(folder / f"{stem}.tex")
    return files


def opening(experiment: Experiment, run: Run) -> Iterator[Part]:
    """The heading, what the experiment finds first, what was measured and what is missing."""
    rows, record = run.rows, run.record
    if "planned" not in record:
        yield Heading(experiment.title, 1)
        yield from map(Text, findings_of(experiment, run)[:1])
        yield Text(f"{experiment.summary} {size_sentence(run)}")
        return
    whole = "" if len(rows) == record["planned"] else " (incomplete)"
    scale = "" if together(run)[1:] else f" at scale {record['scale']['name']}"
    yield Heading(f"{experiment.title}{scale}{whole}", 1)
    yield from map(Text, () if whole else findings_of(experiment, run)[:1])
    answers = isinstance(experiment, GridExperiment) and experiment.opening is not None
    if not answers and 1 < rows["sampler"].nunique() <= MOST_RANKED:
        yield from lead(run)
    yield Text(size_sentence(run))
    yield from _gaps(run)


def size_sentence(run: Run) -> str:
    """How much was measured, and at which size of image."""
    rows, record = run.rows, run.record
    if "planned" not in record:
        return f"{counted(len(rows), 'row')}."
    return (
        f"{len(rows)} of {record['planned']} measurements, "
        f"{counted(rows['environment'].nunique(), 'map')}, "
        f"scenes {', '.join(sorted(rows['scene'].unique()))}, {run.image_size} "
        f"pixels with {counted(record['scale']['subpixels'], 'sub-pixel')}."
    )


def closing(run: Run) -> Iterator[Part]:
    """Repaired maps, how far times can be trusted, and the machine."""
    machine, rows = run.record["machine"], run.rows
    yield from map(Text, _repairs(run))
    if "planned" in run.record:
        yield from map(Text, filter(None, [machine_sentence(rows), *_times(run)]))
    yield Text(
        f"{listed(run.processors)}, {counted(machine['cores'], 'core')}, "
        f"{counted(machine['threads'], 'thread')}; Python {machine['python']}, {_made_by(run)}"
    )


def _made_by(run: Run) -> str:
    """Commit and command; of joined runs how many rows each commit has."""
    if len(run.parts) == 1:
        return f"commit {next(iter(run.commits))}; `{run.parts[0]['command']}`."
    told = [f"{counted(rows, 'row')}: commit {one}; " for one, rows in run.commits.items()]
    return f"{''.join(told)}`run.json` has their commands."


def _times(run: Run) -> list[str]:
    """How near budgets of seconds were met, and how far times can be trusted."""
    rows, machine, lines = run.rows, run.record["machine"], []
    timed = run.timed
    budgets = sorted_budgets(list(rows.loc[timed, "budget"].unique()))
    lines += [time_used_sentence(run.at(budget)) for budget in budgets]
    if timed.any():
        lines.append(f"Of measurements with budgets of seconds: {noise_sentence(rows[timed])}")
    if not timed.all():
        loads = [machine[name] for name in LOADS if name in machine]
        lines.append(load_sentence(loads, machine["cores"]))
    return lines


def _gaps(run: Run) -> Iterator[Part]:
    """Which maps and measurements have no result, and what that means for the tables."""
    bad = run.record.get("bad_maps", {})
    if bad:
        yield Text("Maps that could not be read are left out:")
        yield Items(tuple(f"{name}: {reason}" for name, reason in bad.items()))
    gaps: dict[str, list[str]] = run.record.get("missing", {})
    if not gaps:
        return
    yield Text("Results are missing:")
    lines = []
    for sampler, cases in gaps.items():
        more = f" and {len(cases) - MOST_NAMED} more" if len(cases) > MOST_NAMED else ""
        lines.append(f"{label_of(sampler)}: {', '.join(cases[:MOST_NAMED])}{more}")
    yield Items(tuple(lines))
    used = sum(len(compared(part)) for _, part in run.rows.groupby("budget"))
    yield Text(
        "Ranks, and the errors beside them, are over those cases alone on which every sampler that "
        f"has a result anywhere has all of them; {len(run.rows) - used} finished measurements are "
        "therefore left out there."
    )


def _repairs(run: Run) -> list[str]:
    """Which maps had values repaired, and what that did to their flux where it is recorded."""
    rows, told = run.rows, run.record.get("repairs", {})
    if "repaired" in rows:  # those of a grid tell it themselves
        repaired = rows[rows["repaired"] > 0].groupby("environment")["repaired"].first()
        told = {name: told.get(name, f"{count} values") for name, count in repaired.items()}
    items = [f"{name} ({what})" for name, what in told.items()]
    if not items:
        return []
    return [f"Values of NaN, infinity or below 0 were repaired in: {'; '.join(items)}."]
