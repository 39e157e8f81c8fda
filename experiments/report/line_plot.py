"""Lines over an axis, one per label."""

from typing import TYPE_CHECKING

import pandas as pd

from experiments.report.palette import COLORS, MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def line_plot(
    rows: pd.DataFrame, x: str, y: str, label: str,
    axes_labels: tuple[str, str], log_y: bool = True, log_x: bool = True,
) -> "Figure":  # fmt: skip
    """Column `y` over column `x`, one line per value of `label`, in order of appearance.

    Where the columns y_lower and y_upper exist they become error bars.
    """
    from matplotlib.figure import Figure

    figure = Figure((7.0, 4.2), layout="constrained", facecolor="white")
    axes = figure.add_subplot()
    for index, (name, part) in enumerate(rows.groupby(label, sort=False)):
        part = part.sort_values(x)
        bars = None
        if f"{y}_lower" in part:
            bars = [part[y] - part[f"{y}_lower"], part[f"{y}_upper"] - part[y]]
        axes.errorbar(
            part[x], part[y], bars, label=str(name), color=COLORS[index % len(COLORS)],
            marker=MARKERS[index % len(MARKERS)], markersize=4, linewidth=1.3, capsize=2,
        )  # fmt: skip
    if log_x:
        axes.set_xscale("log")
    if log_y:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlabel(axes_labels[0])
    axes.set_ylabel(axes_labels[1])
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure
