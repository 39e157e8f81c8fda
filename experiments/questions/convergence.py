"""Run time against error: every sampler over numbers of lights, and whom to choose in which time.

Error against lights, rays and seconds, log–log, by class of maps; fitted slopes with intervals;
Pareto fronts by scene and class; the time to reach a FLIP; and a table of the best sampler in a
given time, by class, with the time to generate lights and without. No paper has these figures. The
times are those of the machine that the report names: on a busy one compare rays instead.

A map's class is its kind (sun, overcast, interior, …); maps whose kind is unknown are classed by
contrast. Scale quick uses two of the four scenes and one embedded map of every kind, chosen by
kind alone; --maps '*' takes all.
"""

import csv
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.maps.classes import map_class, named_class
from experiments.run.budget import Budget
from experiments.run.defaults import QUICK, with_quick_maps, with_quick_scenes
from experiments.run.grid_experiment import GridExperiment, Run, all_samplers, run_grid
from experiments.run.request import RunRequest
from experiments.run.scale import Scale
from experiments.wu2025.table1 import TEST_SCENES

NAME = "convergence"
TITLE = "Run time against error"
QUICK_LIGHTS = (4, 8, 16, 32, 64, 128)
LIGHTS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
CLASSES = "classes.csv"
OTHER = "other"
SLOPE_FORMATS = {
    "sampler": "s", "error": "s", "cost": "s", "slope": ".2f", "low": ".2f", "high": ".2f",
    "points": "d",
}  # fmt: skip


def light_budgets(scale: Scale) -> tuple[Budget, ...]:
    """Powers of two."""
    return tuple(Budget(count) for count in (QUICK_LIGHTS if scale.name == QUICK else LIGHTS))


def report(run: Run, classes: dict[str, str] | None = None) -> list[Path]:
    """The report, its tables as CSV, and the plots.

    classes : of maps by name; by default those that the folder keeps, else by the maps' names
    """
    import matplotlib as mpl

    from experiments.questions import convergence_tables as tables
    from experiments.report.convergence_plots import convergence_plot
    from experiments.report.figures import STYLE, save_figure
    from experiments.report.frames import rounded, table
    from experiments.report.palette import looks
    from experiments.report.rankings import NAMES
    from experiments.report.write import closing, opening
    from experiments.run.record import write_csv, write_text

    known = classes if classes is not None else kept_classes(run.folder)
    _keep_classes(run, known)
    of_map = {name: known.get(name) or named_class(name) or OTHER
              for name in run.rows["environment"].unique()}  # fmt: skip
    rows = run.rows.assign(**{"class": run.rows["environment"].map(of_map)})
    points = tables.convergence_points(rows)
    by_scene = tables.convergence_points(rows, by_scene=True)
    fitted, chosen = tables.slopes(points), tables.choices(points)
    reached = tables.times_to_reach(points)
    written = {
        "points": by_scene, "slopes": fitted, "fronts": tables.fronts(by_scene),
        "times_to_reach": reached, "choices": chosen,
    }  # fmt: skip
    for name, frame in written.items():
        write_csv(run.folder / f"{name}.csv", frame)
    styles = looks(run.samplers)
    lines = opening(run, TITLE)
    for time, meaning in tables.TIMES.items():
        for error in ("flip", "rmse"):
            lines += [
                f"## Which sampler, by {NAMES[error]}, {meaning}", "",
                *(f"- {sentence}" for sentence in tables.advice(chosen, time, error)), "",
                table(tables.choice_table(chosen, time, error), "pipe"), "",
            ]  # fmt: skip
    lines += [
        "Each entry is the sampler of least mean error among all that were measured within the "
        "time of the column; * marks errors within 3× of the noise of their references, whose "
        "order is not certain.",
        "",
        f"## Milliseconds to reach a FLIP, {tables.ALL}",
        "",
        "Lights generated in that time:",
        "",
        table(tables.reach_table(reached, tables.ALL, "seconds"), "pipe"),
        "",
        "Lights made before:",
        "",
        table(tables.reach_table(reached, tables.ALL, "seconds_render"), "pipe"),
        "",
        f"## Slopes, {tables.ALL}",
        "",
        table(rounded(_shown_slopes(fitted, tables.ALL), SLOPE_FORMATS), "pipe"),
        "",
        "Exponents of cost with 95 % intervals, from points that are not within 3× of the noise "
        "of their references; –0.5 is that of independent samples. A dash: fewer than three such "
        "points.",
        "",
    ]
    with mpl.rc_context(STYLE):
        for error in ("flip", "rmse"):
            for cost in tables.COSTS:
                figure = convergence_plot(points, error, cost, styles, cost in tables.TIMES)
                name = save_figure(run.folder, f"{error}_{cost}", figure)
                lines += [f"![{NAMES[error]} against {tables.COSTS[cost]}]({name}.svg)", ""]
            for scene in by_scene["scene"].unique():
                part = by_scene[by_scene["scene"] == scene]
                stem = f"pareto_{error}_{Path(scene).stem}"
                figure = convergence_plot(part, error, "seconds", styles, True)
                name = save_figure(run.folder, stem, figure)
                lines += [f"![{NAMES[error]} against seconds, {Path(scene).stem}]({name}.svg)", ""]
    lines += ["Hollow points are within 3× of the noise of their references.", "", *closing(run)]
    path = run.folder / "report.md"
    write_text(path, "\n".join(lines))
    return [path, *(run.folder / f"{name}.csv" for name in written)]


def _shown_slopes(fitted: pd.DataFrame, group: str) -> pd.DataFrame:
    part = fitted[(fitted["class"] == group) & fitted["cost"].isin(["rays", "seconds_render"])]
    return part.sort_values(["error", "cost", "slope"], kind="stable")


def kept_classes(folder: Path) -> dict[str, str]:
    """The classes of the maps that a run's folder keeps, empty where it keeps none."""
    path = folder / CLASSES
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        return {line["environment"]: line["class"] for line in csv.DictReader(file)}


def _keep_classes(run: Run, classes: dict[str, str]) -> None:
    from experiments.run.record import write_csv

    if classes:
        frame = pd.DataFrame({"environment": list(classes), "class": list(classes.values())})
        write_csv(run.folder / CLASSES, frame)


EXPERIMENT = GridExperiment(NAME, TITLE, TEST_SCENES, all_samplers, light_budgets, report)


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    request = with_quick_maps(with_quick_scenes(request), 1)
    if dry_run:
        return run_grid(EXPERIMENT, request, dry_run)
    sources = EXPERIMENT.grid(request).environments
    classes = {source.name: map_class(source) for source in sources}
    return run_grid(replace(EXPERIMENT, report=partial(report, classes=classes)), request, dry_run)
