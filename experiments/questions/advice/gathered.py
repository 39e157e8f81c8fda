"""Gather what runs have measured into the table that advice is read from.

Rows with budgets of lights count; errors at so many rays or seconds are interpolated from those. An
error within `NEAR` times its reference's noise floor counts as that, as where samplers are ranked.
Of a map in several runs the last run's rows count.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from experiments.maps.classes import without_resolution
from experiments.maps.features import FEATURES, PREFIX
from experiments.questions.advice.expected import SURE, Array
from experiments.questions.advice.measured import Measured
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

REFERENCE = "median-cut"
"""The sampler in whose seconds per ray a machine's speed is told."""
LEAST_MAPS = 6
"""Fewer do not tell what an error depends on."""


def has_enough(rows: pd.DataFrame) -> bool:
    """Whether rows have features of maps, and enough maps and numbers of lights."""
    known = all(PREFIX + name in rows for name in FEATURES)
    counts = sum(Budget.parse(text).kind == "lights" for text in rows["budget"].unique())
    return known and counts > 1 and rows["environment"].nunique() >= LEAST_MAPS


def gathered(runs: Sequence[Run]) -> Measured:
    """What runs have measured at numbers of lights.

    Raises EnvlightError where the rows have no features of maps, or too few maps or budgets.
    """
    rows = _of_last_run(pd.concat([_at_lights(run) for run in runs], ignore_index=True))
    columns = [PREFIX + name for name in FEATURES]
    missing = [name for name in columns if name not in rows or rows[name].isna().any()]
    folders = ", ".join(str(run.folder) for run in runs)
    if missing:
        raise EnvlightError(
            f"{folders}: rows without features of the maps ({', '.join(missing)}); measure "
            "which-sampler anew"
        )
    maps, samplers, counts = (
        sorted(rows[name].unique()) for name in ("environment", "sampler", "allowed")
    )
    if len(maps) < LEAST_MAPS or len(counts) < 2:
        raise EnvlightError(
            f"{folders}: {len(maps)} maps were measured at {len(counts)} numbers of lights; advice "
            f"needs {LEAST_MAPS} maps at 2"
        )
    index = pd.MultiIndex.from_product([maps, samplers, counts])

    def cube(values: pd.Series) -> Array:
        found = values.groupby(level=["environment", "sampler", "allowed"]).mean()
        return found.reindex(index).to_numpy(np.float64).reshape(len(maps), len(samplers), -1)

    names = [metric.name for metric in ranked_metrics() if metric.name in rows]
    times = rows.groupby(["sampler", "allowed"])["seconds_lights"].median().unstack()
    traced = rows["seconds_render"] / (rows["rays"] * rows["rays_primary"])
    per_ray = traced.where(rows["rays"] > 0.0).groupby(rows["sampler"]).median().reindex(samplers)
    leagues = leagues_of(rows) if LEAGUE in rows else {}
    machines = [run.record["machine"] for run in runs]
    return Measured(
        tuple(map(str, maps)),
        tuple(map(str, samplers)),
        tuple(leagues.get(name, "") for name in samplers),
        tuple(map(int, counts)),
        rows.groupby("environment")[columns].first().loc[maps].to_numpy(np.float64),
        {name: find_metric(name).label for name in names},
        {name: cube(_ranked_errors(rows, name)) for name in names},
        cube(rows.groupby(["environment", "scene", "sampler", "allowed"])["rays"].mean()),
        times.reindex(index=samplers, columns=counts).to_numpy(np.float64),
        per_ray.to_numpy(np.float64),
        float(per_ray[REFERENCE if REFERENCE in samplers else samplers[0]]),
        {
            "runs": [run.folder.name for run in runs],
            "commits": list(
                dict.fromkeys(part.get("commit", "") for run in runs for part in run.parts)
            ),
            "scenes": sorted(map(str, rows["scene"].unique())),
            "images": sorted(rows["size"].unique()),
            "one_scene": {name: _on_one_scene(rows, name) for name in names},
            "machine": machines[0].get("processor", ""),
        },
    )


def _at_lights(run: Run) -> pd.DataFrame:
    """The rows with budgets of lights, and how many those allow."""
    budgets = {text: Budget.parse(text) for text in run.rows["budget"].unique()}
    lights = {text: found.lights for text, found in budgets.items() if found.kind == "lights"}
    rows = run.rows[run.rows["budget"].isin(lights)]
    if rows.empty:
        raise EnvlightError(f"{run.folder}: it has no budgets of lights; measure which-sampler")
    scale = run.record.get("scale", {})
    return rows.assign(
        allowed=rows["budget"].map(lights),
        environment=rows["environment"].map(lambda name: without_resolution(str(name))),
        size=f"{scale.get('width')}×{scale.get('height')}",
        run=str(run.folder),
    )


def _of_last_run(rows: pd.DataFrame) -> pd.DataFrame:
    last = rows.groupby("environment")["run"].last()
    return rows[rows["run"] == rows["environment"].map(last)]


def _ranked_errors(rows: pd.DataFrame, name: str) -> pd.Series:
    """Errors of maps as they are ranked, by map, number of lights and sampler; none that are 0."""
    metric = find_metric(name)
    tables = {
        allowed: resolved(errors_per_map(part, name), floors_per_map(part, metric).fillna(0.0))
        for allowed, part in rows.groupby("allowed")
    }
    whole = pd.concat(tables, names=["allowed"]).melt(ignore_index=False, var_name="sampler")
    errors: pd.Series = whole.set_index("sampler", append=True)["value"]
    return errors[errors > 0.0]


def _on_one_scene(rows: pd.DataFrame, name: str) -> list[float]:
    """Quantiles of errors on one scene over their means over the scenes of a map."""
    case = ["environment", "sampler", "allowed"]
    errors = rows.groupby([*case, "scene"])[name].mean()
    ratio = (errors / errors.groupby(case).transform("mean")).dropna()
    outside = 0.5 * (1.0 - SURE)
    return [round(float(ratio.quantile(part)), 3) for part in (outside, 1.0 - outside)]
