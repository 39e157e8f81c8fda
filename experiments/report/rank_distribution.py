"""How often each sampler takes which rank: a bar a sampler, parted by the maps' ranks."""

from typing import TYPE_CHECKING

import numpy as np

from experiments.report.figures import new_figure
from experiments.report.rankings import Ranking

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_SHARE = 0.045
"""Parts narrower than this hold no number."""


def rank_distribution(found: Ranking) -> "Figure":
    """One bar a sampler, best mean rank on top; lengths are numbers of maps."""
    import matplotlib as mpl

    count, maps = len(found.samplers), len(found.ranks)
    shades = mpl.colormaps["viridis"](np.linspace(0.95, 0.1, count))
    figure = new_figure(7.6, 1.3 + 0.3 * count)
    axes = figure.add_subplot()
    for place in range(count):
        left = 0
        for rank in range(1, count + 1):
            size = int((found.ranks[:, place] == rank).sum())
            if not size:
                continue
            shade = shades[rank - 1]
            axes.barh(place, size, left=left, color=shade, edgecolor="white", linewidth=0.7)
            if size >= LEAST_SHARE * maps:
                ink = "black" if float(shade[:3] @ [0.3, 0.6, 0.1]) > 0.5 else "white"
                axes.text(left + 0.5 * size, place, str(rank), ha="center", va="center",
                          fontsize=8, color=ink)  # fmt: skip
            left += size
        axes.text(maps * 1.01, place, f"{found.ranks[:, place].mean():.2f}", va="center")
    axes.text(maps * 1.01, -0.9, "mean", fontsize=8)
    axes.set_yticks(range(count), found.samplers)
    axes.set_ylim(count - 0.4, -0.6)
    axes.set_xlim(0, maps)
    axes.grid(False)
    axes.set_xlabel(f"maps on which a sampler has the rank written in the bar, by "
                    f"{found.metric.label}")  # fmt: skip
    return figure
