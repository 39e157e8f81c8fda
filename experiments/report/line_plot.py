"""Lines over an axis, one per label: SVG and PNG, the same bytes for equal numbers."""

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from experiments.report.figures import STYLE, write_figure
from experiments.report.palette import COLORS, MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESOLUTION = 150
SUFFIXES = ("svg", "png")


def write_lines(
    folder: Path, stem: str, rows: pd.DataFrame, x: str, y: str, label: str,
    axes_labels: tuple[str, str], log_y: bool = True, log_x: bool = True,
) -> list[Path]:  # fmt: skip
    """Plot column `y` over column `x`, one line per value of `label`, in order of appearance.

    Where the columns y_lower and y_upper exist they become error bars.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
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
        return save_plot(figure, folder, stem)


def save_plot(figure: "Figure", folder: Path, stem: str) -> list[Path]:
    """Write a figure as SVG and PNG, without dates; returns the files."""
    files = [folder / f"{stem}.{suffix}" for suffix in SUFFIXES]
    for file in files:
        write_figure(figure, file, dpi=RESOLUTION)
    return files
