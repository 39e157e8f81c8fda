"""Timing that can be trusted: interleaved rounds, medians and quartiles, and a word about noise.

All tasks of a round run one after another, and rounds follow each other, so that a busy spell of
the machine meets every task alike. Rounds before the clock starts are thrown away: they compile
kernels and fill caches. What is reported is the median with the quartiles, never the best time.
"""

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from experiments.run.budget import ALLOWED, Budget

NOISY_SPREAD = 0.2
"""Quartiles further apart than this share of the median are called noisy."""
SPREAD, LOAD = "spread", "load_average"
ON_TIME = 0.1
"""A time within this share of a budget of seconds is on time."""


@dataclass(frozen=True)
class Timing:
    """Seconds of one task: the median, the lower and upper quartile, and how many rounds."""

    median: float
    lower: float
    upper: float
    rounds: int

    @classmethod
    def of(cls, seconds: list[float]) -> "Timing":
        lower, median, upper = np.percentile(seconds, [25.0, 50.0, 75.0]).tolist()
        return cls(median, lower, upper, len(seconds))

    @property
    def spread(self) -> float:
        """Distance of the quartiles as a share of the median."""
        return (self.upper - self.lower) / self.median if self.median > 0.0 else 0.0

    def columns(self, name: str = "seconds") -> dict[str, float]:
        """The timing as columns of a row."""
        return {
            name: self.median,
            f"{name}_lower": self.lower,
            f"{name}_upper": self.upper,
            "rounds": self.rounds,
            SPREAD: self.spread,
        }


def interleaved(
    tasks: Mapping[str, Callable[[], Any]],
    rounds: int,
    warm_up: int = 1,
    most_seconds: float = float("inf"),
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, Timing]:
    """Time every task in each of `rounds` rounds, after `warm_up` rounds that do not count.

    most_seconds : a task that has taken this long leaves out further rounds, but not its first
    """
    for _ in range(warm_up):
        for task in tasks.values():
            task()
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(rounds):
        for name, task in tasks.items():
            if seconds[name] and sum(seconds[name]) >= most_seconds:
                continue
            started = clock()
            task()
            seconds[name].append(clock() - started)
    return {name: Timing.of(values) for name, values in seconds.items()}


def over_baseline(
    rows: pd.DataFrame, value: str, column: str, baseline: str, case: list[str]
) -> pd.Series:
    """A column's values over those of the row of the same case whose `column` is the baseline."""
    base = rows.loc[rows[column] == baseline, [*case, value]]
    return rows[value] / rows[case].merge(base, on=case, how="left")[value].to_numpy()


def load_average() -> float:
    """Processes that wanted to run during the last minute; NaN where the system does not say."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def noise_sentence(rows: pd.DataFrame) -> str:
    """One plain sentence about how far the times of these rows can be trusted."""
    once = rows["rounds"] == 1 if "rounds" in rows else pd.Series(False, rows.index)
    load = float(rows[LOAD].max())
    if once.all():
        return f"Times were taken once per row, with a load average of at most {load:.1f}."
    noisy = int((rows[SPREAD] > NOISY_SPREAD).sum())
    single = f" ({once.sum()} more were timed once, as they take long)" if once.any() else ""
    if noisy == 0:
        return (
            f"Times repeat: no row's quartiles lie more than {100 * NOISY_SPREAD:.0f} % "
            f"of its median apart{single}; the load average was at most {load:.1f}."
        )
    return (
        f"The machine was noisy: in {noisy} of {(~once).sum()} rows{single} the quartiles lie "
        f"more than {100 * NOISY_SPREAD:.0f} % of the median apart, and the load average was up to "
        f"{load:.1f}; trust ratios, not times."
    )


def seconds_allowed(rows: pd.DataFrame) -> pd.Series:
    """Seconds that the budget was in each of these rows, whose budgets are of time."""
    budgets = rows["budget"].map(Budget.parse)
    told = budgets.map(lambda budget: math.nan if budget.like else budget.amount)
    return told.fillna(rows[ALLOWED]) if ALLOWED in rows else told


def time_used_sentence(rows: pd.DataFrame) -> str:
    """One plain sentence about how near a budget of seconds these rows came.

    rows : with seconds_render and count, and the same budget of time in all

    Where one more light or sample takes more than twice what a time may be off by, there may be no
    count that is on time: how many rows are of that kind is told, and how many of the others are.
    """
    used = rows["seconds_render"] / seconds_allowed(rows)
    lower, median, upper = used.quantile([0.25, 0.5, 0.75])
    near = (used - 1.0).abs() <= ON_TIME
    on_time = int(near.sum())
    fine = used / rows["count"].clip(lower=1) <= 2.0 * ON_TIME
    steps = (
        f" In {(~fine).sum()} rows one light or sample takes more than {200 * ON_TIME:.0f} % of "
        f"the budget, so that no number of them need come as near; of the {fine.sum()} others "
        f"{(near & fine).sum()} ({100 * near[fine].mean():.1f} %) do."
        if fine.any() and not fine.all()
        else ""
    )
    return (
        f"At {rows['budget'].iloc[0]} images took {median:.3f} of the budget in the median "
        f"(quartiles {lower:.3f} and {upper:.3f}); {on_time} of {len(rows)} "
        f"({100 * on_time / len(rows):.1f} %) lie within {100 * ON_TIME:.0f} % of it."
        f"{steps}"
    )


def load_sentence(load: Sequence[float], cores: int) -> str:
    """One plain sentence about times that were taken once each, by load averages during the run.

    A run keeps all cores busy itself; more than one process beyond that took time from it.
    """
    most = max((value for value in load if not math.isnan(value)), default=math.nan)
    if math.isnan(most):
        return "Times were taken once per measurement; the system does not tell how busy it was."
    if most <= cores + 1:
        return (
            "Times were taken once per measurement, with a load average of at most "
            f"{most:.1f} on {cores} cores."
        )
    return (
        "Times were taken once per measurement on a machine that was busy with other work (load "
        f"average up to {most:.1f} on {cores} cores): do not rank by them."
    )
