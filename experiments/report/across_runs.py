"""What published runs say together: do papers' tables come out, and on which maps and sizes?"""

from collections.abc import Iterator, Sequence

from experiments.report.agreement import elsewhere
from experiments.report.parts import Part
from experiments.report.reproduced import reproduced
from experiments.run.experiment import GridExperiment
from experiments.run.loaded_run import Run
from experiments.run.registry import find_experiment


def openings(runs: Sequence[Run]) -> Iterator[Part]:
    """What experiments want said first, each of its run with the largest images."""
    largest: dict[str, Run] = {}
    for run in sorted(runs, key=lambda run: run.record.get("scale", {}).get("width", 0)):
        largest[run.record["experiment"]] = run
    for name, run in sorted(largest.items()):
        found = find_experiment(name)
        if isinstance(found, GridExperiment) and found.opening is not None:
            yield from found.opening(run)


def across_runs(runs: Sequence[Run]) -> Iterator[Part]:
    """Sentences and tables under headings of their own."""
    yield from openings(runs)
    yield from reproduced(runs)
    yield from elsewhere(runs)
