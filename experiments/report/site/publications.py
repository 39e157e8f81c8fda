"""The published runs that a site is made of, and what all its pages ask of them."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pandas as pd

from experiments.maps.classes import classes_of
from experiments.report.publish import published_runs
from experiments.report.rankings import BudgetResult, results
from experiments.report.style import Look, looks
from experiments.report.suite import title_of
from experiments.report.summary import leagues_of
from experiments.run.experiment import Experiment, GridExperiment, find_experiment, room_of
from experiments.run.loaded_run import Run

MOST_SAMPLERS = 40
"""A run of more configurations than these asks something else than which sampler is best."""

LEAST_SAMPLERS = 3
"""With fewer, a run compares variants of a sampler."""

ENOUGH_PIXELS = 640 * 480
"""Of smaller images an order can be another: upsampling's error falls with their size, and FLIP
filters by pixels."""


@dataclass(frozen=True, eq=False)
class Publication:
    """A published run with the experiment that it is of."""

    run: Run
    experiment: Experiment

    @property
    def name(self) -> str:
        """The name of its folder, by which pages and anchors go."""
        return self.run.folder.name

    @property
    def title(self) -> str:
        """What the folder is."""
        return title_of(self.run.folder, self.experiment.title)

    @property
    def room(self) -> str:
        """The room of its experiment: a paper's, or that of the questions."""
        return room_of(self.experiment.name)

    @property
    def on_maps(self) -> bool:
        """Whether its rows are of maps."""
        return "environment" in self.run.rows

    @property
    def ranks(self) -> bool:
        """Whether its rows rank samplers."""
        return (
            isinstance(self.experiment, GridExperiment)
            and 2 <= self.run.rows["sampler"].nunique() <= MOST_SAMPLERS
        )

    @property
    def plain_samplers(self) -> int:
        """How many samplers it has as they are; variants do not count."""
        names = self.run.rows["sampler"].unique() if self.ranks else ()
        return sum("[" not in str(name) for name in names)

    @property
    def compares(self) -> bool:
        """Whether several samplers as they are rank against each other, not variants of one."""
        return self.plain_samplers >= LEAST_SAMPLERS

    @property
    def coverage(self) -> int:
        """Samplers as they are, times maps."""
        return self.plain_samplers * len(self.classes) if self.ranks else 0

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """What the experiment itself finds in the rows, in sentences; nothing where it does not."""
        told = self.experiment.findings
        return tuple(told(self.run)) if told else ()

    @cached_property
    def results(self) -> list[BudgetResult]:
        """What is said about every budget; of a run that ranks samplers."""
        return results(self.run.rows)

    def at(self, budget: str) -> BudgetResult:
        """What is said about one budget."""
        return next(result for result in self.results if result.budget == budget)

    @cached_property
    def classes(self) -> dict[str, str]:
        """The classes of its maps."""
        return classes_of(self.run.rows)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the images of a grid."""
        scale = self.run.record["scale"]
        return scale["width"], scale["height"]

    @property
    def pixels(self) -> int:
        """Of an image of a grid, as far as more of them tell more."""
        width, height = self.size
        return min(width * height, ENOUGH_PIXELS)


def publications(folder: Path) -> list[Publication]:
    """All published runs in a folder, by name; EnvlightError where there is none."""
    return [
        Publication(run, find_experiment(run.record["experiment"]))
        for run in published_runs(folder)
    ]


def ranking_runs(found: Iterable[Publication]) -> list[Publication]:
    """Those that rank samplers: large images first, of these the most samplers on the most maps."""
    ranked = [one for one in found if one.ranks]
    return sorted(
        ranked, key=lambda one: (-one.pixels, -one.coverage, -len(one.run.rows), one.name)
    )


def all_leagues(found: Iterable[Publication]) -> dict[str, str]:
    """The league of every sampler that any row tells, for runs whose own rows do not."""
    known: dict[str, str] = {}
    for one in found:
        if "sampler" in one.run.rows:
            known |= leagues_of(one.run.rows)
    return known


def all_looks(found: Iterable[Publication]) -> dict[str, Look]:
    """Looks of all samplers of the runs that rank them, the same on every page."""
    ranked = [one for one in found if one.ranks]
    labels = sorted({str(name) for one in ranked for name in one.run.rows["sampler"].unique()})
    return looks(labels, all_leagues(ranked))


def of_class(rows: pd.DataFrame, classes: dict[str, str], name: str) -> pd.DataFrame:
    """The rows on maps of one class."""
    return rows[rows["environment"].map(classes) == name]
