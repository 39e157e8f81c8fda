"""Means and mean ranks of the samplers, over what can be compared.

A map's error is the mean over its scenes, a scene's the mean over seeds; ranks are per map, equal
errors share the better one. Only blocks (scene × map) on which every sampler has all its seeds are
compared, so that neither an unfinished run nor a failed cell favours anyone.
"""

import pandas as pd

from experiments.budget import sorted_budgets
from metrics.ranking import mean_ranks

ERRORS = ("rmse", "flip")
COSTS = ("lights", "rays", "seconds_lights", "seconds_render")


def compared(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of one budget that lie in blocks on which every sampler has all its seeds.

    How many seeds a sampler has is the most that it has on any block.
    """
    block = ["scene", "environment"]
    seeds = rows.groupby([*block, "sampler"]).size().unstack("sampler")
    complete = (seeds == seeds.max()).all(axis=1)
    return rows[complete.reindex(pd.MultiIndex.from_frame(rows[block])).to_numpy()]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per sampler and budget, best mean FLIP rank first within a budget.

    All figures are means over the compared blocks, NaN where there is none; `maps` and `blocks`
    say how many those are. `near_floor` counts the cells whose error lies near their reference's
    noise floor, `noise_floor` is the mean floor, and `over_budget` counts the cells in which even
    the sampler's smallest number of lights costs more than the budget.
    """
    budgets = sorted_budgets(list(rows["budget"].unique()))
    tables = [_at_budget(rows[rows["budget"] == budget]) for budget in budgets]
    return pd.concat(tables, ignore_index=True)


def _at_budget(rows: pd.DataFrame) -> pd.DataFrame:
    fair = compared(rows)
    names = pd.Index(sorted(rows["sampler"].unique()), name="sampler")
    table = pd.DataFrame({"budget": rows["budget"].iloc[0]}, index=names)
    per_scene = fair.groupby(["environment", "scene", "sampler"])[list(ERRORS)].mean()
    per_map = per_scene.groupby(level=["environment", "sampler"]).mean()
    for error in ERRORS:
        by_sampler = per_map[error].unstack("sampler").reindex(names, axis="columns")
        table[error] = by_sampler.mean()
        table[f"{error}_rank"] = mean_ranks(by_sampler) if len(by_sampler) else float("nan")
    costs = fair.assign(rays=(fair["rays_shadow"] + fair["rays_brdf"]) / fair["rays_primary"])
    table[list(COSTS)] = costs.groupby("sampler")[list(COSTS)].mean()
    table["maps"] = fair["environment"].nunique()
    table["blocks"] = len(fair.groupby(["scene", "environment"]))
    table["noise_floor"] = fair.groupby("sampler")["noise_floor"].mean()
    table["over_budget"] = fair.groupby("sampler")["over_budget"].sum()
    table["near_floor"] = fair.groupby("sampler")["near_noise_floor"].sum()
    table = table.reset_index()[["budget", "sampler", *table.columns[1:]]]
    return table.sort_values(["flip_rank", "rmse_rank", "sampler"], kind="stable")
