"""Run time against error: every sampler over numbers of lights, and whom to choose in which time.

Error against lights, rays and seconds, log–log, by class of maps; fitted slopes with intervals;
Pareto fronts by scene and class; and a table of the best sampler in a given time, by class, with
the time to generate lights and without. No paper has these figures. The times are those of the
machine that the report names: on a busy one compare rays instead.

A map's class is its kind (sun, overcast, interior, …), found by its name; other maps are classed by
contrast. Scale quick uses two of the four scenes and one embedded map of every kind, chosen by kind
alone; --maps '*' takes all.

A point is one sampler at one budget on the maps of one class. No slope is fitted through one within
3× of the noise floor, and no order told among such. Seconds are of one kind of machine in a class.
"""

import math
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from experiments.maps.classes import classes_of
from experiments.questions.advice.measured import LEAGUES
from experiments.report.figures import over_time_plot
from experiments.report.parts import Heading, Part, Plot, Table, Text, counted, listed
from experiments.report.style import Looks, label_of, looks
from experiments.report.summary import MACHINE, errors_in, timed_alike
from experiments.run.experiment import GridExperiment, budgets_of, experiment
from experiments.run.loaded_run import Run
from experiments.run.scale import QUICK, references_to
from metrics.ranking import CONFIDENCE
from metrics.registry import NEAR, Metric, find_metric

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIGHTS = {QUICK: (4, 8, 16, 32, 64, 128), "medium": (1, 2, 4, 8, 16, 32, 64, 128, 256)}
REFERENCE_NOISE = {QUICK: 0.0005, "medium": 0.001, "standard": 0.002}
"""Of the mean luminance, by scale; the time for one grows with the pixels."""
ALL = "all maps"
COSTS = {
    "lights": "lights or samples per shading point",
    "rays": "shadow and BRDF rays per sub-pixel",
    "seconds_render": "seconds to render",
    "seconds": "seconds to generate lights and render",
}
TIMES = {"seconds": "lights generated in that time", "seconds_render": "lights made before"}
"""The costs that are times, and what each means to somebody who has that much."""
SLOPE_COSTS = ("rays", "seconds_render")
SLOPE_FORMATS = {
    "sampler": "s", "metric": "s", "cost": "s", "slope": ".2f", "low": ".2f", "high": ".2f",
    "points": "d",
}  # fmt: skip
STEPS = (1.0, 2.0, 5.0)
LEAST_POINTS = 3
NOBODY = "–"
SHORTEST, LONGEST = 0.05, 10.0
"""Seconds that somebody might have for an image: of the shortest answer and of the longest."""
MEASURE = "median-cut"
"""Whose error the others' are told as a multiple of."""
ENGINE, PATH_TRACER = "fixed lights, for an engine", "anything, for a path tracer"


@experiment("convergence")
def convergence() -> GridExperiment:
    """Run time against error, and which sampler to choose in which time."""
    return GridExperiment(
        title="Run time against error",
        opening=answer,
        sections=(whom_to_choose, fitted_slopes, curves, scene_fronts),
        budgets=budgets_of(LIGHTS),
        scale=references_to(REFERENCE_NOISE),
        quick_scenes=2,
        quick_maps=1,
    )


def classed(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with the class of their maps: by name, or else by contrast."""
    return rows.assign(**{"class": rows["environment"].map(classes_of(rows))})


def metrics_of(rows: pd.DataFrame) -> list[Metric]:
    """The ranked metrics that rows or points hold, the leading one first."""
    return sorted(map(find_metric, errors_in(rows)), key=lambda metric: not metric.leads)


def convergence_points(rows: pd.DataFrame, by_scene: bool = False) -> pd.DataFrame:
    """One line per class (and scene), sampler and budget: mean errors, floors and costs.

    The class `ALL` holds all maps. `maps` counts those of the errors, `maps_timed` those of the
    seconds, which are NaN where there is none.
    """
    found = metrics_of(rows)
    floors = [metric.floor_column for metric in found if metric.floor_column in rows]
    costs = rows.assign(
        rays=(rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"],
        seconds=rows["seconds_lights"] + rows["seconds_render"],
    ).reset_index(drop=True)
    classes = [part for _, part in costs.groupby("class", sort=False)]
    both = pd.concat(
        [_with_times_alike(part) for part in (costs.assign(**{"class": ALL}), *classes)],
        ignore_index=True,
    )
    place = ["class", *(["scene"] if by_scene else []), "sampler", "budget"]
    values = [*(metric.name for metric in found), *floors, *COSTS]
    per_map = both.groupby([*place, "environment"], sort=False)[values].mean()
    groups = per_map.groupby(level=place, sort=False)
    timed = groups["seconds"].count()
    points = groups.mean().assign(maps=groups.size(), maps_timed=timed).reset_index()
    for metric in found:
        points[metric.near_column] = points[metric.name] < NEAR * points.get(
            metric.floor_column, 0.0
        )
    return points


def _with_times_alike(costs: pd.DataFrame) -> pd.DataFrame:
    """The rows of a class; times that are not of its kind of machine are NaN."""
    alike = costs.index.isin(timed_alike(costs).index)
    return costs.assign(**{time: costs[time].where(alike) for time in TIMES})


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
        f"{counted(rows['scene'].nunique(), 'scene')} at {run.image_size}, on "
        f"{listed(sorted(rows['machine'].unique()))}, of the best sampler in the time, which is to "
        f"make its lights and the image; in brackets as a multiple of that of {label_of(MEASURE)}."
    )


def answers(points: pd.DataFrame, fixed: Collection[str]) -> pd.DataFrame:
    """Who has the least error over all maps in a time, lights made in it: times × uses, as text.

    fixed : the samplers of lights that a program without them can be given
    """
    every = points[points["class"] == ALL]
    lines = []
    for step in time_steps(every):
        if not SHORTEST <= step <= LONGEST:
            continue
        line = {"time": _seconds(step)}
        for metric in metrics_of(points):
            able = within(every, "seconds", step, metric)
            measure = able[able["sampler"] == MEASURE]
            for use, part in ((ENGINE, able[able["sampler"].isin(fixed)]), (PATH_TRACER, able)):
                entry = NOBODY
                if len(part):
                    best = part.iloc[0]
                    holders = listed([*map(label_of, _holders(part, metric))], most=2)
                    entry = f"{holders} {best[metric.name]:.3f}"
                    if len(measure) and not best[metric.near_column]:
                        entry += f" ({best[metric.name] / measure[metric.name].iloc[0]:.2f})"
                line[f"{use}, {metric.label}"] = entry
        lines.append(line)
    return pd.DataFrame(lines)


def time_steps(points: pd.DataFrame) -> list[float]:
    """Times 1, 2, 5, 10 … of a second's parts that span what was measured."""
    seconds = points[list(TIMES)].to_numpy(np.float64)
    seconds = seconds[seconds > 0.0]
    if not len(seconds):
        return []
    first, last = math.floor(math.log10(seconds.min())), math.ceil(math.log10(seconds.max()))
    steps = [10.0**k * step for k in range(first, last + 1) for step in STEPS]
    end = next(k for k, step in enumerate(steps) if step >= seconds.max())
    return [step for step in steps[: end + 1] if step >= seconds.min()]


def within(points: pd.DataFrame, time: str, most: float, metric: Metric) -> pd.DataFrame:
    """The points that take no longer, least error first."""
    able = points[points[time] <= most * (1.0 + 1e-9)]
    return able.sort_values([metric.name, time], kind="stable")


def _holders(able: pd.DataFrame, metric: Metric) -> list[str]:
    """Of points, least error first, the first's sampler; where it is at its floor, all that are."""
    near = able[metric.near_column]
    return list(dict.fromkeys((able[near] if near.iloc[0] else able[:1])["sampler"]))


def _seconds(value: float) -> str:
    return f"{value:g} s" if value >= 1.0 else f"{1e3 * value:g} ms"


def whom_to_choose(run: Run) -> Iterator[Part]:
    """The best sampler in a given time, by class of maps."""
    rows = classed(run.rows)
    points = convergence_points(rows)
    for time, meaning in TIMES.items():
        for metric in metrics_of(points):
            table = best_in_time(points, time, metric)
            yield Heading(f"Which sampler, by {metric.label}, {meaning}")
            shown = table.assign(time=time, metric=metric.name)
            yield Table("best_in_time", shown, dict.fromkeys(map(str, table), "s"))
    yield Text(
        "Each entry is the sampler of least mean error among all that were measured within the "
        f"time of the column. Where several have one within {NEAR:g}× of what the references' own "
        "noise gives, order is not certain: they share the place, and the entry says how many they "
        "are."
    )
    if MACHINE in rows and rows[MACHINE].nunique() > 1:
        yield Text(
            "Several kinds of machine measured the times. Those of a class are means over the "
            "cases of one kind, and do not compare between classes of different kinds."
        )


def best_in_time(points: pd.DataFrame, time: str, metric: Metric) -> pd.DataFrame:
    """Classes × times, as text: the sampler, its budget and error, or how many share the place."""
    lines = []
    steps = time_steps(points)
    for group, part in points.groupby("class", sort=False):
        line = {"class": group}
        for step in steps:
            able = within(part, time, step, metric)
            if len(able):
                holders, best = _holders(able, metric), able.iloc[0]
                alone = f"{holders[0]} ({best['budget']}) {best[metric.name]:.3f}"
                line[_seconds(step)] = (
                    alone if len(holders) == 1 else f"{len(holders)} at the floor"
                )
        lines.append(line)
    table = pd.DataFrame(lines)
    return table[["class", *(name for name in map(_seconds, steps) if name in table)]].fillna(
        NOBODY
    )


def fitted_slopes(run: Run) -> Iterator[Part]:
    """Exponents of cost."""
    table = slopes(convergence_points(classed(run.rows)))
    table = table.sort_values(["metric", "cost", "slope"], kind="stable")
    table["metric"] = [find_metric(name).label for name in table["metric"]]
    yield Heading(f"Slopes, {ALL}")
    yield Table("slopes_all_maps", table, SLOPE_FORMATS)
    yield Text(
        f"Exponents of cost with 95 % intervals, from points that are not within {NEAR:g}× of the "
        "noise of their references; –0.5 is that of independent samples. A dash: fewer than three "
        "such points."
    )


def slopes(points: pd.DataFrame) -> pd.DataFrame:
    """Fitted exponents over all maps by sampler, metric and cost; NaN where there are too few
    points.
    """
    lines = []
    for sampler, part in points[points["class"] == ALL].groupby("sampler", sort=False):
        for metric in metrics_of(points):
            clear = part[~part[metric.near_column]]
            for cost in SLOPE_COSTS:
                law = fit_power_law(clear[cost], clear[metric.name])
                line = {"class": ALL, "sampler": sampler, "metric": metric.name, "cost": cost}
                lines.append({**line, **law})
    return pd.DataFrame(lines)


def fit_power_law(cost: ArrayLike, error: ArrayLike) -> dict[str, float | int]:
    """error ≈ level · cost^slope through points (n,) each, by least squares of the logarithms.

    Independent samples have a slope of −1/2, stratified ones are steeper. The interval, low to
    high, is Student's, from the residuals, with n − 2 degrees of freedom: it says how well a power
    law holds over the budgets measured, and not how errors of other maps would scatter. NaN with
    fewer than three positive, finite points or fewer than three different costs.
    """
    from scipy.stats import linregress, t

    x, y = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    good = (x > 0.0) & (y > 0.0) & np.isfinite(x) & np.isfinite(y)
    if len(np.unique(x[good])) < LEAST_POINTS:
        return {**dict.fromkeys(("slope", "low", "high", "level"), math.nan), "points": len(x)}
    law, count = linregress(np.log(x[good]), np.log(y[good])), int(good.sum())
    reach = float(t.ppf(0.5 + 0.5 * CONFIDENCE, count - 2)) * law.stderr
    return {
        "slope": law.slope, "low": law.slope - reach, "high": law.slope + reach,
        "level": math.exp(law.intercept), "points": count,
    }  # fmt: skip


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


def convergence_plot(points: pd.DataFrame, metric: Metric, cost: str, looks: Looks) -> "Figure":
    """The metric over `cost` of the points: all maps large, and a small panel per class."""
    told = points.assign(
        seconds=points[cost], error=points[metric.name], near=points[metric.near_column]
    )
    panels = {str(name): part for name, part in told.groupby("class", sort=False)}
    return over_time_plot(panels, metric, looks, COSTS[cost])
