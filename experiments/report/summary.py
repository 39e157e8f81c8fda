"""Means and mean ranks of the samplers, over what can be compared.

A map's error is the mean over its scenes, a scene's the mean over seeds; ranks are per map, equal
errors share the better one. Nothing ranks what lies near the floor that the reference's own noise
sets: an error below `NEAR` times the floor counts as just that (`resolved`), so that all samplers
whose errors lie there share the place, and those above it are behind them. Only cases (scene × map)
on which every sampler has all its seeds are compared, so that neither an unfinished run nor a
failed measurement favours anyone.

Leagues: samplers side by side with those that return the same kind of lighting. A fixed set of
lights errs by bias alone, a distribution that is drawn from afresh at every point by noise; one
that looks at the surface before it draws has an easier task.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from experiments.report.style import LEAGUES, label_of
from experiments.run.bench import seconds_allowed
from experiments.run.budget import ALLOWED, Budget, sorted_budgets
from metrics.ranking import block_ranks, mean_rank_intervals
from metrics.registry import NEAR, Better, Metric, find_metric, leading_metric, ranked_metrics

MACHINE = "machine"
MOST_RANKED = 40
"""Of more configurations than these a run asks something else than which sampler is best."""
LEAGUE = "league"
MOST_SPENT = 1.1
"""Who spends more than this times a budget of rays or time, in the mean, is not ranked at it."""
OVER = "†"
"""Marks who is not ranked because of that."""
OF_SAMPLERS = ("sampler", "against", "method", "renderer", "lighting", "average", "run as")
"""Columns of samplers' names, for which tables show labels."""
ALIKE = "≈"
"""Marks who is not significantly different from the first."""


@dataclass(frozen=True)
class Column:
    """All that is known of a column: terminal, Markdown, LaTeX, CSV and pages read it.

    name : in CSV files
    heading : in tables
    format : how its values are printed, as for `format`; without one it stands in CSV alone
    short : its heading on a terminal, where tables are narrow; without one it is not shown there
    better : which values are the better ones, where some are
    of : by row, what a cost is the mean of
    key : in the summary and in JSON, where that is another unit; `times` leads from there to here
    timed : whether only cases count that one kind of machine measured
    """

    name: str
    heading: str = ""
    format: str = ""
    short: str = ""
    better: Better | None = None
    of: Callable[[pd.DataFrame], pd.Series] | None = None
    key: str = ""
    times: float = 1.0
    timed: bool = False

    @property
    def place(self) -> str:
        """Its column in the summary."""
        return self.key or self.name

    def values(self, summary: pd.DataFrame) -> pd.Series:
        """Its values, in its unit."""
        found = summary[self.place]
        return found if self.times == 1.0 else self.times * found

    def text(self, value: object) -> str:
        """A value as it is printed; a dash where there is none."""
        return as_printed(value, self.format, self.name)


COSTS = (
    Column("lights", "lights", ".1f", of=lambda rows: rows["lights"]),
    Column(
        "rays", "rays", ".1f", "rays",
        of=lambda rows: (rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"],
    ),
    Column(
        "prepare_ms", "prepare ms", ".1f", "prep ms", of=lambda rows: rows["seconds_lights"],
        key="seconds_lights", times=1e3, timed=True,
    ),
    Column(
        "render_ms", "render ms", ".0f", "rend ms", of=lambda rows: rows["seconds_render"],
        key="seconds_render", times=1e3, timed=True,
    ),
)  # fmt: skip
"""What an image takes: rays are per sub-pixel."""


def summary_columns(table: pd.DataFrame, baselines: Mapping[str, str]) -> list[Column]:
    """The columns of a summary, in the order of tables.

    baselines : to whose error ratios are, by metric
    """
    found = [Column("budget"), Column("sampler", "sampler", "s", "sampler"),
             Column(LEAGUE, LEAGUE, "s")]  # fmt: skip
    for metric in ranked_metrics():
        name = metric.name
        found += [
            Column(name, metric.label, f".{metric.digits}f", metric.label, metric.better),
            Column(rank_column(name), "rank", ".2f", "rank", "less"),
            Column(f"{name}_rank_margin", "±", ".2f", "±"),
            *(
                Column(f"{name}_{part}")
                for part in ("rank_low", "rank_high", "ratio", "low", "high")
            ),
            Column(f"{name}_interval", f"× {label_of(baselines.get(name, ''))}", "s"),
            Column(f"{name}_alike", ALIKE, "s"),
            Column(metric.near_column, "near", ".0f"),
        ]
    found += [*COSTS, Column("maps"), Column("cases")]
    return [column for column in found if column.place in table]


def as_printed(value: object, spec: str, column: str = "") -> str:
    """A value as tables have it; a dash where there is none. column : that it stands in"""
    if column in OF_SAMPLERS or "=" in str(value):  # a sampler with parameters, or its budget
        return label_of(str(value))
    return "–" if pd.isna(value) else format(value, spec)  # type: ignore[call-overload]


def interval(ratio: float, low: float, high: float) -> str:
    """A ratio with its interval: "1.35 [1.20, 1.52]"."""
    return "–" if math.isnan(ratio) else f"{ratio:.2f} [{low:.2f}, {high:.2f}]"


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


def spent(rows: pd.DataFrame) -> pd.Series:
    """What each row of one budget of rays or time took, as a share of what it might."""
    budget = Budget.parse(rows["budget"].iloc[0])
    if budget.timed:
        return rows["seconds_render"] / seconds_allowed(rows)
    rays = (rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"]
    return rays / (rows[ALLOWED] if budget.like else budget.amount)


def over_budget(rows: pd.DataFrame) -> set[str]:
    """The samplers that take more than `MOST_SPENT` times the one budget of the rows."""
    if rows.empty or Budget.parse(rows["budget"].iloc[0]).kind == "lights":
        return set()
    means = spent(rows).groupby(rows["sampler"]).mean()
    return set(map(str, means.index[means > MOST_SPENT]))


def overspent(rows: pd.DataFrame) -> set[str]:
    """Those over the budget, which compare with nobody there; none where all are."""
    over = over_budget(rows)
    return over if len(over) < rows["sampler"].nunique() else set()


def unranked(table: pd.DataFrame) -> list[str]:
    """The samplers of a summary of one budget that are over it."""
    none = table[rank_column(leading_metric().name)].isna() & (table["maps"] > 0)
    return list(table.loc[none, "sampler"])


def errors_in(rows: pd.DataFrame) -> list[str]:
    """The names of the ranked metrics that the rows hold, in the order of a table's columns."""
    return [metric.name for metric in ranked_metrics() if metric.name in rows]


def rank_column(metric: str) -> str:
    """The column of the mean rank by a metric."""
    return f"{metric}_rank"


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per sampler and budget, best mean rank by the leading metric first in a budget.

    All figures are means over the compared cases, NaN where there is none; `maps` and `cases` say
    how many those are. By metric there are the mean value, its mean rank with the 95 % interval of
    a bootstrap over maps and half its width, the mean floor and the number of measurements near it;
    `over_budget` counts the measurements in which even the sampler's smallest number of lights
    costs more than the budget; who is far over it (`overspent`) has errors and costs, no rank, and
    stands last. Seconds are means over the cases of one kind of machine (`timed_alike`).
    """
    budgets = sorted_budgets(list(rows["budget"].unique()))
    tables = [_at_budget(rows[rows["budget"] == budget]) for budget in budgets]
    return pd.concat(tables, ignore_index=True)


def _at_budget(rows: pd.DataFrame) -> pd.DataFrame:
    fair, errors = compared(rows), errors_in(rows)
    over = overspent(fair)
    names = pd.Index(sorted(rows["sampler"].unique()), name="sampler")
    table = pd.DataFrame({"budget": rows["budget"].iloc[0]}, index=names)
    if LEAGUE in rows:
        table[LEAGUE] = pd.Series(leagues_of(rows), dtype=object)
    for error in errors:
        per_map, ranked = both_errors(fair, find_metric(error), names)
        ranked = ranked.drop(columns=list(over))
        table[error] = per_map.mean()
        mean = low = high = np.full(ranked.shape[1], np.nan)
        if len(ranked):
            ranks = block_ranks(ranked)
            mean = ranks.mean(axis=0)
            low, high = mean_rank_intervals(ranks)
        margin = (high - low) / 2 if len(ranked) > 1 else np.nan
        for end, values in {"": mean, "_margin": margin, "_low": low, "_high": high}.items():
            table[f"{rank_column(error)}{end}"] = pd.Series(values, ranked.columns)
    for cost in COSTS:
        assert cost.of is not None
        used = timed_alike(fair) if cost.timed else fair
        table[cost.place] = cost.of(used).groupby(used["sampler"]).mean()
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


def both_errors(
    rows: pd.DataFrame, metric: Metric, samplers: Sequence[str]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors, maps × samplers: as they were measured, and as they are ranked."""
    per_map = errors_per_map(rows, metric.name).reindex(columns=list(samplers))
    return per_map, resolved(per_map, floors_per_map(rows, metric))


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
