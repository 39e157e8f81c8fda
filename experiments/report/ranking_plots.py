"""The plots of a ranking: ranks per map, pairs of samplers, and which differ surely.

Rank map: a heat map, samplers best mean rank first, maps from where the winner leads most to where
it loses most, so that it stays readable with many; above it lines of the first few and of the
baseline.

Matrix of pairs: a cell compares the sampler of its row with that of its column. The colour and the
upper figure are the geometric mean over maps of the row's error over the column's, the lower
figures the numbers of maps on which the row's error is smaller, equal and larger. Bold is what the
test tells apart. In form it is that of Ismail-Fawaz et al., "An approach to multiple comparison
benchmark evaluations that is stable under manipulation of the comparate set", 2023.

Critical-difference diagram: mean ranks on a line, bars over samplers that Nemenyi's test does not
tell apart; its form is that of Demšar, "Statistical comparisons of classifiers over multiple data
sets", JMLR 7, 2006.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from experiments.report.rankings import LEVEL, Ranking
from experiments.report.style import INK, Looks, label_of, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CHOSEN = 3
"""How many of the first have lines; the baseline has one, too."""
CELL, LINES = 0.24, 1.5
"""Inches of a cell and of the panel of lines."""
PAIR_CELL = 0.52
"""Inches of a cell."""
STRONGEST = 4.0
"""Ratios of this and beyond, either way, have the full colour."""


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
        rotation_mode="anchor", fontsize="small",
    )  # fmt: skip
    below.set_yticks(range(count), list(map(label_of, found.samplers)), fontsize="small")
    for place, mean in enumerate(found.ranks.mean(axis=0)):
        below.text(maps - 0.3, place, f"{mean:.2f}", va="center", fontsize="small")
    below.text(maps - 0.3, -0.75, "mean", va="center", fontsize="small", color=INK)
    above.set_ylabel(f"rank by {found.metric.label}", fontsize="small")
    return figure


def _lines(
    axes: "Axes", found: Ranking, ranks: NDArray[np.float64], chosen: list[int], looks: Looks
) -> None:
    count, maps = ranks.shape
    for place in reversed(chosen):
        sampler = found.samplers[place]
        axes.plot(
            range(maps), ranks[place], label=label_of(sampler), clip_on=False, **looks[sampler].line
        )
    axes.set_ylim(count + 0.5, 0.5)
    axes.set_xlim(-0.5, maps - 0.5)
    axes.tick_params(axis="x", length=0, labelbottom=False)
    axes.set_yticks(sorted({1, (count + 1) // 2, count}))
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(chosen), fontsize="small")


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
            axes.text(x, y, str(rank), ha="center", va="center", fontsize="x-small",
                      color="white" if dark else "black")  # fmt: skip
    axes.grid(False)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def pair_matrix(found: Ranking) -> "Figure":
    """The matrix of one ranking, the best mean rank first."""
    import matplotlib as mpl

    pairs, count = found.pairs, len(found.samplers)
    figure = new_figure(2.0 + PAIR_CELL * count, 1.9 + PAIR_CELL * count)
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
            ink = "white" if float(colors[y, x, :3] @ [0.3, 0.6, 0.1]) < 0.5 else INK
            axes.text(
                x, y - 0.14, "–" if np.isnan(ratio) else f"{ratio:.2f}", ha="center", va="center",
                fontsize="small", fontweight="bold" if sure else "normal", color=ink,
                in_layout=False,
            )  # fmt: skip
            record = f"{pairs.wins[y, x]}·{pairs.ties[y, x]}·{pairs.losses[y, x]}"
            axes.text(x, y + 0.24, record, ha="center", va="center", fontsize="xx-small", color=ink,
                      in_layout=False)  # fmt: skip
    labels = list(map(label_of, found.samplers))
    axes.set_xticks(
        range(count), labels, rotation=50, ha="left", rotation_mode="anchor", fontsize="small"
    )
    axes.set_yticks(range(count), labels, fontsize="small")
    axes.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_xlabel(f"{found.metric.label} of the row over that of the column; maps on which the "
                    "row's is smaller · equal · larger", fontsize="small")  # fmt: skip
    return figure


def difference_diagram(found: Ranking, looks: Looks) -> "Figure":
    """Mean ranks, best to the left, with bars over groups that are not told apart."""
    count = len(found.samplers)
    half = (count + 1) // 2
    bars = len(found.groups)
    low, high = 1.0, float(max(count, 2))
    figure = new_figure(8.0, 1.1 + 0.17 * bars + 0.27 * half)
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set_xlim(low - 0.30 * (high - low), high + 0.30 * (high - low))
    axes.plot([low, high], [0, 0], color="black", linewidth=1.2)
    for tick in range(1, int(high) + 1):
        axes.plot([tick, tick], [0, 0.15], color="black", linewidth=1.0)
        axes.text(tick, 0.25, str(tick), ha="center", va="bottom", fontsize="small")
    first = -0.55 - 0.45 * bars
    order = np.argsort(found.test_ranks, kind="stable")
    for place, index in enumerate(order):
        left = place < half
        level = first - 0.75 * (place if left else count - 1 - place)
        edge = low - 0.04 * (high - low) if left else high + 0.04 * (high - low)
        rank, sampler = float(found.test_ranks[index]), found.samplers[index]
        color = looks[sampler].color
        axes.plot([rank, rank, edge], [0, level, level], color=color, linewidth=1.2)
        axes.plot([rank], [0], color=color, marker=looks[sampler].marker, markersize=6)
        name = label_of(sampler)
        words = f"{name}  {rank:.2f}" if left else f"{rank:.2f}  {name}"
        axes.text(edge, level, f" {words} ", ha="right" if left else "left", va="center")
    for level, members in enumerate(found.groups):
        ranks = found.test_ranks[list(members)]
        y = -0.4 - 0.45 * level
        axes.plot([ranks.min() - 0.04, ranks.max() + 0.04], [y, y], color=INK, linewidth=4,
                  solid_capstyle="round")  # fmt: skip
    ruler = min(found.difference, high - low)
    axes.plot([low, low + ruler], [1.5, 1.5], color="black", linewidth=1.6)
    for end in (low, low + ruler):
        axes.plot([end, end], [1.38, 1.62], color="black", linewidth=1.2)
    axes.text(
        low, 1.75, f"critical difference {found.difference:.2f}"
        + (" (wider than the axis)" if found.difference > high - low else "")
        + f": {count} samplers, {len(found.per_map)} maps, {found.metric.label}"
        + (f"; Friedman p = {found.friedman.p_value:.2g}" if found.friedman else ""),
        fontsize="small",
    )  # fmt: skip
    axes.set_ylim(first - 0.75 * half + 0.2, 2.4)
    return figure
