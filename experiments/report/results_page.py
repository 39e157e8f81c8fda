"""The page of all published runs, `results/README.md`: every figure in it is made from their rows.

Of each folder it shows what was measured and by which commit, who is first and by how much, and the
paper's figures beside ours. Nothing is typed by hand, so that nothing outlives its rows: after a
folder is published anew, the page is made again.
"""

from collections.abc import Iterator
from pathlib import Path

from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.rankings import results_of
from experiments.report.sections.ranks import beside_paper
from experiments.report.sentences import doubt, verdict
from experiments.report.write import as_text
from experiments.run.experiment import Experiment, GridExperiment, find_experiment
from experiments.run.loaded_run import Run
from experiments.run.record import RECORD, write_text
from samplers import EnvlightError

PAGE = "README.md"
INTRODUCTION = """# Published results

Each folder here holds a run's rows (`measurements.csv.gz`), the record of machine, versions, commit
and command (`run.json`), and the report, tables and plots made from them. `envlight tabulate
results/NAME` makes those again in seconds, and `envlight results-page results` this page; `make
results` and `make published` measure anew. `envlight compare RUN results/NAME` says whether a run
of one's own agrees. A run tells of the methods as they were at its commit.

Scenes and maps are not those of the papers, whose figures stand beside ours for their order. Every
sentence with a figure in it is made from the rows by code. RMSE is corrected for the noise of the
references; what lies within three times of that noise is ranked as equal."""


def write_results_page(folder: Path) -> Path:
    """Write the page of the published runs in `folder`; returns it.

    Raises EnvlightError where the folder holds no published run.
    """
    page = folder / PAGE
    write_text(page, results_page(folder))
    return page


def results_page(folder: Path) -> str:
    """The page as Markdown."""
    places = sorted(place.parent for place in folder.glob(f"*/{RECORD}"))
    if not places:
        raise EnvlightError(f"{folder}: no published run is there; give the folder of all of them")
    parts = [part for place in places for part in _of_run(place)]
    return "\n\n".join([INTRODUCTION, *filter(None, (as_text(part) for part in parts))]) + "\n"


def _of_run(place: Path) -> Iterator[Part]:
    run = Run.load(place)
    experiment = find_experiment(run.record["experiment"])
    machine = run.record["machine"]
    yield Heading(place.name)
    yield Text(f"{experiment.title}. [Report]({place.name}/report.md).")
    yield Text(
        f"{_size(run)} Commit {machine['commit'] or 'unknown'}, {machine['processor']}, "
        f"{machine['threads']} threads."
    )
    yield from _findings(experiment, run)


def _size(run: Run) -> str:
    rows, record = run.rows, run.record
    if "planned" not in record:
        return f"{len(rows)} rows."
    scale = record["scale"]
    return (
        f"{len(rows)} of {record['planned']} measurements, {rows['environment'].nunique()} maps, "
        f"scenes {', '.join(sorted(rows['scene'].unique()))}, {scale['width']}×{scale['height']} "
        f"pixels with {scale['subpixels']} sub-pixels."
    )


def _findings(experiment: Experiment, run: Run) -> Iterator[Part]:
    """Who is first at each budget, and the paper's figures beside ours."""
    if not isinstance(experiment, GridExperiment):
        return
    for result in results_of(run):
        sentences = [
            f"{result.budget}: {' '.join(filter(None, [verdict(ranking), doubt(ranking)]))}"
            for ranking in result.rankings
        ]
        yield Items(tuple(sentences))
        if experiment.published is not None:
            parts = list(beside_paper(result, experiment.published))
            yield from (part for part in parts if isinstance(part, Table | Text))
