"""What the commands of the command line do."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from experiments.catalogue import TABLE1, description, experiment_names, find_experiment
from experiments.cell import Budget, Cell, SamplerSpec
from experiments.datasets import (
    check_environments,
    find_environments,
    select,
    single_environment,
)
from experiments.parameters import parse_parameters
from experiments.runner import Outcome, missing_cells, run_cells, run_folder
from experiments.scale import SCALES, find_scale
from experiments.store import Store
from experiments.table1 import TEST_SCENES, Grid
from samplers import EnvironmentMap, EnvlightError, sampler_class, sampler_names
from samplers.threads import set_thread_count

INTERRUPTED = 130
MAP_HEIGHT = 512
"""Rows of embedded maps that are rendered or inspected one at a time."""
MOST_SUBPIXELS = 1 << 27
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
        _print_repair(name, count)
    folder = run_folder(request.output, request.experiment, request.scale)
    if dry_run:
        _print_plan(grid, len(cells), folder)
        return 0
    with Store.writing(folder) as store:
        return run_plan(store, cells, request.images)


def run_plan(store: Store, cells: list[Cell], images: bool = True) -> int:
    """Measure what is missing, write the report, and print both; returns the exit status."""
    from experiments.machine import record
    from experiments.progress import terminal_progress

    store.begin_session(record(), [cell.key for cell in cells])
    try:
        with terminal_progress() as progress:
            outcome = run_cells(store, cells, progress=progress, keep_images=images)
        return _report(store, cells, outcome, images)
    except KeyboardInterrupt:
        left = len(missing_cells(store, cells))
        print(
            f"envlight: interrupted; {len(cells) - left} of {len(cells)} cells are finished "
            f"and kept in {store.folder}; the same command goes on with the other {left}",
            file=sys.stderr,
        )
        raise SystemExit(INTERRUPTED) from None


def _print_repair(name: str, count: int) -> None:
    print(f"map '{name}': {count} values were NaN, infinite or negative and have been clamped")


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


def _report(store: Store, cells: list[Cell], outcome: Outcome, images: bool) -> int:
    from experiments.report.tables import print_summary
    from experiments.report.write import write_report

    for failure in outcome.failures[:FAILURES_PRINTED]:
        print(f"envlight: failed: {failure}", file=sys.stderr)
    if len(outcome.failures) > FAILURES_PRINTED:
        more = len(outcome.failures) - FAILURES_PRINTED
        print(f"envlight: {more} more cells failed", file=sys.stderr)
    if outcome.stored + outcome.measured == 0:
        return 1
    table, report = write_report(store, cells, images)
    print_summary(table, "table1")
    print(f"{outcome.measured} cells measured, {outcome.stored} were stored already", end="")
    print(f", {len(outcome.failures)} failed" if outcome.failures else "")
    print(f"report:    {report}")
    print(f"tables:    {store.folder / 'summary.csv'}, {store.folder / 'cells.csv'}")
    if images:
        print(f"pictures:  {store.folder / 'montages'}{os.sep}, {store.folder / 'images'}{os.sep}")
    return 1 if outcome.failures else 0


def show(folder: Path, why: str) -> None:
    """Print what a run folder holds, or what determines one of its cells."""
    import json

    from experiments.report.tables import print_summary
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
        plan = store.plan()
        rows = rows_of(store, plan)
        print(
            f"{folder}: {len(rows)} of {len(plan)} cells of the newest start are finished; "
            f"{len(everything) - len(rows)} cells of other plans; {len(store.sessions())} starts"
        )
        for (scale, scene), part in rows.groupby(["scale", "scene"]) if len(rows) else ():
            print(f"  {scale} · {scene}: {len(part)} cells, {part['environment'].nunique()} maps")
        if len(rows):
            print_summary(summary(rows), folder.name)


def _load(text: str, repair: bool) -> EnvironmentMap:
    """An embedded map by its name, or a file by its path."""
    environment = single_environment(text, MAP_HEIGHT, repair).load()
    if environment.repaired:
        _print_repair(environment.name, environment.repaired)
    return environment


def _check_output(output: Path) -> None:
    """EnvlightError where a picture could not be written, said before the work is done."""
    folder = output.parent
    if not output.name or output.is_dir():
        raise EnvlightError(f"--output {output}: it names a folder; give a file's name")
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise EnvlightError(f"--output {output}: {existing} cannot be written; give another place")


@dataclass(frozen=True)
class RenderRequest:
    """The options of `envlight render`."""

    environment: str
    scene: str
    sampler: str
    count: int
    parameters: list[str]
    width: int
    height: int
    subpixels: int
    seed: int
    repair: bool
    output: Path


def render(request: RenderRequest) -> None:
    """Render one image and write it as OpenEXR and PNG."""
    import numpy as np

    from experiments.report.preview import encoded
    from metrics.errors import exposure_scale
    from renderer import scenes
    from renderer.image import write_exr, write_png
    from renderer.reference import render_reference
    from renderer.render import render as render_image
    from renderer.view import make_view
    from samplers import make_sampler

    # Names may hold dots (a file called map_1.5 say), so suffixes are added, never replaced.
    _check_output(request.output)
    exr, png = (request.output.with_name(request.output.name + end) for end in (".exr", ".png"))
    if request.width * request.height * request.subpixels > MOST_SUBPIXELS:
        raise EnvlightError(
            f"{request.width}×{request.height} pixels with {request.subpixels} sub-pixels: use at "
            f"most {MOST_SUBPIXELS:,} sub-pixels in all"
        )
    parameters = parse_parameters(request.parameters)
    if request.sampler == "reference" and parameters:
        raise EnvlightError("the reference has no parameters; leave --set out")
    sampler = (
        None if request.sampler == "reference" else make_sampler(request.sampler, **parameters)
    )
    scene = scenes.make(request.scene)
    environment = _load(request.environment, request.repair)
    view = make_view(scene, request.width, request.height, request.subpixels)
    if sampler is None:
        reference = render_reference(view, environment, 0.01, 4096, request.seed)
        image, note = reference.image, f"noise floor {reference.noise_floor:.3g}"
    else:
        rng = np.random.default_rng(request.seed)
        lighting = sampler.prepare(environment, request.count, rng)
        rendering = render_image(view, lighting, environment, seed=request.seed)
        image, note = rendering.image, f"{rendering.rays.traced} rays, {rendering.seconds:.2f} s"
    write_exr(exr, image)
    write_png(png, encoded(image * exposure_scale(image, view.coverage > 0.0)))
    print(f"{scene.name} · {environment.name} · {request.sampler}: {note}")
    print(f"{exr}\n{png}")


def inspect_map(
    environment: str,
    sampler: str,
    count: int,
    parameters: list[str],
    seed: int,
    repair: bool,
    output: Path,
) -> None:
    """Print a map's statistics and draw its emissive region and lights."""
    import numpy as np

    from experiments.report.map_picture import draw_map, statistics
    from renderer.image import write_png
    from samplers import make_sampler

    _check_output(output)
    chosen = make_sampler(sampler, **parse_parameters(parameters))
    source = _load(environment, repair)
    for name, value in statistics(source).items():
        print(f"{name:28} {value}")
    lighting = chosen.prepare(source, count, np.random.default_rng(seed))
    write_png(output, draw_map(source, lighting))
    print(f"{output}")
