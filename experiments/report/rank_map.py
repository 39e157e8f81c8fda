"""Ranks per map that stay readable with many samplers: a heat map, and lines for a chosen few.

Samplers stand best mean rank first, maps from where the winner leads most to where it loses most:
both in order of merit. A cell's colour and figure is the sampler's rank on the map. Above run the
lines of the first few and of the baseline.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from experiments.report.figures import Looks, new_figure
from experiments.report.rankings import Ranking

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CHOSEN = 3
"""How many of the first have lines; the baseline has one, too."""
CELL, LINES = 0.24, 1.5
"""Inches of a cell and of the panel of lines."""


def merit_order(found: Ranking) -> NDArray[np.intp]:
    """The maps from where the winner leads its best rival most to where it loses most."""
    errors = found.resolved.to_numpy(np.float64)
    rivals = errors[:, 1:].min(axis=1) if errors.shape[1] > 1 else errors[:, 0]
    # Where neither has an error the two are equal, which is neither lead nor loss.
    with np.errstate(divide="ignore", invalid="ignore"):
        lead = np.where(errors[:, 0] == rivals, 1.0, errors[:, 0] / rivals)
    return np.argsort(lead, kind="stable")


def rank_map(found: Ranking, looks: Looks, order: NDArray[np.intp] | None = None) -> "Figure":
    """The heat map, samplers down and maps across, under the lines of the chosen few.

    order : of the maps, by default that of merit
    """
    order = merit_order(found) if order is None else order
    ranks = found.ranks[order].T
    count, maps = ranks.shape
    width = max(5.0, 2.2 + CELL * maps)
    height = LINES + CELL * count + 1.6
    figure = new_figure(width, height)
    above, below = figure.subplots(
        2, 1, sharex=True, gridspec_kw={"height_ratios": [LINES, CELL * count], "hspace": 0.06}
    )
    chosen = [*range(min(CHOSEN, count))]
    if found.baseline in found.samplers:
        chosen.append(found.samplers.index(found.baseline))
    _lines(above, found, ranks, list(dict.fromkeys(chosen)), looks)
    _cells(below, ranks)
    below.set_xticks(
        range(maps), [str(found.per_map.index[k]) for k in order], rotation=55, ha="right",
        rotation_mode="anchor", fontsize=7.5,
    )  # fmt: skip
    below.set_yticks(range(count), found.samplers, fontsize=8)
    for tick, sampler in zip(below.get_yticklabels(), found.samplers, strict=True):
        tick.set_color(looks[sampler].color)
    for place, mean in enumerate(found.ranks.mean(axis=0)):
        below.text(maps - 0.3, place, f"{mean:.2f}", va="center", fontsize=7.5)
    below.text(maps - 0.3, -0.75, "mean", va="center", fontsize=7, color="#555555")
    above.set_ylabel(f"rank by {found.metric.label}", fontsize=8)
    return figure


def _lines(
    axes: "Axes", found: Ranking, ranks: NDArray[np.float64], chosen: list[int], looks: Looks
) -> None:
    count, maps = ranks.shape
    for place in reversed(chosen):
        look = looks[found.samplers[place]]
        axes.plot(
            range(maps), ranks[place], color=look.color, linestyle=look.dash, marker=look.marker,
            markersize=4, linewidth=1.6, label=found.samplers[place], clip_on=False,
        )  # fmt: skip
    axes.set_ylim(count + 0.5, 0.5)
    axes.set_xlim(-0.5, maps - 0.5)
    axes.tick_params(axis="x", length=0, labelbottom=False)
    axes.set_yticks(sorted({1, (count + 1) // 2, count}))
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(chosen), frameon=False,
                fontsize=8)  # fmt: skip


def _cells(axes: "Axes", ranks: NDArray[np.float64]) -> None:
    """Ranks as colours, best light, with their figures."""
    import matplotlib as mpl

    count, maps = ranks.shape
    shades = mpl.colormaps["viridis"](np.linspace(0.97, 0.12, count))
    axes.imshow(shades[ranks.astype(np.intp) - 1], aspect="auto", interpolation="nearest",
                extent=(-0.5, maps - 0.5, count - 0.5, -0.5))  # fmt: skip
    for y in range(count):
        for x in range(maps):
            rank = int(ranks[y, x])
            dark = float(shades[rank - 1][:3] @ [0.3, 0.6, 0.1]) < 0.5
            axes.text(x, y, str(rank), ha="center", va="center", fontsize=6.5,
                      color="white" if dark else "black")  # fmt: skip
    axes.grid(False)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
