"""Every sampler against every other as a picture: the matrix of their pairwise comparisons.

A cell compares the sampler of its row with that of its column: the colour and the upper figure are
the geometric mean over maps of the row's error over the column's, the lower figures the numbers of
maps on which the row's error is smaller, equal and larger. Bold is what Wilcoxon's signed-rank test
of the pair tells apart after Holm's correction. In form it is the multi-comparison matrix of
Ismail-Fawaz et al., "An approach to multiple comparison benchmark evaluations that is stable under
manipulation of the comparate set", 2023.
"""

from typing import TYPE_CHECKING

import numpy as np

from experiments.report.figures import new_figure
from experiments.report.rankings import LEVEL, Ranking

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELL = 0.52
"""Inches of a cell."""
STRONGEST = 4.0
"""Ratios of this and beyond, either way, have the full colour."""


def pair_matrix(found: Ranking) -> "Figure":
    """The matrix of one ranking, the best mean rank first."""
    import matplotlib as mpl

    pairs, count = found.pairs, len(found.samplers)
    figure = new_figure(2.0 + CELL * count, 1.9 + CELL * count)
    axes = figure.add_subplot()
    strength = np.log(np.nan_to_num(pairs.ratio, nan=1.0)) / np.log(STRONGEST)
    colors = mpl.colormaps["RdBu_r"](0.5 + 0.5 * 0.8 * np.clip(strength, -1.0, 1.0))
    colors[range(count), range(count)] = (0.93, 0.93, 0.93, 1.0)
    axes.imshow(colors, interpolation="nearest")
    for y in range(count):
        for x in range(count):
            if x == y:
                continue
            sure = bool(pairs.p_value[y, x] <= LEVEL)
            ratio = float(pairs.ratio[y, x])
            ink = "white" if float(colors[y, x, :3] @ [0.3, 0.6, 0.1]) < 0.5 else "#222222"
            axes.text(
                x, y - 0.14, "–" if np.isnan(ratio) else f"{ratio:.2f}", ha="center", va="center",
                fontsize=7.5, fontweight="bold" if sure else "normal", color=ink, in_layout=False,
            )  # fmt: skip
            record = f"{pairs.wins[y, x]}·{pairs.ties[y, x]}·{pairs.losses[y, x]}"
            axes.text(x, y + 0.24, record, ha="center", va="center", fontsize=5.5, color=ink,
                      in_layout=False)  # fmt: skip
    axes.set_xticks(range(count), found.samplers, rotation=50, ha="left", rotation_mode="anchor",
                    fontsize=8)  # fmt: skip
    axes.set_yticks(range(count), found.samplers, fontsize=8)
    axes.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_xlabel(f"{found.metric.label} of the row over that of the column; maps on which the "
                    "row's is smaller · equal · larger", fontsize=8)  # fmt: skip
    return figure
