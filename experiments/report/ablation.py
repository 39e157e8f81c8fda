"""Configurations of one method against each other: mean errors and their ratios to a baseline.

The ratio of means is what papers print; the geometric mean over maps of the ratio, with its 95 %
interval (see `metrics.ranking`), weighs all maps alike. A map's error is the mean over its scenes.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.report.rankings import NAMES, SEED
from experiments.report.summary import ERRORS, compared
from metrics.ranking import ratio_to_baseline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = {
    "configuration": "s", "rmse": ".4f", "rmse_ratio": ".3f", "rmse_interval": "s",
    "paper_rmse": ".4f", "paper_rmse_ratio": ".3f", "flip": ".4f", "flip_ratio": ".3f",
    "flip_interval": "s", "paper_flip": ".4f", "paper_flip_ratio": ".3f", "noise_floor": ".4f",
    "near_floor": "d", "maps": "d",
}  # fmt: skip
NOTE = (
    "`ratio` is the ratio of mean errors to the baseline's, `interval` the geometric mean over "
    "maps of the ratio with its 95 % bootstrap interval. Columns called paper are the paper's own "
    "figures, from other maps, scenes and budgets, never measured here. `noise floor` is the mean "
    "error of the references themselves, `near floor` counts measurements within 3× of it."
)


def ablation_table(
    rows: pd.DataFrame,
    configurations: Mapping[str, str],
    baseline: str,
    paper: Mapping[str, Sequence[float]],
) -> pd.DataFrame:
    """One line per configuration that the rows of one budget hold.

    configurations : the name of a configuration by the label of its sampler
    baseline : a configuration's name
    paper : RMSE and FLIP by a configuration's name
    """
    fair = compared(rows)
    present = [label for label in configurations if label in set(rows["sampler"])]
    names = [configurations[label] for label in present]
    per_scene = fair.groupby(["environment", "scene", "sampler"])[list(ERRORS)].mean()
    per_map = per_scene.groupby(level=["environment", "sampler"]).mean()
    table = pd.DataFrame({"configuration": names})
    for position, error in enumerate(ERRORS):
        errors = per_map[error].unstack("sampler").reindex(columns=present)
        means = errors.mean().to_numpy()
        table[error] = means
        base = names.index(baseline) if baseline in names else -1
        table[f"{error}_ratio"] = means / means[base] if base >= 0 else np.nan
        _add_geometric(table, error, errors.to_numpy(np.float64), base)
        printed = [paper[name][position] if name in paper else np.nan for name in names]
        table[f"paper_{error}"] = printed
        whole = paper[baseline][position] if baseline in paper else np.nan
        table[f"paper_{error}_ratio"] = np.array(printed) / whole
    groups = fair.groupby("sampler")
    table["noise_floor"] = groups["noise_floor"].mean().reindex(present).to_numpy()
    near = groups["near_noise_floor"].sum().reindex(present, fill_value=0)
    table["near_floor"] = near.to_numpy().astype(int)
    table["maps"] = fair["environment"].nunique()
    return table


def _add_geometric(table: pd.DataFrame, error: str, errors: np.ndarray, base: int) -> None:
    """Columns geometric, low and high, and the three as text; missing without a baseline."""
    positive = errors[((errors > 0.0) & np.isfinite(errors)).all(axis=1)]
    columns = [f"{error}_{name}" for name in ("geometric", "low", "high")]
    if base < 0 or not len(positive):
        table[columns] = np.nan
        table[f"{error}_interval"] = None
        return
    found = ratio_to_baseline(positive, base, np.random.default_rng(SEED))
    for column, values in zip(columns, (found.ratio, found.low, found.high), strict=True):
        table[column] = values
    table[f"{error}_interval"] = [
        f"{r:.3f} [{a:.3f}, {b:.3f}]"
        for r, a, b in zip(found.ratio, found.low, found.high, strict=True)
    ]


def ratio_plot(tables: Mapping[str, pd.DataFrame], baseline: str) -> "Figure":
    """Geometric ratios with intervals, a panel per error and a line per budget and configuration.

    The paper's ratios of means are rings.
    """
    from experiments.report.figures import new_figure
    from experiments.report.palette import COLORS, MARKERS

    names = list(next(iter(tables.values()))["configuration"])
    figure = new_figure(8.4, 1.5 + 0.42 * len(names))
    panels = figure.subplots(1, len(ERRORS), sharey=True)
    for axes, error in zip(panels, ERRORS, strict=True):
        for k, (budget, table) in enumerate(tables.items()):
            y = np.arange(len(table)) + 0.16 * (k - 0.5 * (len(tables) - 1))
            middle = table[f"{error}_geometric"]
            bars = [middle - table[f"{error}_low"], table[f"{error}_high"] - middle]
            axes.errorbar(
                middle, y, xerr=bars, linestyle="", color=COLORS[k % len(COLORS)],
                marker=MARKERS[k % len(MARKERS)], markersize=5, capsize=2, label=budget,
            )  # fmt: skip
        printed = table[f"paper_{error}_ratio"]
        if printed.notna().any():
            axes.plot(
                printed, np.arange(len(table)), linestyle="", marker="o", markersize=10,
                markerfacecolor="none", markeredgecolor="#777777", label="the paper's",
            )  # fmt: skip
        axes.axvline(1.0, color="black", linewidth=0.8)
        axes.set_xlabel(f"{NAMES[error]} over that of {baseline}")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
    panels[-1].legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=8)
    return figure


def write_ablation(
    folder: Path, stem: str, tables: Mapping[str, pd.DataFrame], title: str, notes: list[str],
) -> list[Path]:  # fmt: skip
    """The tables of all budgets as one: CSV, Markdown and LaTeX."""
    from experiments.report.frames import rounded, write_frame

    whole = pd.concat(
        [table.assign(budget=budget) for budget, table in tables.items()], ignore_index=True
    )
    formats = {"budget": "s", **FORMATS}
    shown = whole.dropna(axis="columns", how="all")
    text = rounded(shown, {name: formats[name] for name in formats if name in shown})
    return write_frame(folder, stem, whole, text, title, [*notes, NOTE])
