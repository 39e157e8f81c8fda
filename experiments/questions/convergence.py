"""Run time against error: every sampler over numbers of lights, and whom to choose in which time.

Error against lights, rays and seconds, log–log, by class of maps; fitted slopes with intervals;
Pareto fronts by scene and class; the time to reach an error; and a table of the best sampler in a
given time, by class, with the time to generate lights and without. No paper has these figures. The
times are those of the machine that the report names: on a busy one compare rays instead.

A map's class is its kind (sun, overcast, interior, …), found by its name; other maps are classed by
contrast. Scale quick uses two of the four scenes and one embedded map of every kind, chosen by kind
alone; --maps '*' takes all.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from experiments.maps.classes import classes_of
from experiments.questions.advice.measured import LEAGUES
from experiments.questions.convergence_tables import (
    ALL,
    COSTS,
    MEASURE,
    TIMES,
    advice,
    answers,
    choice_table,
    choices,
    convergence_points,
    fronts,
    metrics_of,
    reach_table,
    slopes,
    targets,
    times_to_reach,
    timing_sentence,
)
from experiments.report.figures import over_time_plot
from experiments.report.parts import Heading, Items, Part, Plot, Table, Text
from experiments.report.sentences import counted, listed
from experiments.report.style import Looks, looks
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.loaded_run import Run
from experiments.run.scale import QUICK, Scale, references_to
from metrics.registry import NEAR, Metric, find_metric, leading_metric

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUICK_LIGHTS = (4, 8, 16, 32, 64, 128)
LIGHTS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
REFERENCE_NOISE = {QUICK: 0.0005, "medium": 0.001, "standard": 0.002}
"""Of the mean luminance, by scale; the time for one grows with the pixels."""
SLOPE_COSTS = ("rays", "seconds_render")
SLOPE_FORMATS = {
    "sampler": "s", "metric": "s", "cost": "s", "slope": ".2f", "low": ".2f", "high": ".2f",
    "points": "d",
}  # fmt: skip
FRONT_FORMATS = {
    "class": "s", "scene": "s", "metric": "s", "sampler": "s", "budget": "s", "seconds": ".3f",
    "value": ".4f",
}  # fmt: skip


@experiment("convergence")
def convergence() -> GridExperiment:
    """Run time against error, and which sampler to choose in which time."""
    return GridExperiment(
        title="Run time against error",
        opening=answer,
        sections=(whom_to_choose, time_to_reach, fitted_slopes, curves, scene_fronts),
        budgets=light_budgets,
        scale=references_to(REFERENCE_NOISE),
        quick_scenes=2,
        quick_maps=1,
    )


def light_budgets(scale: Scale) -> tuple[Budget, ...]:
    """Powers of two."""
    return tuple(Budget(count) for count in (QUICK_LIGHTS if scale.name == QUICK else LIGHTS))


def classed(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with the class of their maps: by name, or else by contrast."""
    return rows.assign(**{"class": rows["environment"].map(classes_of(rows))})


def answer(run: Run) -> Iterator[Part]:
    """Which sampler has the least error in which time, for an engine and for a path tracer."""
    rows = classed(run.rows)
    fixed = rows.loc[rows["league"].isin(LEAGUES["fixed"] or ()), "sampler"]
    found = answers(convergence_points(rows), set(fixed))
    if found.empty:
        return
    yield Heading("Which sampler, in which time?")
    yield Table("answers", found, dict.fromkeys(map(str, found), "s"))
    yield Text(
        f"Mean error over {counted(rows['environment'].nunique(), 'map')} and "
        f"{counted(rows['scene'].nunique(), 'scene')} at {run.image_size}, "
        f"{listed(run.processors)}, of the best sampler in the time, which is to make its lights "
        f"and the image; in brackets as a multiple of that of {MEASURE}."
    )


def whom_to_choose(run: Run) -> Iterator[Part]:
    """The best sampler in a given time, by class of maps."""
    rows = classed(run.rows)
    points = convergence_points(rows)
    chosen = choices(points)
    for time, meaning in TIMES.items():
        for metric in metrics_of(points):
            wide = choice_table(chosen, time, metric.name)
            yield Heading(f"Which sampler, by {metric.label}, {meaning}")
            yield Items(tuple(advice(chosen, time, metric.name)))
            shown = wide.assign(time=time, metric=metric.name)
            yield Table("best_in_time", shown, dict.fromkeys(map(str, wide), "s"))
    yield Text(
        "Each entry is the sampler of least mean error among all that were measured within the "
        f"time of the column. Where several have one within {NEAR:g}× of what the references' own "
        "noise gives, order is not certain: they share the place, and the entry says how many they "
        "are."
    )
    yield from map(Text, filter(None, [timing_sentence(rows)]))
    yield Table("choices", chosen, dict.fromkeys(map(str, chosen), ""), shown=False)


def time_to_reach(run: Run) -> Iterator[Part]:
    """Milliseconds until an error is reached, over all maps."""
    points, metric = convergence_points(classed(run.rows)), leading_metric()
    wanted = targets(points)
    if not wanted:
        return
    reached = times_to_reach(points, wanted)
    yield Heading(f"Milliseconds to reach a mean {metric.label}, {ALL}")
    for time, meaning in TIMES.items():
        wide = reach_table(reached, ALL, time)
        yield Text(f"{meaning[0].upper()}{meaning[1:]}:")
        yield Table("reached", wide.assign(time=time), dict.fromkeys(map(str, wide), "s"))
    yield Text(
        f"A column per {metric.label}; none is within {NEAR:g}× of the references' noise. Between "
        "measured points logarithms are interpolated; a dash: no measured point is that good."
    )
    yield Table("times_to_reach", reached, dict.fromkeys(map(str, reached), ""), shown=False)


def fitted_slopes(run: Run) -> Iterator[Part]:
    """Exponents of cost."""
    fitted = slopes(convergence_points(classed(run.rows)))
    part = fitted[(fitted["class"] == ALL) & fitted["cost"].isin(SLOPE_COSTS)]
    part = part.sort_values(["metric", "cost", "slope"], kind="stable")
    part = part.assign(metric=[find_metric(name).label for name in part["metric"]])
    yield Heading(f"Slopes, {ALL}")
    yield Table("slopes_all_maps", part, SLOPE_FORMATS)
    yield Text(
        f"Exponents of cost with 95 % intervals, from points that are not within {NEAR:g}× of the "
        "noise of their references; –0.5 is that of independent samples. A dash: fewer than three "
        "such points."
    )
    yield Table("slopes", fitted, {"class": "s", **SLOPE_FORMATS}, shown=False)


def curves(run: Run) -> Iterator[Part]:
    """Error against every cost, a panel per class."""
    points, styles = convergence_points(classed(run.rows)), looks(run.samplers)
    yield Heading("Error against cost")
    yield Text(
        "Over the least error that any sampler has at the same cost; those on the Pareto front "
        f"have a colour. Hollow points are within {NEAR:g}× of the noise of their references."
    )
    for metric in metrics_of(points):
        for cost, meaning in COSTS.items():
            draw = partial(convergence_plot, points, metric, cost, styles)
            yield Plot(f"{metric.name}_{cost}", draw, f"{metric.label} against {meaning}")


def scene_fronts(run: Run) -> Iterator[Part]:
    """Error against seconds with the Pareto front, scene by scene."""
    points = convergence_points(classed(run.rows), by_scene=True)
    styles = looks(run.samplers)
    yield Heading("Pareto fronts by scene")
    for metric in metrics_of(points):
        for scene, part in points.groupby("scene", sort=False):
            name = Path(str(scene)).stem
            draw = partial(convergence_plot, part, metric, "seconds", styles)
            yield Plot(f"pareto_{metric.name}_{name}", draw, f"{metric.label}, {name}")
    yield Table("points", points, dict.fromkeys(map(str, points), ""), shown=False)
    yield Table("fronts", fronts(points), FRONT_FORMATS, shown=False)


def convergence_plot(points: pd.DataFrame, metric: Metric, cost: str, looks: Looks) -> "Figure":
    """The metric over `cost` of the points: all maps large, and a small panel per class."""
    told = points.assign(
        seconds=points[cost], error=points[metric.name], near=points[metric.near_column]
    )
    panels = {str(name): part for name, part in told.groupby("class", sort=False)}
    return over_time_plot(panels, metric, looks, COSTS[cost])
