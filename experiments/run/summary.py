"""Means and mean ranks of the samplers, over what can be compared.

A map's error is the mean over its scenes, a scene's the mean over seeds; ranks are per map, equal
errors share the better one. Only cases (scene × map) on which every sampler has all its seeds are
compared, so that neither an unfinished run nor a failed measurement favours anyone.
"""

import pandas as pd

from experiments.run.budget import sorted_budgets
from metrics.ranking import mean_ranks

ERRORS = ("rmse", "flip")
TIMES = ("seconds_lights", "seconds_render")
COSTS = ("lights", "rays", *TIMES)
MACHINE = "machine"


def compared(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of one budget that lie in cases on which every sampler has all its seeds.

    How many seeds a sampler has is the most that it has on any case.
    """
    case = ["scene", "environment"]
    seeds = rows.groupby([*case, "sampler"]).size().unstack("sampler")
    complete = (seeds == seeds.max()).all(axis=1)
    return rows[complete.reindex(pd.MultiIndex.from_frame(rows[case])).to_numpy()]


def timed_alike(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows whose times can be compared: of cases that one kind of machine measured alone.

    Where several kinds measured cases, those of the kind with the most. Rows that do not tell are
    taken to be of one.
    """
    if MACHINE not in rows:
        return rows
    kinds = rows.groupby(["scene", "environment"])[MACHINE]
    alone = rows[kinds.transform("nunique") == 1]
    counts = alone.groupby(MACHINE).size()
    return alone[alone[MACHINE] == counts.idxmax()] if len(counts) else alone


def machine_sentence(rows: pd.DataFrame) -> str:
    """What to say about times where more than one kind of machine measured; else nothing."""
    kinds = sorted(rows[MACHINE].unique()) if MACHINE in rows else []
    if len(kinds) < 2:
        return ""
    parts = [timed_alike(compared(part)) for _, part in rows.groupby("budget")]
    used = pd.concat(parts) if parts else rows.iloc[:0]
    return (
        f"Measurements were measured on {len(kinds)} kinds of machine or share of one "
        f"({'; '.join(kinds)}). Times are compared within one kind only: the means of seconds are "
        f"over {len(used)} of {len(rows)} measurements, in cases that one kind measured alone."
    )


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per sampler and budget, best mean FLIP rank first within a budget.

    All figures are means over the compared cases, NaN where there is none; `maps` and `cases` say
    how many those are. `near_floor` counts the measurements whose error lies near their
    reference's noise floor, `noise_floor` is the mean floor, and `over_budget` counts the
    measurements in which even the sampler's smallest number of lights costs more than the budget.
    Seconds are means over the cases of one kind of machine (`timed_alike`).
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
    table[list(TIMES)] = timed_alike(fair).groupby("sampler")[list(TIMES)].mean()
    table["maps"] = fair["environment"].nunique()
    table["cases"] = len(fair.groupby(["scene", "environment"]))
    table["noise_floor"] = fair.groupby("sampler")["noise_floor"].mean()
    table["over_budget"] = fair.groupby("sampler")["over_budget"].sum()
    table["near_floor"] = fair.groupby("sampler")["near_noise_floor"].sum()
    table = table.reset_index()[["budget", "sampler", *table.columns[1:]]]
    return table.sort_values(["flip_rank", "rmse_rank", "sampler"], kind="stable")
