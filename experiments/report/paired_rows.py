"""The rows of two runs that are of the same measurement, and the values they are judged by.

The rows of a grid are paired by scale, scene, map, budget, sampler and seed and judged by the
metrics; those of a study by the parameters of its rows, which its record names, and judged by every
other number that does not depend on the machine.
"""

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.run.budget import Budget
from experiments.run.loaded_run import Run
from metrics.registry import NEAR, metrics
from samplers import EnvlightError

GRID = ["scale", "scene", "environment", "sampler", "budget", "seed"]
MACHINES_OWN = re.compile(r"seconds|peak_|load_average|rounds$|spread$")
"""How the names of columns begin whose values depend on the machine and its load."""
GROUPS = ("sampler", "method", "pattern")
"""What the rows of a study are counted by: the first of these that it has, or its first key."""


@dataclass(frozen=True, eq=False)
class PairedRows:
    """The measurements that two runs share.

    keys : what they are paired by, as text; one row per measurement
    ours, theirs : (rows, values), the values that both runs have
    labels : of the values
    floors : (rows, values), the larger of both runs' noise floors; 0 where there is none
    possible : (rows,) whether the values of both are finite and such as their metrics can have
    timed : (rows,) whether a row depends on the machine's speed as a whole
    group : the column of `keys` by which rows are counted
    only_first, only_second : measurements that only one of the runs has
    """

    keys: pd.DataFrame
    ours: NDArray[np.float64]
    theirs: NDArray[np.float64]
    labels: list[str]
    floors: NDArray[np.float64]
    possible: NDArray[np.bool_]
    timed: NDArray[np.bool_]
    group: str
    only_first: int
    only_second: int

    @property
    def above_floors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The values of both, those that lie near their floors as that, as rankings take them."""
        least = np.where(self.floors > 0.0, NEAR * self.floors, -np.inf)
        return np.maximum(self.ours, least), np.maximum(self.theirs, least)


def paired_rows(first: Run, second: Run) -> PairedRows:
    """The shared measurements, possibly none; EnvlightError where rows cannot be paired."""
    keys = _keys(first)
    if keys != _keys(second):
        raise EnvlightError(
            f"{first.folder} and {second.folder} are of different experiments: the rows of one are "
            f"told apart by {', '.join(keys)}, those of the other by {', '.join(_keys(second))}"
        )
    left, right = (_by_keys(run, keys) for run in (first, second))
    shared = left.index.intersection(right.index)
    if set(keys) == set(GRID):
        found = [m for m in metrics() if m.name in left and m.name in right]
        names, labels, group = [m.name for m in found], [m.label for m in found], "sampler"
        # An error is no less than 0, and one that pixels have in [0, 1] is there, too.
        low = [0.0 if m.better == "less" else -np.inf for m in found]
        high = [np.inf if m.error_map is None else 1.0 for m in found]
    else:
        names = [str(name) for name in left if name in right and _judged(left[name], right[name])]
        labels, group = list(names), next((name for name in GROUPS if name in keys), keys[0])
        low, high = [-np.inf] * len(names), [np.inf] * len(names)
    ours, theirs = (table.loc[shared, names].to_numpy(np.float64) for table in (left, right))
    inside = [np.isfinite(one) & (one >= low) & (one <= high) for one in (ours, theirs)]
    floors = np.fmax(*(_floors(table.loc[shared], names) for table in (left, right)))
    table = shared.to_frame(index=False)
    timed = np.zeros(len(table), np.bool_)
    if "budget" in keys:
        timed = np.array([bool(b) and Budget.parse(b).timed for b in table["budget"]], np.bool_)
    missing = [len(table.index.difference(shared)) for table in (left, right)]
    return PairedRows(
        table, ours, theirs, labels, floors, np.all(inside, axis=(0, 2)), timed, group,
        missing[0], missing[1],
    )  # fmt: skip


def _floors(rows: pd.DataFrame, names: list[str]) -> NDArray[np.float64]:
    """The noise floors of the values, 0 for those without."""
    columns = [f"{name}_floor" for name in names]
    found = rows.reindex(columns=columns).to_numpy(np.float64)
    return np.where(np.isfinite(found), found, 0.0)


def _keys(run: Run) -> list[str]:
    """The columns that tell a run's rows apart."""
    keys: list[str] = run.record.get("keys", GRID)
    if not set(keys) <= set(run.rows):
        raise EnvlightError(
            f"{run.folder}: its record does not say which columns tell its rows apart, so there is "
            "nothing to compare them by; measure it anew"
        )
    return keys


def _by_keys(run: Run, keys: list[str]) -> pd.DataFrame:
    """Rows under their keys, each as text; a key that a row does not have is empty."""
    words = run.rows[keys].astype(object)
    words = words.where(words.notna(), "").astype(str)
    rows = run.rows.drop(columns=keys).set_axis(pd.MultiIndex.from_frame(words), axis=0)
    return rows[~rows.index.duplicated()].sort_index()


def _judged(first: pd.Series, second: pd.Series) -> bool:
    """Whether a column of a study holds numbers that the machine does not change."""
    numbers = all(pd.api.types.is_numeric_dtype(one.dtype) for one in (first, second))
    return numbers and not MACHINES_OWN.match(str(first.name))
