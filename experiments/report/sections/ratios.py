"""Configurations of one method against each other: mean errors and their ratios to a baseline.

The ratio of means is what papers print; the geometric mean over maps of the ratio, with its 95 %
interval (see `metrics.ranking`), weighs all maps alike. A map's error is the mean over its scenes.
"""

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.report.parts import Heading, Part, Plot, Table, Text
from experiments.report.rankings import BudgetResult, results
from experiments.report.style import FRONT, look, new_figure
from experiments.report.summary import interval
from experiments.run.experiment import Published, Section
from experiments.run.loaded_run import Run
from metrics.ranking import ratio_to_baseline
from metrics.registry import Metric, ranked_metrics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOTHING = (math.nan, math.nan)


def ratios(names: Mapping[str, str], baseline: str, published: Published | None = None) -> Section:
    """The section.

    names : what configurations are called, by the labels of their samplers
    baseline : the label of the one to whose errors ratios are
    """

    def section(run: Run) -> Iterator[Part]:
        yield Text(
            "`ratio` is the ratio of mean errors to those of the baseline, "
            f"{names[baseline]}; `interval` the geometric mean over maps of the ratio with its "
            "95 % bootstrap interval. `near` counts measurements within three times of what their "
            "reference's own noise gives."
            + (f" Columns called paper: {published.source}." if published else "")
        )
        tables = {
            result.budget: ratio_table(result, run.samplers, names, baseline, published)
            for result in results(run.rows)
        }
        for budget, table in tables.items():
            yield Heading(budget, 3)
            yield table
        rows = {budget: table.rows for budget, table in tables.items()}
        caption = f"Errors over those of {names[baseline]}, with intervals."
        yield Plot("ratios", partial(ratio_plot, rows, names[baseline]), caption)

    return section


def ratio_table(
    result: BudgetResult,
    samplers: list[str],
    names: Mapping[str, str],
    baseline: str,
    published: Published | None,
) -> Table:
    """A line per configuration of one budget, in the order of `samplers`."""
    means = result.table.set_index("sampler")
    labels = [label for label in samplers if label in means.index]
    base = labels.index(baseline) if baseline in labels else -1
    means = means.loc[labels]
    rows = pd.DataFrame(
        {"budget": result.budget, "configuration": [names.get(x, x) for x in labels]}
    )
    printed = published.values if published else {}
    formats, headings = {"configuration": "s"}, {}
    for metric in _metrics(means):
        name, label = metric.name, metric.label
        values = means[name].to_numpy()
        paper = np.array([printed.get(label, {}).get(name, NOTHING)[0] for label in labels])
        geometric = _geometric(result.by(name).resolved[labels].to_numpy(np.float64), base)
        for column, found in zip(("geometric", "low", "high"), geometric, strict=True):
            rows[f"{name}_{column}"] = found
        intervals = [interval(*line) for line in zip(*geometric, strict=True)]
        nothing = np.full(len(labels), np.nan)
        columns = {
            name: (values, f".{metric.digits}f", label),
            f"{name}_ratio": (values / values[base] if base >= 0 else nothing, ".3f", "ratio"),
            f"{name}_interval": (intervals, "s", "interval"),
            f"paper_{name}": (paper, f".{metric.digits}f", "paper"),
            f"paper_{name}_ratio": (paper / paper[base] if base >= 0 else nothing, ".3f",
                                    "ratio, paper"),
            metric.near_column: (means.get(metric.near_column, nothing), ".0f", "near"),
        }  # fmt: skip
        for column, (shown, spec, heading) in columns.items():
            rows[column] = np.asarray(shown)
            if rows[column].notna().any():
                formats[column] = spec
                headings[column] = heading if heading == label else f"{label} {heading}"
    best = {metric.name: metric.better for metric in _metrics(rows)}
    caption = f"Means over {means['maps'].iloc[0]} maps."
    return Table("ratios", rows, formats, headings, best, caption)


def _geometric(errors: np.ndarray, base: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Geometric mean over maps of the ratio to the baseline, and its interval; else NaN.

    errors : (maps, configurations), of which maps with an error of nothing are left out
    """
    positive = errors[((errors > 0.0) & np.isfinite(errors)).all(axis=1)]
    if base < 0 or not len(positive):
        nothing = np.full(errors.shape[1], np.nan)
        return nothing, nothing, nothing
    found = ratio_to_baseline(positive, base)
    return found.ratio, found.low, found.high


def _metrics(rows: pd.DataFrame) -> list[Metric]:
    return [metric for metric in ranked_metrics() if metric.name in rows]


def ratio_plot(tables: Mapping[str, pd.DataFrame], baseline: str) -> "Figure":
    """Geometric ratios with intervals, a panel per error and a line per budget and configuration.

    The paper's ratios of means are rings.
    """
    first = next(iter(tables.values()))
    names, metrics = list(first["configuration"]), _metrics(first)
    figure = new_figure(8.4, 1.5 + 0.42 * len(names))
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axes, metric in zip(panels, metrics, strict=True):
        error = metric.name
        for k, (budget, table) in enumerate(tables.items()):
            y = np.arange(len(table)) + 0.16 * (k - 0.5 * (len(tables) - 1))
            middle = table[f"{error}_geometric"]
            bars = [middle - table[f"{error}_low"], table[f"{error}_high"] - middle]
            axes.errorbar(
                middle, y, xerr=bars, capsize=2, label=budget, **look(k).line | {"linestyle": ""}
            )
        printed = first[f"paper_{error}_ratio"]
        if printed.notna().any():
            axes.plot(
                printed, np.arange(len(first)), linestyle="", marker="o", markersize=10,
                markerfacecolor="none", markeredgecolor=FRONT, label="the paper's",
            )  # fmt: skip
        axes.axvline(1.0, color="black", linewidth=0.8)
        axes.set_xlabel(f"{metric.label} over that of {baseline}")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
    panels[-1].legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize="small")
    return figure
