"""Means and mean ranks of the samplers, over what can be compared.

A map's error is the mean over its scenes, a scene's the mean over seeds; ranks are per map, equal
errors share the better one. Nothing ranks what lies near the floor that the reference's own noise
sets: an error below `NEAR` times the floor counts as just that (`resolved`), so that all samplers
whose errors lie there share the place, and those above it are behind them. Only cases (scene × map)
on which every sampler has all its seeds are compared, so that neither an unfinished run nor a
failed measurement favours anyone.

Leagues: samplers side by side with those that return the same kind of lighting. A fixed set of
lights errs by bias alone, a distribution that is drawn from afresh at every point by noise; one
that looks at the surface before it draws has an easier task. The column `league` tells, in rows
that are not older than it.
"""

import pandas as pd

from experiments.run.budget import sorted_budgets
from metrics.ranking import mean_ranks
from metrics.registry import NEAR, Metric, find_metric, leading_metric, ranked_metrics

TIMES = ("seconds_lights", "seconds_render")
COSTS = ("lights", "rays", *TIMES)
MACHINE = "machine"
LEAGUE = "league"
LEAGUES = (
    "fixed lights",
    "layers",
    "disc lights",
    "distribution",
    "distribution that sees the surface",
)


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

    A case is one at one budget. Where several kinds measured cases, those of the kind with the
    most. Rows that do not tell are taken to be of one.
    """
    if MACHINE not in rows:
        return rows
    kinds = rows.groupby(["scene", "environment", "budget"])[MACHINE]
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


def errors_in(rows: pd.DataFrame) -> list[str]:
    """The names of the ranked metrics that the rows hold, in the order of a table's columns."""
    return [metric.name for metric in ranked_metrics() if metric.name in rows]


def rank_column(metric: str) -> str:
    """The column of the mean rank by a metric."""
    return f"{metric}_rank"


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per sampler and budget, best mean rank by the leading metric first in a budget.

    All figures are means over the compared cases, NaN where there is none; `maps` and `cases` say
    how many those are. By metric there are the mean value, its mean rank, the mean floor and the
    number of measurements near it; `over_budget` counts the measurements in which even the
    sampler's smallest number of lights costs more than the budget. Seconds are means over the cases
    of one kind of machine (`timed_alike`).
    """
    budgets = sorted_budgets(list(rows["budget"].unique()))
    tables = [_at_budget(rows[rows["budget"] == budget]) for budget in budgets]
    return pd.concat(tables, ignore_index=True)


def _at_budget(rows: pd.DataFrame) -> pd.DataFrame:
    fair, errors = compared(rows), errors_in(rows)
    names = pd.Index(sorted(rows["sampler"].unique()), name="sampler")
    table = pd.DataFrame({"budget": rows["budget"].iloc[0]}, index=names)
    if LEAGUE in rows:
        table[LEAGUE] = pd.Series(leagues_of(rows), dtype=object)
    for error in errors:
        per_map = errors_per_map(fair, error).reindex(columns=names)
        ranked = resolved(per_map, floors_per_map(fair, find_metric(error)))
        table[error] = per_map.mean()
        table[rank_column(error)] = mean_ranks(ranked) if len(ranked) else float("nan")
    costs = fair.assign(rays=(fair["rays_shadow"] + fair["rays_brdf"]) / fair["rays_primary"])
    table[list(COSTS)] = costs.groupby("sampler")[list(COSTS)].mean()
    table[list(TIMES)] = timed_alike(fair).groupby("sampler")[list(TIMES)].mean()
    table["maps"] = fair["environment"].nunique()
    table["cases"] = len(fair.groupby(["scene", "environment"]))
    table["over_budget"] = fair.groupby("sampler")["over_budget"].sum()
    for metric in ranked_metrics():
        if metric.near_column in fair:
            groups = fair.groupby("sampler")
            table[metric.floor_column] = groups[metric.floor_column].mean()
            table[metric.near_column] = groups[metric.near_column].sum()
    table = table.reset_index()[["budget", "sampler", *table.columns[1:]]]
    leads = leading_metric().name
    order = [leads, *(error for error in reversed(errors) if error != leads)]
    return table.sort_values([*map(rank_column, order), "sampler"], kind="stable")


def errors_per_map(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Errors, maps × samplers: seeds are averaged first, then scenes."""
    return errors_per_case(rows, metric).groupby(level="environment").mean()


def errors_per_case(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Errors, cases × samplers: means over seeds."""
    case = ["scene", "environment", "sampler"]
    return rows.groupby(case)[metric].mean().unstack("sampler")


def floors_per_map(rows: pd.DataFrame, metric: Metric) -> pd.Series:
    """What the references' own noise gives, by map: the mean over scenes, as of errors."""
    return floors_per_case(rows, metric).groupby(level="environment").mean()


def floors_per_case(rows: pd.DataFrame, metric: Metric) -> pd.Series:
    """What the references' own noise gives, by case; NaN where the rows do not tell."""
    floors = rows.get(metric.floor_column, pd.Series(float("nan"), rows.index))
    return floors.groupby([rows["scene"], rows["environment"]]).mean()


def resolved(errors: pd.DataFrame, floors: pd.Series) -> pd.DataFrame:
    """Errors (blocks × samplers) as they are ranked: none below `NEAR` times its block's floor."""
    least = NEAR * floors.reindex(errors.index)
    return errors.mask(errors.lt(least, axis="index"), least, axis="index")


def leagues_of(rows: pd.DataFrame) -> dict[str, str]:
    """The league of every sampler by its label; empty where the rows do not tell."""
    if LEAGUE not in rows:
        return {}
    found = rows.dropna(subset=[LEAGUE]).groupby("sampler", sort=True)[LEAGUE].first()
    return {str(sampler): str(league) for sampler, league in found.items()}


def in_order(leagues: dict[str, str]) -> list[str]:
    """The leagues that have members, the known ones first."""
    present = set(leagues.values())
    return [*(name for name in LEAGUES if name in present), *sorted(present - set(LEAGUES))]
