"""Experiments over a grid of measurements: scene × map × sampler × budget × seed.

Such an experiment is a module with a constant and a function:

    EXPERIMENT = GridExperiment("name", "Title", scenes, samplers, budgets, report)

    def run(request, dry_run):
        return run_grid(EXPERIMENT, request, dry_run)

Everything else is shared: options, measurements, the store and going on after a stop, references,
progress. The defaults are what runs without --scenes, --samplers and --budget. `report` gets a
`GridRun`, which is read back from `measurements.csv` and `run.json` of a folder, so that the
tables of a run and those made later from its published rows are the same. It may use the images
of the run where they are (`image` and `reference` give None where not). Its first file is the one
to read.

References and measurements that another run folder beside this one holds already are taken from
there, images by a link. Keys say which belong together, and every folder is complete in itself.
"""

import os
import sys
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.maps.sources import (
    check_environments,
    find_environments,
)
from experiments.run.bench import load_average
from experiments.run.executors import make_executor
from experiments.run.grid import Grid
from experiments.run.measurement import Budget, Measurement, SamplerSpec
from experiments.run.record import read_run, write_run
from experiments.run.runner import Outcome, missing_measurements, run_folder, run_measurements
from experiments.run.sampler_choice import choose_samplers
from experiments.run.scale import Scale, find_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.store import Store
from samplers import EnvlightError, sampler_names

if TYPE_CHECKING:
    from experiments.cli.commands import RunRequest

INTERRUPTED = 130
FAILURES_PRINTED = 20


@dataclass(frozen=True, eq=False)
class GridRun:
    """A run as its rows and record tell it.

    folder : where tables and plots go
    rows : one per finished measurement of the newest start, in a fixed order, with its `key` and
        the key `reference` of its case
    record : `experiment`; `scale` with name, width, height and subpixels; `samplers` and `budgets`
        in display order; `planned` measurements; `missing` cases by sampler; `machine`, the
        record of the start
    """

    folder: Path
    rows: pd.DataFrame
    record: dict[str, Any]

    @classmethod
    def load(cls, folder: Path) -> "GridRun":
        """The run that a folder holds; EnvlightError where it holds none."""
        return cls(folder, *read_run(folder))

    @property
    def samplers(self) -> list[str]:
        return self.record["samplers"]

    @property
    def budgets(self) -> list[str]:
        return self.record["budgets"]

    def image(self, row: pd.Series) -> Path | None:
        """The image of a row, linear, in OpenEXR, where it is kept (seed 0 alone)."""
        place = self.folder / "images" / row["scene"] / row["environment"]
        return next(place.glob(f"*_{row['key'][:8]}.exr"), None) if place.is_dir() else None

    def reference(self, row: pd.Series) -> Path | None:
        """The reference image of a row's case, where it is there."""
        path = self.folder / "references" / f"{row['reference']}.exr"
        return path if path.is_file() else None


@dataclass(frozen=True)
class GridExperiment:
    """An experiment.

    name : as in the catalogue
    title : heading of its report
    scenes, samplers, budgets : what runs by default, samplers and budgets in display order
    report : writes tables and plots into the run's folder; returns the files, the report first
    """

    name: str
    title: str
    scenes: tuple[str, ...]
    samplers: Callable[[], tuple[SamplerSpec, ...]]
    budgets: Callable[[Scale], tuple[Budget, ...]]
    report: Callable[[GridRun], list[Path]]

    def grid(self, request: "RunRequest") -> Grid:
        """What is to be compared; EnvlightError for any name that does not exist."""
        scale = find_scale(request.scale)
        grid = Grid(
            choose_scenes(request.scenes or list(self.scenes)),
            tuple(
                find_environments(
                    request.environments, request.maps, scale.map_height, request.repair
                )
            ),
            self._samplers(request.samplers),
            tuple(dict.fromkeys(map(Budget.parse, request.budgets))) or self.budgets(scale),
            scale,
        )
        if not grid.measurements():
            raise EnvlightError(f"nothing is left to run: {'; '.join(grid.left_out())}")
        return grid

    def _samplers(self, patterns: list[str]) -> tuple[SamplerSpec, ...]:
        """The experiment's own; those asked for also from the registry and from files."""
        own = self.samplers()
        return choose_samplers(patterns, own) if patterns else own


def all_samplers() -> tuple[SamplerSpec, ...]:
    """Every registered sampler with the paper's parameters."""
    return tuple(SamplerSpec(name) for name in sampler_names())


def scale_budgets(scale: Scale) -> tuple[Budget, ...]:
    """The numbers of lights that a scale compares."""
    return tuple(Budget(count) for count in scale.budgets)


def run_grid(experiment: GridExperiment, request: "RunRequest", dry_run: bool) -> int:
    """Run a grid experiment; returns the exit status: 0, or 1 where some measurements failed."""
    grid = experiment.grid(request)
    for sentence in grid.left_out():
        print(f"envlight: {sentence}", file=sys.stderr)
    for sentence in check_environments(grid.environments, strict=True).sentences():
        print(sentence)
    folder = run_folder(request.output, experiment.name, request.scale)
    if dry_run:
        from experiments.run import estimate

        _print_plan(experiment.name, grid, folder)
        print(f"estimate:  {estimate.estimate(grid)}")
        return 0
    with (
        Store.writing(folder) as store,
        make_executor(
            request.executor, request.workers, request.threads, request.cluster
        ) as executor,
    ):
        return run_plan(
            experiment,
            store,
            grid.measurements(),
            request.images,
            request.as_json,
            folder.parent,
            executor,
        )


def run_plan(
    experiment: GridExperiment,
    store: Store,
    measurements: list[Measurement],
    images: bool = True,
    as_json: bool = False,
    beside: Path | None = None,
    executor: Executor | None = None,
) -> int:
    """Measure what is missing, write the report, and print both; returns the exit status.

    beside : a folder of run folders whose references and measurements may be taken
    """
    from experiments.run.machine import record
    from experiments.run.progress import terminal_progress

    store.begin_session(record(), [measurement.key for measurement in measurements])
    try:
        with terminal_progress() as progress:
            outcome = run_measurements(store, measurements, executor, progress, images, beside)
        return _report(experiment, store, measurements, outcome, images, as_json)
    except KeyboardInterrupt:
        left = len(missing_measurements(store, measurements))
        print(
            f"envlight: interrupted; {len(measurements) - left} of {len(measurements)} "
            "measurements are finished "
            f"and kept in {store.folder}; the same command goes on with the other {left}",
            file=sys.stderr,
        )
        raise SystemExit(INTERRUPTED) from None


def write_results(
    experiment: GridExperiment, store: Store, measurements: list[Measurement], images: bool = True
) -> list[Path]:
    """Write rows, record, report and, where `images`, montages; returns the report's files."""
    from experiments.report.tables import rows_of

    rows = rows_of(store, [measurement.key for measurement in measurements])
    write_run(store.folder, rows, _facts(experiment, store, measurements, rows))
    if images:
        from experiments.report.montage import write_montages

        write_montages(store.folder, measurements, rows)
    return experiment.report(GridRun.load(store.folder))


def _facts(
    experiment: GridExperiment, store: Store, measurements: list[Measurement], rows: pd.DataFrame
) -> dict[str, Any]:
    there, scale = set(rows["key"]), measurements[0].case.scale
    missing: dict[str, list[str]] = {}
    for measurement in measurements:
        if measurement.key not in there:
            cases = missing.setdefault(measurement.sampler.label, [])
            if str(measurement.case) not in cases:
                cases.append(str(measurement.case))
    return {
        "experiment": experiment.name,
        "scale": {
            "name": scale.name, "width": scale.width, "height": scale.height,
            "subpixels": scale.subpixels,
        },
        "samplers": list(dict.fromkeys(measurement.sampler.label for measurement in measurements)),
        "budgets": list(dict.fromkeys(str(measurement.budget) for measurement in measurements)),
        "planned": len(measurements),
        "missing": missing,
        "machine": {**store.sessions()[-1], "load_average_end": load_average()},
    }  # fmt: skip


def _report(
    experiment: GridExperiment,
    store: Store,
    measurements: list[Measurement],
    outcome: Outcome,
    images: bool,
    as_json: bool,
) -> int:
    from experiments.report.tables import as_text, print_summary
    from experiments.run.summary import summary

    for failure in outcome.failures[:FAILURES_PRINTED]:
        print(f"envlight: failed: {failure}", file=sys.stderr)
    if len(outcome.failures) > FAILURES_PRINTED:
        more = len(outcome.failures) - FAILURES_PRINTED
        print(f"envlight: {more} more measurements failed", file=sys.stderr)
    if outcome.stored + outcome.measured == 0:
        return 1
    report, *tables = write_results(experiment, store, measurements, images)
    table = summary(GridRun.load(store.folder).rows)
    if as_json:
        facts = {
            "measured": outcome.measured,
            "stored": outcome.stored,
            "failed": outcome.failures,
            "report": str(report),
        }
        print(as_text(table, facts))
        return 1 if outcome.failures else 0
    print_summary(table, experiment.name)
    print(f"{outcome.measured} measurements measured, {outcome.stored} were stored already", end="")
    print(f", {len(outcome.failures)} failed" if outcome.failures else "")
    print(f"report:    {report}")
    print(f"tables:    {', '.join(map(str, [*tables, store.folder / 'measurements.csv']))}")
    if images:
        print(f"pictures:  {store.folder / 'montages'}{os.sep}, {store.folder / 'images'}{os.sep}")
    return 1 if outcome.failures else 0


def _print_plan(name: str, grid: Grid, folder: Path) -> None:
    print(f"{name}: {len(grid.measurements())} measurements:", end=" ")
    print(
        f"{len(grid.scenes)} scenes × {len(grid.environments)} maps × "
        f"{len(grid.samplers)} samplers × {len(grid.budgets)} budgets, up to {grid.seeds} seeds; "
        f"{len(grid.scenes) * len(grid.environments)} references"
    )
    print(f"scenes:    {', '.join(name_and_file(scene)[0] for scene in grid.scenes)}")
    print(f"maps:      {', '.join(source.name for source in grid.environments)}")
    print(f"samplers:  {', '.join(spec.label for spec in grid.samplers)}")
    print(f"budgets:   {', '.join(map(str, grid.budgets))}")
    print(f"folder:    {folder}")
