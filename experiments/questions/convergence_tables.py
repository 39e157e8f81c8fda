"""Run time against error, as tables: means, slopes, fronts, times to an error, and whom to choose.

All are pure functions of the rows of a run with a column `class`, the map's class. A point is one
sampler at one budget on the maps of one class: means over seeds, then maps. A point whose mean by a
metric is within 3× of the mean floor of its references is marked in the metric's `near_column`: no
slope is fitted through it, and no order is told among such points. Seconds are means over the cases
of one kind of machine in each class, that with the most.
"""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from experiments.report.figures import pareto_front
from experiments.report.sentences import listed
from experiments.report.summary import MACHINE, errors_in, timed_alike
from metrics.registry import NEAR, Metric, find_metric, leading_metric

ALL = "all maps"
COSTS = {
    "lights": "lights or samples per shading point",
    "rays": "shadow and BRDF rays per sub-pixel",
    "seconds_render": "seconds to render",
    "seconds": "seconds to generate lights and render",
}
TIMES = {"seconds": "lights generated in that time", "seconds_render": "lights made before"}
"""The costs that are times, and what each means to somebody who has that much."""
STEPS = (1.0, 2.0, 5.0)
ERROR_STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
MOST_TARGETS = 6
MOST_NAMED = 3
NOBODY = "–"
SHORTEST, LONGEST = 0.05, 10.0
"""Seconds that somebody might have for an image: of the shortest answer and of the longest."""
MEASURE = "median-cut"
"""Whose error the others' are told as a multiple of."""
ENGINE, PATH_TRACER = "fixed lights, for an engine", "anything, for a path tracer"
LEAST_POINTS = 3


def metrics_of(rows: pd.DataFrame) -> list[Metric]:
    """The ranked metrics that rows or points hold, the leading one first."""
    found = map(find_metric, errors_in(rows))
    return sorted(found, key=lambda metric: not metric.leads)


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
    )
    both = pd.concat([_with_times_alike(part) for _, part in _by_class(costs)], ignore_index=True)
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


def _by_class(rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """The rows of all maps, then those of every class."""
    rows = rows.reset_index(drop=True)
    yield ALL, rows.assign(**{"class": ALL})
    for name, part in rows.groupby("class", sort=False):
        yield str(name), part


def _with_times_alike(costs: pd.DataFrame) -> pd.DataFrame:
    """The rows of a class; times that are not of its kind of machine are NaN."""
    alike = costs.index.isin(timed_alike(costs).index)
    return costs.assign(**{time: costs[time].where(alike) for time in TIMES})


def timing_sentence(rows: pd.DataFrame) -> str:
    """Whose times the points of each class have, where several kinds of machine measured them."""
    if MACHINE not in rows or rows[MACHINE].nunique() < 2:
        return ""
    whose: dict[str, list[str]] = {}
    for name, part in _by_class(rows):
        timed = timed_alike(part)
        maps, of = timed["environment"].nunique(), part["environment"].nunique()
        kind = str(timed[MACHINE].iloc[0]) if len(timed) else "no kind alone"
        whose.setdefault(kind, []).append(f"{name} ({maps} of {of} maps)")
    told = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in whose.items())
    return (
        "Several kinds of machine measured the times, which are means over the cases of one kind "
        f"in each class, and are not comparable between classes of different kinds. {told}."
    )


def slopes(points: pd.DataFrame) -> pd.DataFrame:
    """Fitted exponents by class, sampler, metric and cost; NaN where there are too few points."""
    lines = []
    for (group, sampler), part in points.groupby(["class", "sampler"], sort=False):
        for metric in metrics_of(points):
            clear = part[~part[metric.near_column]]
            for cost in COSTS:
                law = fit_power_law(clear[cost], clear[metric.name])
                lines.append(
                    {
                        "class": group, "sampler": sampler, "metric": metric.name, "cost": cost,
                        "slope": law.slope if law else math.nan,
                        "low": law.low if law else math.nan,
                        "high": law.high if law else math.nan,
                        "level": law.level if law else math.nan,
                        "points": law.points if law else len(clear),
                    }
                )  # fmt: skip
    return pd.DataFrame(lines)


def fronts(points: pd.DataFrame) -> pd.DataFrame:
    """The Pareto fronts of error against total seconds, by class and scene, fastest first."""
    found = []
    for (group, scene), part in points.groupby(["class", "scene"], sort=False):
        for metric in metrics_of(points):
            front = pareto_front(part.assign(error=part[metric.name]))
            found.append(
                pd.DataFrame(
                    {
                        "class": group, "scene": scene, "metric": metric.name,
                        "sampler": front["sampler"], "budget": front["budget"],
                        "seconds": front["seconds"], "value": front["error"],
                        "near_floor": front[metric.near_column],
                    }
                )
            )  # fmt: skip
    return pd.concat(found, ignore_index=True)


def targets(points: pd.DataFrame) -> list[float]:
    """Round values of the leading metric that were reached on all maps, largest first.

    The smallest ones between the largest and the smallest value that were measured, above what the
    references' own noise blurs.
    """
    metric = leading_metric()
    part = points[points["class"] == ALL]
    values = part[metric.name].to_numpy(np.float64)
    values = values[values > 0.0]
    if not len(values):
        return []
    blurred = NEAR * float(part[metric.floor_column].max()) if metric.floor_column in part else 0.0
    least, most = max(float(values.min()), blurred), float(values.max())
    decades = range(math.floor(math.log10(values.min())), math.ceil(math.log10(most)) + 1)
    steps = [float(f"{step}e{decade}") for decade in decades for step in ERROR_STEPS]
    return [step for step in steps if least <= step <= most][:MOST_TARGETS][::-1]


def times_to_reach(points: pd.DataFrame, wanted: list[float]) -> pd.DataFrame:
    """Seconds until the mean of the leading metric is at most a target, by class and sampler.

    Infinite where no measured point is that good. seconds : with, seconds_render : without making
    the lights
    """
    metric, lines = leading_metric(), []
    for (group, sampler), part in points.groupby(["class", "sampler"], sort=False):
        for target in wanted:
            found = {time: cost_to_reach(part[time], part[metric.name], target) for time in TIMES}
            lines.append({"class": group, "sampler": sampler, "target": target, **found})
    return pd.DataFrame(lines, columns=["class", "sampler", "target", *TIMES])


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


def choices(points: pd.DataFrame) -> pd.DataFrame:
    """Who is best in a given time, by class, kind of time, metric and time: a line per place.

    That is the sampler with the point of least error among all that take no longer. Where that
    point is near its floor, all samplers that have one near theirs in the time share the place:
    `shared` counts them, `sampler` names them all, best mean first, which is no order.
    """
    lines = []
    steps = time_steps(points)
    for group, part in points.groupby("class", sort=False):
        for time in TIMES:
            for metric in metrics_of(points):
                for step in steps:
                    able = part[part[time] <= step * (1.0 + 1e-9)]
                    if len(able):
                        place = _place(able.sort_values([metric.name, time], kind="stable"), metric)
                        at = {"class": group, "time": time, "metric": metric.name, "within": step}
                        lines.append({**at, **place})
    return pd.DataFrame(lines)


def _place(able: pd.DataFrame, metric: Metric) -> dict[str, object]:
    """Who holds a place, from the points that are fast enough, least error first."""
    best = able.iloc[0]
    near = bool(best[metric.near_column])
    holders = able[able[metric.near_column]] if near else able.iloc[:1]
    names = list(dict.fromkeys(holders["sampler"]))
    return {
        "sampler": ", ".join(names), "shared": len(names), "budget": best["budget"],
        "value": best[metric.name], "near_floor": near,
    }  # fmt: skip


def answers(points: pd.DataFrame, fixed: Collection[str]) -> pd.DataFrame:
    """Who has the least error over all maps in a time, lights made in it: times × uses, as text.

    fixed : the samplers of lights that a program without them can be given
    """
    every = points[points["class"] == ALL]
    lines = []
    for step in time_steps(every):
        if not SHORTEST <= step <= LONGEST:
            continue
        able = every[every["seconds"] <= step * (1.0 + 1e-9)]
        line = {"time": _seconds(step)}
        for metric in metrics_of(points):
            by_error = able.sort_values([metric.name, "seconds"], kind="stable")
            measure = by_error[by_error["sampler"] == MEASURE]
            for use, part in (
                (ENGINE, by_error[by_error["sampler"].isin(fixed)]),
                (PATH_TRACER, by_error),
            ):
                entry = NOBODY
                if len(part) and len(measure):
                    place, value = _place(part, metric), measure[metric.name].iloc[0]
                    entry = f"{place['sampler']} {place['value']:.3f}"
                    entry += "" if place["near_floor"] else f" ({place['value'] / value:.2f})"
                line[f"{use}, {metric.label}"] = entry
        lines.append(line)
    return pd.DataFrame(lines)


def advice(chosen: pd.DataFrame, time: str, metric: str) -> list[str]:
    """The choices in words, a sentence per class: spans of time and who is best in them.

    Times in which several have errors near the floor are one span, whose samplers share the place.
    """
    part = chosen[(chosen["time"] == time) & (chosen["metric"] == metric)]
    sentences = []
    for group, lines in part.groupby("class", sort=False):
        spans: list[tuple[str, pd.DataFrame]] = []
        # A shared place stays one when there is more time.
        key = lines["sampler"].where(lines["shared"] == 1, "")
        for _, span in lines.groupby((key != key.shift()).cumsum()):
            spans.append((str(key[span.index[0]]), span))
        words = [_span(name, span) for name, span in spans]
        words[-1] += " or more"
        if spans[-1][0] == "":
            sharing = spans[-1][1]["sampler"].iloc[-1].split(", ")
            words[-1] += (
                f", shared by {listed(sharing, MOST_NAMED)}: errors within "
                f"{NEAR:g}× of the references' noise, which have no order"
            )
        sentences.append(f"{group}: {', '.join(words)}.")
    return sentences


def _span(name: str, span: pd.DataFrame) -> str:
    first, last = _seconds(span["within"].iloc[0]), _seconds(span["within"].iloc[-1])
    who = f"**{name}**" if name else "nobody alone"
    return f"{who} with {first}" + (f" to {last}" if last != first else "")


def _seconds(value: float) -> str:
    return f"{value:g} s" if value >= 1.0 else f"{1e3 * value:g} ms"


def choice_table(chosen: pd.DataFrame, time: str, metric: str) -> pd.DataFrame:
    """Classes × times, as text: the sampler, its budget and error, or how many share the place."""
    part = chosen[(chosen["time"] == time) & (chosen["metric"] == metric)]
    text = [
        f"{line.shared} at the floor" if line.shared != 1
        else f"{line.sampler} ({line.budget}) {line.value:.3f}"
        for line in part.itertuples()
    ]  # fmt: skip
    wide = part.assign(text=text).pivot(index="class", columns="within", values="text")
    wide = wide.reindex(part["class"].unique()).fillna(NOBODY)
    wide.columns = [_seconds(float(step)) for step in wide.columns]
    return wide.reset_index()


def reach_table(reached: pd.DataFrame, group: str, time: str) -> pd.DataFrame:
    """Samplers × targets: milliseconds to reach them on the maps of a class, as text."""
    part = reached[reached["class"] == group]
    wide = part.pivot(index="sampler", columns="target", values=time)
    # Whoever reaches the smallest target first comes first.
    wide = wide.sort_values(sorted(wide.columns), kind="stable")[sorted(wide.columns)[::-1]]
    shown = wide.map(lambda value: f"{1e3 * value:.1f}" if math.isfinite(value) else NOBODY)
    shown.columns = [f"{target:g}" for target in shown.columns]
    return shown.reset_index()


@dataclass(frozen=True)
class PowerLaw:
    """error ≈ level · cost^slope. low, high : the slope's 95 % interval; points : behind the fit"""

    slope: float
    low: float
    high: float
    level: float
    points: int


def fit_power_law(cost: ArrayLike, error: ArrayLike, confidence: float = 0.95) -> PowerLaw | None:
    """The law through points (n,) each, by least squares of log error = a + b · log cost.

    Independent samples have b = −1/2, stratified ones are steeper. The interval is Student's, from
    the residuals, with n − 2 degrees of freedom: it says how well a power law holds over the
    budgets measured, and not how errors of other maps would scatter. None with fewer than three
    positive, finite points or fewer than three different costs.
    """
    from scipy.stats import t

    x, y = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    good = (x > 0.0) & (y > 0.0) & np.isfinite(x) & np.isfinite(y)
    x, y = np.log(x[good]), np.log(y[good])
    if len(np.unique(x)) < LEAST_POINTS:
        return None
    spread = float(((x - x.mean()) ** 2).sum())
    slope = float(((x - x.mean()) * (y - y.mean())).sum()) / spread
    start = float(y.mean()) - slope * float(x.mean())
    freedom = len(x) - 2
    residual = float(((y - start - slope * x) ** 2).sum()) / freedom
    reach = float(t.ppf(0.5 + 0.5 * confidence, freedom)) * math.sqrt(residual / spread)
    return PowerLaw(slope, slope - reach, slope + reach, math.exp(start), len(x))


def cost_to_reach(cost: ArrayLike, error: ArrayLike, target: float) -> float:
    """The least cost at which the error is at most `target`, between measured points only.

    Between neighbouring points, in order of cost, logarithms are interpolated. Infinite where no
    measured error is that small; the first cost where already its error is. Points whose cost is
    NaN are left out.
    """
    x, y = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    order = np.argsort(x, kind="stable")[: np.isfinite(x).sum()]
    x, y = x[order], y[order]
    reached = np.flatnonzero(y <= target)
    if not len(reached):
        return math.inf
    last = int(reached[0])
    if last == 0:
        return float(x[0])
    if not (y[last] > 0.0 and x[last - 1] > 0.0):
        return float(x[last])
    high, low = math.log(y[last - 1]), math.log(y[last])
    part = (high - math.log(target)) / (high - low) if target > 0.0 else 1.0
    return float(math.exp(math.log(x[last - 1]) * (1.0 - part) + math.log(x[last]) * part))
