"""What runs say of samplers on maps, as arrays: maps × samplers × numbers of lights.

An error is that of a map, as tables have it: the mean over scenes, after the mean over seeds. One
that is within `NEAR` times the floor which the references' noise sets counts as that. Budgets of
rays and seconds are left out; errors at so many rays come from those at numbers of lights.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.classes import without_resolution
from experiments.maps.features import FEATURES, PREFIX
from experiments.questions.advice.model import SURE
from experiments.report.summary import (
    LEAGUE,
    errors_per_map,
    floors_per_map,
    leagues_of,
    resolved,
)
from experiments.run.budget import Budget
from experiments.run.loaded_run import Run
from metrics.registry import find_metric, ranked_metrics
from samplers import EnvlightError

Array = NDArray[np.float64]
REFERENCE = "median-cut"
"""The sampler in whose seconds per ray a machine's speed is told."""
LEAST_MAPS = 6
"""Fewer do not tell what a feature does."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Means over the scenes and seeds of every map.

    maps, samplers, counts : the names along the axes (m), (s), (c)
    leagues : by sampler
    features : (m, f) in the units of `FEATURES`, in their order
    errors : by the metric's name, (m, s, c), positive; NaN where nothing was measured
    rays : (m, s, c), shadow and BRDF rays per sub-pixel
    seconds_lights : (s, c), the median; NaN where nothing was
    seconds_per_ray : (s,), of rendering, the median
    scenes, sizes : what the means are over
    single_scene : by metric, factors on a map's error between which `SURE` of its scenes' lie
    """

    maps: tuple[str, ...]
    samplers: tuple[str, ...]
    counts: tuple[int, ...]
    leagues: dict[str, str]
    features: Array
    errors: dict[str, Array]
    rays: Array
    seconds_lights: Array
    seconds_per_ray: Array
    scenes: tuple[str, ...]
    sizes: tuple[str, ...]
    single_scene: dict[str, tuple[float, float]]


def measured(runs: Sequence[Run]) -> Measured:
    """What runs have measured at numbers of lights; of a map in several runs the last one's.

    Raises EnvlightError where the rows have no features of maps, or too few maps.
    """
    rows = pd.concat([_at_lights(run) for run in runs], ignore_index=True)
    columns = [PREFIX + name for name in FEATURES]
    missing = [name for name in columns if name not in rows]
    if missing or rows[columns].isna().any(axis=None):
        raise EnvlightError(
            f"{', '.join(str(run.folder) for run in runs)}: rows without features of the maps "
            f"({', '.join(missing or columns[:1])}); measure which-sampler anew"
        )
    rows = _of_last_run(rows)
    if rows["environment"].nunique() < LEAST_MAPS:
        raise EnvlightError(
            f"{rows['environment'].nunique()} maps were measured; a model needs {LEAST_MAPS}"
        )
    maps = sorted(rows["environment"].unique())
    samplers, counts = sorted(rows["sampler"].unique()), sorted(rows["allowed"].unique())
    index = pd.MultiIndex.from_product([maps, samplers, counts])
    shape = (len(maps), len(samplers), len(counts))

    def cube(values: pd.Series) -> Array:
        found = values.groupby(level=["environment", "sampler", "allowed"]).mean()
        return found.reindex(index).to_numpy(np.float64).reshape(shape)

    names = [metric.name for metric in ranked_metrics() if metric.name in rows]
    cases = rows.groupby(["environment", "scene", "sampler", "allowed"])
    features = rows.groupby("environment")[columns].first().loc[maps].to_numpy(np.float64)
    times = rows.groupby(["sampler", "allowed"])["seconds_lights"].median().unstack()
    traced = rows["seconds_render"] / (rows["rays"] * rows["rays_primary"])
    per_ray = traced.where(rows["rays"] > 0.0).groupby(rows["sampler"]).median()
    scenes = sorted(map(str, rows["scene"].unique()))
    sizes = sorted(rows["size"].unique())
    return Measured(
        tuple(map(str, maps)), tuple(map(str, samplers)), tuple(map(int, counts)),
        leagues_of(rows) if LEAGUE in rows else {}, features,
        {name: cube(_resolved(rows, name)) for name in names},
        cube(cases["rays"].mean()),
        times.reindex(index=samplers, columns=counts).to_numpy(np.float64),
        per_ray.reindex(samplers).to_numpy(np.float64),
        tuple(scenes), tuple(sizes),
        {name: _of_scenes(rows, name) for name in names},
    )  # fmt: skip


def parted(table: Measured, aside: Sequence[str]) -> tuple[Measured, Measured]:
    """What was measured without the maps aside, and on these alone."""
    unknown = sorted(set(aside) - set(table.maps))
    if unknown:
        raise EnvlightError(f"{', '.join(unknown)}: not among the maps that were measured")
    inside = np.isin(np.array(table.maps), list(aside))
    return _of_maps(table, ~inside), _of_maps(table, inside)


def _of_maps(table: Measured, chosen: NDArray[np.bool_]) -> Measured:
    return replace(
        table,
        maps=tuple(np.array(table.maps)[chosen].tolist()),
        features=table.features[chosen],
        errors={name: errors[chosen] for name, errors in table.errors.items()},
        rays=table.rays[chosen],
    )


def _of_scenes(rows: pd.DataFrame, name: str) -> tuple[float, float]:
    """Quantiles of errors on one scene over their means over the scenes of a map."""
    case = ["environment", "sampler", "allowed"]
    errors = rows.groupby([*case, "scene"])[name].mean()
    ratio = (errors / errors.groupby(case).transform("mean")).dropna()
    outside = 0.5 * (1.0 - SURE)
    low, high = np.quantile(ratio, [outside, 1.0 - outside]).tolist()
    return low, high


def _at_lights(run: Run) -> pd.DataFrame:
    """The rows with budgets of lights, and how many those allow."""
    budgets = {text: Budget.parse(text) for text in run.rows["budget"].unique()}
    lights = {text: found.lights for text, found in budgets.items() if found.kind == "lights"}
    rows = run.rows[run.rows["budget"].isin(lights)]
    scale = run.record.get("scale", {})
    size = f"{scale.get('width')}×{scale.get('height')}"
    names = rows["environment"].map(lambda name: without_resolution(str(name)))
    rows = rows.assign(
        allowed=rows["budget"].map(lights), environment=names, size=size, run=str(run.folder)
    )
    if rows.empty:
        raise EnvlightError(f"{run.folder}: it has no budgets of lights; measure which-sampler")
    return rows


def _of_last_run(rows: pd.DataFrame) -> pd.DataFrame:
    """Of a map that several runs have, the rows of the last one."""
    last = rows.groupby("environment")["run"].last()
    return rows[rows["run"] == rows["environment"].map(last)]


def _resolved(rows: pd.DataFrame, name: str) -> pd.Series:
    """Errors of maps as they are ranked, by map, number of lights and sampler; none that are 0."""
    metric = find_metric(name)
    tables = {
        allowed: resolved(errors_per_map(part, name), floors_per_map(part, metric).fillna(0.0))
        for allowed, part in rows.groupby("allowed")
    }
    whole = pd.concat(tables, names=["allowed"]).melt(ignore_index=False, var_name="sampler")
    errors: pd.Series = whole.set_index("sampler", append=True)["value"]
    return errors[errors > 0.0]
