"""Run time against error, as tables: means, slopes, fronts, times to an error, and whom to choose.

All are pure functions of the rows of a run with a column `class`, the map's class. A point is one
sampler at one budget on the maps of one class: means over seeds, then maps. Points whose RMSE is
within 3× of their references' noise floor are marked, and no slope is fitted through them.
"""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from experiments.questions.power_law import cost_to_reach, fit_power_law
from experiments.report.figures import pareto_front
from experiments.report.summary import ERRORS

ALL = "all maps"
FLOOR_FACTOR = 3.0
COSTS = {
    "lights": "lights or samples per shading point",
    "rays": "shadow and BRDF rays per sub-pixel",
    "seconds_render": "seconds to render",
    "seconds": "seconds to generate lights and render",
}
TIMES = {"seconds": "lights generated in that time", "seconds_render": "lights made before"}
"""The costs that are times, and what each means to somebody who has that much."""
STEPS = (1.0, 2.0, 5.0)
TARGETS = (0.2, 0.15, 0.1, 0.07, 0.05)
"""Values of FLIP whose times are told."""
NOBODY = "–"


def convergence_points(rows: pd.DataFrame, by_scene: bool = False) -> pd.DataFrame:
    """One line per class (and scene), sampler and budget: mean errors, floor and costs.

    The class `ALL` holds all maps. near_floor : whether the mean RMSE is within 3× of the floor
    """
    costs = rows.assign(
        rays=(rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"],
        seconds=rows["seconds_lights"] + rows["seconds_render"],
    )
    values = [*ERRORS, "noise_floor", *COSTS]
    both = pd.concat([costs.assign(**{"class": ALL}), costs], ignore_index=True)
    place = ["class", *(["scene"] if by_scene else []), "sampler", "budget"]
    per_map = both.groupby([*place, "environment"], sort=False)[values].mean()
    groups = per_map.groupby(level=place, sort=False)
    points = groups.mean().assign(maps=groups.size()).reset_index()
    points["near_floor"] = points["rmse"] < FLOOR_FACTOR * points["noise_floor"]
    return points


def slopes(points: pd.DataFrame) -> pd.DataFrame:
    """Fitted exponents by class, sampler, error and cost; NaN where there are too few points."""
    lines = []
    for (group, sampler), part in points.groupby(["class", "sampler"], sort=False):
        clear = part[~part["near_floor"]]
        for error in ERRORS:
            for cost in COSTS:
                law = fit_power_law(clear[cost], clear[error])
                lines.append(
                    {
                        "class": group, "sampler": sampler, "error": error, "cost": cost,
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
        for error in ERRORS:
            front = pareto_front(part.assign(error=part[error]))
            found.append(
                pd.DataFrame(
                    {
                        "class": group, "scene": scene, "measure": error,
                        "sampler": front["sampler"], "budget": front["budget"],
                        "seconds": front["seconds"], "value": front["error"],
                        "noise_floor": front["noise_floor"], "near_floor": front["near_floor"],
                    }
                )
            )  # fmt: skip
    return pd.concat(found, ignore_index=True)


def times_to_reach(points: pd.DataFrame, targets: Sequence[float] = TARGETS) -> pd.DataFrame:
    """Seconds until the mean FLIP is at most a target, by class and sampler; infinite where no
    measured point is that good. seconds : with, seconds_render : without making the lights"""
    lines = []
    for (group, sampler), part in points.groupby(["class", "sampler"], sort=False):
        for target in targets:
            found = {time: cost_to_reach(part[time], part["flip"], target) for time in TIMES}
            lines.append({"class": group, "sampler": sampler, "flip": target, **found})
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


def choices(points: pd.DataFrame) -> pd.DataFrame:
    """Who is best in a given time: by class, kind of time, error and time, the sampler and budget
    of least error among all points that take no longer. near_floor : that point's"""
    lines = []
    steps = time_steps(points)
    for group, part in points.groupby("class", sort=False):
        for time in TIMES:
            for error in ERRORS:
                for step in steps:
                    able = part[part[time] <= step * (1.0 + 1e-9)]
                    if able.empty:
                        continue
                    best = able.sort_values([error, time], kind="stable").iloc[0]
                    lines.append(
                        {
                            "class": group, "time": time, "error": error, "within": step,
                            "sampler": best["sampler"], "budget": best["budget"],
                            "value": best[error], "noise_floor": best["noise_floor"],
                            "near_floor": bool(best["near_floor"]),
                        }
                    )  # fmt: skip
    return pd.DataFrame(lines)


def advice(chosen: pd.DataFrame, time: str, error: str) -> list[str]:
    """The choices in words, a sentence per class: spans of time and who is best in them."""
    part = chosen[(chosen["time"] == time) & (chosen["error"] == error)]
    sentences = []
    for group, lines in part.groupby("class", sort=False):
        spans: list[tuple[str, float, float]] = []
        for _, line in lines.iterrows():
            if spans and spans[-1][0] == line["sampler"]:
                spans[-1] = (spans[-1][0], spans[-1][1], line["within"])
            else:
                spans.append((str(line["sampler"]), line["within"], line["within"]))
        words = [
            f"**{sampler}** with {_seconds(first)}"
            + (f" to {_seconds(last)}" if last > first else "")
            for sampler, first, last in spans
        ]
        words[-1] += " or more"
        sentences.append(f"{group}: {', '.join(words)}.")
    return sentences


def _seconds(value: float) -> str:
    return f"{value:g} s" if value >= 1.0 else f"{1e3 * value:g} ms"


def choice_table(chosen: pd.DataFrame, time: str, error: str) -> pd.DataFrame:
    """Classes × times, as text: sampler, its lights budget and error; * marks points near the
    floor."""
    part = chosen[(chosen["time"] == time) & (chosen["error"] == error)]
    text = [
        f"{line.sampler} ({line.budget}) {line.value:.3f}{'*' if line.near_floor else ''}"
        for line in part.itertuples()
    ]
    wide = part.assign(text=text).pivot(index="class", columns="within", values="text")
    wide = wide.reindex(part["class"].unique()).fillna(NOBODY)
    wide.columns = [_seconds(float(step)) for step in wide.columns]
    return wide.reset_index()


def reach_table(reached: pd.DataFrame, group: str, time: str) -> pd.DataFrame:
    """Samplers × targets: milliseconds to reach a FLIP on the maps of a class, as text."""
    part = reached[reached["class"] == group]
    wide = part.pivot(index="sampler", columns="flip", values=time)
    wide = wide[sorted(wide.columns, reverse=True)].sort_values(
        sorted(wide.columns, reverse=True)[::-1], kind="stable"
    )
    shown = wide.map(lambda value: f"{1e3 * value:.1f}" if math.isfinite(value) else NOBODY)
    shown.columns = [f"FLIP {target:g}" for target in shown.columns]
    return shown.reset_index()
