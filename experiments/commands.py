"""What `envlight list`, `run` and `show` do."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from experiments.catalogue import TABLE1, description, experiment_names, find_experiment
from experiments.cell import Budget, Cell, SamplerSpec
from experiments.datasets import (
    check_environments,
    find_environments,
    repair_sentence,
    select,
)
from experiments.runner import Outcome, missing_cells, run_cells, run_folder
from experiments.scale import SCALES, find_scale
from experiments.store import Store
from experiments.study import show_study
from experiments.table1 import TEST_SCENES, Grid
from samplers import EnvlightError, sampler_class, sampler_names
from samplers.threads import set_thread_count

INTERRUPTED = 130
FAILURES_PRINTED = 20


def list_names(kind: str) -> None:
    """Print the names of one kind, or of all."""
    from experiments import embedded
    from renderer import scenes

    kinds = {
        "samplers": [f"{name:24} {_headline(name)}" for name in sampler_names()],
        "scenes": scenes.names(),
        "environments": [f"{name:24} {embedded.kind(name)}" for name in embedded.names()],
        "scales": [
            f"{s.name:24} {s.width}×{s.height}, {s.subpixels} sub-pixels" for s in SCALES.values()
        ],
        "experiments": [f"{name:24} {description(name)}" for name in experiment_names()],
    }
    if kind not in ("all", *kinds):
        raise EnvlightError(f"nothing is called '{kind}'; list {', '.join(kinds)}, or all")
    for heading, names in kinds.items():
        if kind in ("all", heading):
            print(f"{heading}:")
            for name in names:
                print(f"  {name}")


def _headline(name: str) -> str:
    return (sampler_class(name).__doc__ or "").strip().splitlines()[0]


@dataclass(frozen=True)
class RunRequest:
    """The options of `envlight run`."""

    experiment: str
    scale: str
    environments: str
    maps: list[str]
    scenes: list[str]
    samplers: list[str]
    budgets: list[str]
    output: Path | None
    repair: bool
    images: bool
    threads: int
    as_json: bool = False

    def grid(self) -> Grid:
        """What is to be compared; EnvlightError for any name that does not exist."""
        from renderer import scenes

        scale = find_scale(self.scale)
        chosen = select(scenes.names(), self.scenes or list(TEST_SCENES), "scene")
        budgets = self.budgets or [str(count) for count in scale.budgets]
        grid = Grid(
            tuple(chosen),
            tuple(find_environments(self.environments, self.maps, scale.map_height, self.repair)),
            tuple(SamplerSpec(name) for name in select(sampler_names(), self.samplers, "sampler")),
            tuple(dict.fromkeys(Budget.parse(text) for text in budgets)),
            scale,
        )
        if not grid.cells():
            raise EnvlightError(f"nothing is left to run: {'; '.join(grid.left_out())}")
        return grid


def run(request: RunRequest, dry_run: bool) -> int:
    """Run an experiment; returns the exit status: 0, or 1 where some cells failed."""
    if request.threads:
        set_thread_count(request.threads)
    experiment = find_experiment(request.experiment)
    if request.experiment != TABLE1:
        status: int = experiment.run(request, dry_run)
        return status
    grid = request.grid()
    cells = grid.cells()
    for sentence in grid.left_out():
        print(f"envlight: {sentence}", file=sys.stderr)
    for name, count in check_environments(grid.environments).items():
        print(repair_sentence(name, count))
    folder = run_folder(request.output, request.experiment, request.scale)
    if dry_run:
        _print_plan(grid, len(cells), folder)
        return 0
    with Store.writing(folder) as store:
        return run_plan(store, cells, request.images, request.as_json)


def run_plan(store: Store, cells: list[Cell], images: bool = True, as_json: bool = False) -> int:
    """Measure what is missing, write the report, and print both; returns the exit status."""
    from experiments.machine import record
    from experiments.progress import terminal_progress

    store.begin_session(record(), [cell.key for cell in cells])
    try:
        with terminal_progress() as progress:
            outcome = run_cells(store, cells, progress=progress, keep_images=images)
        return _report(store, cells, outcome, images, as_json)
    except KeyboardInterrupt:
        left = len(missing_cells(store, cells))
        print(
            f"envlight: interrupted; {len(cells) - left} of {len(cells)} cells are finished "
            f"and kept in {store.folder}; the same command goes on with the other {left}",
            file=sys.stderr,
        )
        raise SystemExit(INTERRUPTED) from None


def _print_plan(grid: Grid, cells: int, folder: Path) -> None:
    print(
        f"{cells} cells: {len(grid.scenes)} scenes × {len(grid.environments)} maps × "
        f"{len(grid.samplers)} samplers × {len(grid.budgets)} budgets, up to {grid.seeds} seeds; "
        f"{len(grid.scenes) * len(grid.environments)} references"
    )
    print(f"scenes:    {', '.join(grid.scenes)}")
    print(f"maps:      {', '.join(source.name for source in grid.environments)}")
    print(f"samplers:  {', '.join(spec.label for spec in grid.samplers)}")
    print(f"budgets:   {', '.join(map(str, grid.budgets))}")
    print(f"folder:    {folder}")


def _report(store: Store, cells: list[Cell], outcome: Outcome, images: bool, as_json: bool) -> int:
    from experiments.report.tables import as_text, print_summary
    from experiments.report.write import write_report

    for failure in outcome.failures[:FAILURES_PRINTED]:
        print(f"envlight: failed: {failure}", file=sys.stderr)
    if len(outcome.failures) > FAILURES_PRINTED:
        more = len(outcome.failures) - FAILURES_PRINTED
        print(f"envlight: {more} more cells failed", file=sys.stderr)
    if outcome.stored + outcome.measured == 0:
        return 1
    table, report = write_report(store, cells, images)
    if as_json:
        facts = {
            "measured": outcome.measured,
            "stored": outcome.stored,
            "failed": outcome.failures,
            "report": str(report),
        }
        print(as_text(table, facts))
        return 1 if outcome.failures else 0
    print_summary(table, "table1")
    print(f"{outcome.measured} cells measured, {outcome.stored} were stored already", end="")
    print(f", {len(outcome.failures)} failed" if outcome.failures else "")
    print(f"report:    {report}")
    print(f"tables:    {store.folder / 'summary.csv'}, {store.folder / 'cells.csv'}")
    if images:
        print(f"pictures:  {store.folder / 'montages'}{os.sep}, {store.folder / 'images'}{os.sep}")
    return 1 if outcome.failures else 0


def show(folder: Path, why: str, as_json: bool = False) -> None:
    """Print what a run folder holds, or what determines one of its cells."""
    import json

    from experiments.report.tables import as_text, print_summary
    from experiments.report.write import rows_of
    from experiments.table1 import summary

    with Store.reading(folder) as store:
        everything = store.rows()
        if why:
            found = [identity for key, identity, _ in everything if key.startswith(why)]
            if len(found) != 1:
                raise EnvlightError(
                    f"{folder}: {len(found)} cells have a key that begins with '{why}'; take one "
                    "from cells.csv"
                )
            print(json.dumps(found[0], indent=2, ensure_ascii=False))
            return
        if any("experiment" in identity for _, identity, _ in everything):
            show_study(store)
            return
        plan = store.plan()
        rows = rows_of(store, plan)
        if as_json:
            counts = {"finished": len(rows), "planned": len(plan)}
            print(as_text(summary(rows) if len(rows) else rows, counts))
            return
        print(
            f"{folder}: {len(rows)} of {len(plan)} cells of the newest start are finished; "
            f"{len(everything) - len(rows)} cells of other plans; {len(store.sessions())} starts"
        )
        for (scale, scene), part in rows.groupby(["scale", "scene"]) if len(rows) else ():
            print(f"  {scale} · {scene}: {len(part)} cells, {part['environment'].nunique()} maps")
        if len(rows):
            print_summary(summary(rows), folder.name)
