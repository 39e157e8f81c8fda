"""Tables and plots made again from a run's rows, a run reduced to what is worth publishing, and
the page of all published runs, in which every figure is made from their rows.

A published folder holds the rows (`measurements.csv.gz`), the record (`run.json`), tables and plots
(as SVG alone), and one small picture. `tabulate` makes tables and plots from rows and record alone,
in seconds, and by the same code as the run did: the same bytes.
"""

import gzip
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from experiments.report.across_runs import across_runs, figures_of_papers, link_to
from experiments.report.compare import GRID
from experiments.report.pages.cases import publish_compared
from experiments.report.parts import Heading, Items, Part, counted, listed
from experiments.report.rankings import results_of, verdict
from experiments.report.suite import title_of, together, whole_of
from experiments.report.write import as_text, write_report
from experiments.run.experiment import Experiment, GridExperiment, findings_of
from experiments.run.loaded_run import (
    PACKED_ROWS,
    RECORD,
    REPORT_FILES,
    ROWS,
    Run,
    add_to_record,
    listed_files,
    read_record,
    write_text,
)
from experiments.run.outputs import Kind, check_apart, check_output, renewed_folder
from experiments.run.registry import find_experiment, room_of
from experiments.run.store import PLAN, is_run_folder
from renderer.image import write_whole
from samplers import EnvlightError

SUFFIXES = (".md", ".csv", ".tex", ".svg", ".png", ".webp", ".json", ".gz")
HEAVY = ("references", "images", "montages", "pictures", "report")
"""Folders of a run that are not published."""
COPIED_FILES = "published_files"
"""What the record of a published folder calls the list of its files."""
PAGE = "README.md"
FIGURES = "Tables and figures of the papers"
PAPERS, QUESTIONS = "The papers' tables under other conditions", "Questions that no paper asks"
TITLE = "# Published results"
INTRODUCTION = f"""{TITLE}

A folder here holds a run's rows (`measurements.csv.gz`), the record of machine, versions, commit
and command (`run.json`), and the report, tables and plots made from them; or several such folders.
Further runs of one experiment lie inside its folder, with one report. `envlight tabulate
results/NAME` makes those again in seconds, and `envlight results-page results` this page; `envlight
published` measures anew what `suite.toml` lists. `envlight compare RUN results/NAME` says whether a
run of one's own agrees. A run tells of the methods as they were at its commit.

Scenes and maps are not those of the papers, whose figures stand here for their order. Every
sentence with a figure in it is made from the rows by code. RMSE is corrected for the noise of the
references; what lies within three times of that noise is ranked as equal."""


def tabulate(folder: Path) -> list[Path]:
    """Write the report of the run in `folder`, or of the one around it, anew; returns the files.

    Raises EnvlightError where the folder holds no rows, or its experiment is unknown.
    """
    run = Run.load(folder)
    if (whole := whole_of(run)) != run.folder:
        run = Run.load(whole)
    return write_report(find_experiment(run.record["experiment"]), run)


def publish(
    run: Path, target: Path, compare: Sequence[str] = (), force: bool = False
) -> list[Path]:
    """Copy what of a run is worth keeping into `target`; returns the files there.

    compare : patterns of cases or maps whose images are published to be compared; they are all that
        is large, so choose a few

    force : replace what has rows that the run does not have, or is of another experiment, too

    An earlier publication in `target` is replaced at once, but for files that it does not list as
    its own; another folder that holds something is refused. Inside the folder of a run of the same
    experiment rows and record are enough: the report of that one tells them.
    """
    found = Run.load(run)
    _check_target(run, target)
    check_no_loss(found, target, force)
    whole = whole_of(replace(found, folder=target))
    with renewed_folder(target, own_files(target)) as place:
        _copy(run, place, rows_alone=whole != target)
        if compare:
            publish_compared(run, place, compare)
        names = [file.relative_to(place).as_posix() for file in light_files(place)]
        facts = {COPIED_FILES: names}
        if REPORT_FILES in found.record:
            of_report = listed_files(found.record, REPORT_FILES)
            facts = {REPORT_FILES: [name for name in of_report if name in names]} | facts
        add_to_record(place, facts)
    if any(whole.glob(f"*/{RECORD}")):
        tabulate(whole)
    return [target / name for name in names]


def _check_target(run: Path, target: Path) -> None:
    """EnvlightError for a folder that is no place for a publication."""
    check_apart(target, [run])
    if run.resolve() in target.resolve().parents:
        raise EnvlightError(f"{target}: it is inside the run; publish it to another folder")
    if is_run_folder(target):
        raise EnvlightError(f"{target}: a run works there; publish to another folder")
    if target.is_dir() and any(target.iterdir()) and not (target / RECORD).is_file():
        raise EnvlightError(
            f"{target}: it holds something, but no {RECORD}, so it is no earlier publication; "
            "give another folder"
        )


def check_no_loss(run: Run, target: Path, force: bool) -> None:
    """EnvlightError where rows that stand in a folder are not in the run that is to replace it.

    Those of a grid are told apart by their keys, those of a study counted.
    """
    if force or not (target / RECORD).is_file():
        return
    try:
        old = Run.load(target)
    except EnvlightError as error:
        raise EnvlightError(f"{error}; --force replaces it") from None
    names = [one.record.get("experiment") for one in (old, run)]
    if names[0] != names[1]:
        raise EnvlightError(
            f"{target}: it holds a run of {names[0]}, and this one is of {names[1]}; give another "
            "folder, or --force"
        )
    lost = len(old.rows) - len(run.rows)
    if all(set(GRID) <= set(one.rows) for one in (old, run)):
        keys = [pd.MultiIndex.from_frame(one.rows[GRID]) for one in (old, run)]
        lost = len(keys[0].difference(keys[1]))
    if lost > 0:
        raise EnvlightError(
            f"{target}: {lost} of the {len(old.rows)} rows there are not in this run, which has "
            f"{len(run.rows)}; give another folder, or --force"
        )


def own_files(folder: Path) -> set[str]:
    """The files of a published folder that go with it: those that always are, and those listed."""
    record = read_record(folder)
    listed = (listed_files(record, key) for key in (REPORT_FILES, COPIED_FILES))
    return {RECORD, ROWS, PACKED_ROWS}.union(*listed)


def _copy(run: Path, target: Path, rows_alone: bool) -> None:
    """Copy what is published of a run as it is, or rows and record alone; rows are packed."""
    for file in [file for file in light_files(run) if file.suffix in SUFFIXES]:
        if rows_alone and file.name not in (ROWS, PACKED_ROWS, RECORD):
            continue
        place = target / file.relative_to(run)
        place.parent.mkdir(parents=True, exist_ok=True)
        if file == run / ROWS:
            _pack(file, target / PACKED_ROWS)
        elif not is_drawn_again(file):
            shutil.copyfile(file, place)


def _pack(file: Path, target: Path) -> None:
    """Compress a file, without a time in it, so that the same content gives the same bytes."""
    packed = gzip.compress(file.read_bytes(), mtime=0)
    write_whole(target, lambda place: place.write_bytes(packed))


def is_drawn_again(file: Path) -> bool:
    """Whether a file is a plot that is there as SVG, too."""
    return file.suffix in (".png", ".pdf") and file.with_suffix(".svg").is_file()


def light_files(folder: Path) -> list[Path]:
    """All visible files outside of the heavy folders, rows and record first."""
    files = (file for file in folder.rglob("*") if file.is_file())
    inside = ((file, file.relative_to(folder).parts) for file in files)
    chosen = [
        file
        for file, parts in inside
        if parts[0] not in (*HEAVY, PLAN) and not any(part.startswith(".") for part in parts)
    ]
    return sorted(chosen, key=lambda file: (file.name not in (ROWS, PACKED_ROWS, RECORD), file))


def published_runs(folder: Path) -> list[Run]:
    """All published runs in a folder and in folders there, by name; EnvlightError without any."""
    files = [*folder.glob(f"*/{RECORD}"), *folder.glob(f"*/*/{RECORD}")]
    if not files:
        raise EnvlightError(f"{folder}: no published run is there; give the folder of all of them")
    runs = [Run.load(file.parent) for file in sorted(files, key=lambda file: file.parent.name)]
    return [run for run in runs if whole_of(run) == run.folder]


def write_results_page(folder: Path) -> Path:
    """Write the page of the published runs in `folder`; returns it.

    Raises EnvlightError where the folder holds no published run.
    """
    page = folder / PAGE
    check_output(page, Kind("a page of published results", (TITLE.encode(),)), "the page")
    write_text(page, results_page(folder))
    return page


def results_page(folder: Path) -> str:
    """The page as Markdown."""
    runs = published_runs(folder)
    figures = tuple(figures_of_papers(runs, folder))
    parts = [*across_runs(runs), Heading(FIGURES), Items(figures)]
    texts = map(as_text, [*parts, *_folders(runs, folder, figures)])
    return "\n\n".join([INTRODUCTION, *filter(None, texts)]) + "\n"


def methods_of(run: Run) -> str:
    """The digest of the methods; of a run that has none, its commit stands for it."""
    return str(run.record["machine"].get("methods", listed(list(run.commits))))


def _folders(runs: Sequence[Run], folder: Path, told: Sequence[str]) -> Iterator[Part]:
    """A line for each published run: what it is, where, how much, and what it found first.

    told : lines that speak of some of them already
    """
    rooms: dict[str, list[str]] = {PAPERS: [], QUESTIONS: []}
    for run in runs:
        name, link = run.record["experiment"], link_to(run, folder)
        experiment = find_experiment(name)
        heading = QUESTIONS if room_of(name) == "questions" else PAPERS
        is_told = any(link in line for line in told)
        for one in together(run)[1:] if is_told else together(run):
            title = title_of(one.folder, experiment.title)
            found = " ".join(_first_finding(experiment, one).split())
            rooms[heading].append(f"**{title}** ({link}, {_size(one)}): {found}")
    for heading, lines in rooms.items():
        if lines:
            yield Heading(heading)
            yield Items(tuple(lines))


def _first_finding(experiment: Experiment, run: Run) -> str:
    """The experiment's first; or who is first by the leading metric at its middle budget."""
    if found := findings_of(experiment, run):
        return found[0]
    results = results_of(run) if isinstance(experiment, GridExperiment) else []
    if not results:
        return "see its report."
    result = results[len(results) // 2]
    return f"{result.budget}: {verdict(result.rankings[0])}"


def _size(run: Run) -> str:
    """How much was measured, in a few words."""
    if "planned" not in run.record:
        return counted(len(run.rows), "row")
    maps = counted(run.rows["environment"].nunique(), "map")
    return f"{maps}, {run.image_size}, {listed(list(run.commits), most=1)}"
