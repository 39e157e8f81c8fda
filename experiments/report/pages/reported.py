"""The runs that pages are made of, and what all pages ask of them."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from experiments.maps.classes import classes_of
from experiments.report.publish import published_runs
from experiments.report.rankings import BudgetResult, results
from experiments.report.style import Looks, looks
from experiments.report.suite import title_of
from experiments.report.summary import MOST_RANKED, leagues_of
from experiments.run.budget import Budget, sorted_budgets
from experiments.run.experiment import Experiment, GridExperiment, findings_of
from experiments.run.grid import gaps, in_fixed_order
from experiments.run.loaded_run import Run, read_record
from experiments.run.registry import find_experiment
from experiments.run.runner import rows_of, starts_of
from experiments.run.store import Store, StoreError, is_run_folder

LEAST_SAMPLERS = 3
"""With fewer, a run compares variants of a sampler."""

ENOUGH_PIXELS = 640 * 480
"""Of smaller images an order can be another: upsampling's error falls with their size, and FLIP
filters by pixels."""


@dataclass(eq=False)
class Reported:
    """A run with the experiment that it is of."""

    run: Run
    experiment: Experiment

    @property
    def name(self) -> str:
        """The name of its folder, by which pages and anchors go."""
        return self.run.folder.resolve().name

    @property
    def title(self) -> str:
        """What the folder is."""
        return title_of(self.run.folder, self.experiment.title)

    @property
    def is_grid(self) -> bool:
        return isinstance(self.experiment, GridExperiment)

    @property
    def ranks(self) -> bool:
        """Whether its rows rank samplers."""
        return self.is_grid and 2 <= self.run.rows["sampler"].nunique() <= MOST_RANKED

    @property
    def compares(self) -> bool:
        """Whether several samplers as they are rank against each other, not variants of one."""
        return sum("[" not in name for name in self.run.samplers) >= LEAST_SAMPLERS

    @property
    def timed_budgets(self) -> list[str]:
        """Its budgets of seconds, the shortest first."""
        budgets = sorted_budgets(list(self.run.rows["budget"].unique()))
        return [budget for budget in budgets if Budget.parse(budget).timed]

    @property
    def incomplete(self) -> str:
        """How many measurements are missing, in a sentence; empty where none is."""
        rows, planned = len(self.run.rows), self.run.record.get("planned", 0)
        if rows >= planned:
            return ""
        return (
            f"Incomplete: {rows} of {planned} measurements are finished. Every figure here can "
            "still change."
        )

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """What the experiment itself finds in the rows, in sentences; nothing where it does not."""
        return findings_of(self.experiment, self.run)

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
    def pixels(self) -> int:
        """Of an image of a grid, as far as more of them tell more."""
        width, height = self.run.size
        return min(width * height, ENOUGH_PIXELS)


def published(folder: Path) -> list[Reported]:
    """All published runs in a folder, by name; EnvlightError where there is none."""
    return [
        Reported(run, find_experiment(run.record["experiment"])) for run in published_runs(folder)
    ]


def at_hand(folder: Path) -> Reported:
    """The run of a folder; of a grid that has its store, as far as it is measured by now.

    Raises EnvlightError where it holds no finished measurement.
    """
    record = read_record(folder)
    if (record and not is_run_folder(folder)) or "request" in record:
        run = Run.load(folder)
        return Reported(run, find_experiment(run.record["experiment"]))
    with Store.reading(folder) as store:
        rows = in_fixed_order(rows_of(store))
        if rows.empty:
            raise StoreError(
                f"{folder}: no measurement of its newest start is finished; let the run go on first"
            )
        if not len(store.plan) == len(rows) == record.get("planned"):
            name, scale = store.selection.about
            (first,) = store.find(rows["key"].iloc[:1]).values()
            width, height, subpixels = store.shared(first.identity["case"])["view"]
            size = {"width": width, "height": height, "subpixels": subpixels}
            record = {
                "experiment": name,
                "scale": {"name": scale, **size},
                "samplers": list(map(str, rows["sampler"].unique())),
                "budgets": sorted_budgets(list(map(str, rows["budget"].unique()))),
                "planned": len(store.plan),
                "missing": gaps(rows),
                **starts_of(store, rows),
            }
    run = Run(folder, rows, record)
    return Reported(run, find_experiment(record["experiment"]))


def ranking_runs(found: Iterable[Reported]) -> list[Reported]:
    """Those that rank samplers: of large images at equal time first, then by maps, then by rows."""

    def order(one: Reported) -> tuple[int, bool, int, int, str]:
        rows, late = one.run.rows, not (one.compares and one.timed_budgets)
        return -one.pixels, late, -rows["environment"].nunique(), -len(rows), one.name

    return sorted((one for one in found if one.ranks), key=order)


def all_leagues(found: Iterable[Reported]) -> dict[str, str]:
    """The league of every sampler that any row tells, for runs whose own rows do not."""
    known: dict[str, str] = {}
    for one in found:
        if "sampler" in one.run.rows:
            known |= leagues_of(one.run.rows)
    return known


def all_looks(found: Iterable[Reported]) -> Looks:
    """Looks of all samplers of the grids, the same on every page."""
    grids = [one for one in found if one.is_grid]
    labels = sorted({str(name) for one in grids for name in one.run.rows["sampler"].unique()})
    return looks(labels, all_leagues(grids))
