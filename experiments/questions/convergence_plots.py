"""Error against cost, log–log: a panel per class of maps, a line per sampler, the Pareto front.

Points near the noise floor of their references are hollow.
"""

import math
from typing import TYPE_CHECKING

import pandas as pd

from experiments.questions.convergence_tables import COSTS
from experiments.report.figures import Looks, new_figure, pareto_front
from metrics.registry import Metric

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 5
PANEL = (3.0, 2.5)


def convergence_plot(
    points: pd.DataFrame, metric: Metric, cost: str, looks: Looks, front: bool
) -> "Figure":
    """The metric over `cost` of the points, one panel per class in their order.

    front : whether to draw the Pareto front over total seconds
    """
    classes = list(dict.fromkeys(points["class"]))
    columns = min(COLUMNS, len(classes))
    rows = math.ceil(len(classes) / columns)
    figure = new_figure(PANEL[0] * columns + 2.2, PANEL[1] * rows + 0.6)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes in panels.flat[len(classes) :]:
        axes.set_visible(False)
    for axes, name in zip(panels.flat, classes, strict=False):
        _panel(axes, points[points["class"] == name], metric, cost, looks, front)
        axes.set_title(name, fontsize=9)
    for axes in panels[:, 0]:
        axes.set_ylabel(metric.label)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="center left", bbox_to_anchor=(0.91, 0.5), frameon=False,
                  fontsize=8)  # fmt: skip
    figure.supxlabel(COSTS[cost], fontsize=9, y=0.0, va="top")
    return figure


def _panel(
    axes: "Axes", points: pd.DataFrame, metric: Metric, cost: str, looks: Looks, front: bool
) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    error = metric.name
    axes.set_xscale("log")
    axes.set_yscale("log")
    good = points[(points[error] > 0.0) & (points[cost] > 0.0)]
    if front and len(good):
        best = pareto_front(good.assign(seconds=good[cost], error=good[error]))
        axes.plot(
            best["seconds"], best["error"], color="#888888", linewidth=6, alpha=0.28,
            drawstyle="steps-post", label="Pareto front", zorder=1,
        )  # fmt: skip
    for sampler, part in good.groupby("sampler", sort=True):
        look, ordered = looks[str(sampler)], part.sort_values(cost, kind="stable")
        axes.plot(
            ordered[cost], ordered[error], color=look.color, linestyle=look.dash, linewidth=1.1,
            marker=look.marker, markersize=4.5, label=str(sampler),
        )  # fmt: skip
        near = ordered[ordered[metric.near_column]]
        axes.plot(near[cost], near[error], color=look.color, linestyle="", marker=look.marker,
                  markersize=4.5, markerfacecolor="white")  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    axes.tick_params(labelsize=7)
