"""Values by method: dots for single values, a bar for their mean, rings for published ones."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def dot_plot(
    rows: pd.DataFrame, value: str, label: str, axis: str, published: Mapping[str, float],
    log: bool = False,
) -> "Figure":  # fmt: skip
    """Column `value` of each of the methods in column `label`, in order of appearance.

    published : values printed by a paper, by method; drawn as rings and said so in the legend
    """
    from matplotlib.figure import Figure

    names = list(dict.fromkeys([*map(str, rows[label]), *published]))
    figure = Figure((7.0, 1.1 + 0.34 * len(names)), layout="constrained", facecolor="white")
    axes = figure.add_subplot()
    for place, name in enumerate(names):
        values = rows.loc[rows[label] == name, value].to_numpy(np.float64)
        values = values[np.isfinite(values)]
        if len(values):
            axes.plot(values, np.full(len(values), place), "o", color="#88ccee", markersize=4)
            middle = np.exp(np.log(values).mean()) if log else values.mean()
            axes.plot([middle], [place], "|", color="#332288", markersize=15, markeredgewidth=3)
    if published:
        places = [names.index(name) for name in published]
        axes.plot(
            list(published.values()), places, "D", markerfacecolor="none", color="#cc6677",
            markersize=8, markeredgewidth=1.6, label="the paper's",
        )  # fmt: skip
        figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    if log:
        axes.set_xscale("log")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel(axis)
    return figure
