"""How the report's plots are drawn and written, and the plots of plain tables: lines, dots, fronts.

Each is written as SVG, PDF and PNG, in a published folder as SVG alone, with the same bytes
whenever the numbers are.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.report.rankings import BudgetResult
from experiments.report.style import (
    COLORS,
    FONT,
    INK,
    REST,
    STYLE,
    Looks,
    label_of,
    look,
    new_figure,
)
from experiments.report.summary import rank_column
from metrics.registry import Metric

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

SUFFIXES = ("svg", "pdf", "png")
KEPT = ("svg",)
"""What a published folder keeps of them."""
MARGIN = 0.1
"""Inches around what is drawn."""
COLUMNS, LARGE, SMALL = 4, (9.0, 4.6), 1.9
"""Of plots over time: small panels in a row; inches of the large one, and height of the others."""
MOST_RELATIVE = 12.0
"""Errors beyond this times the least are not shown there."""
LINE_OF_TEXT = 12.0
"""Points between two names."""
PLACES = re.compile(r'\b(?:x|y|d|points|transform|width|height)="[^"]*"')
DECIMALS = re.compile(r"(\.\d\d)\d+")
NO_TURN = re.compile(r' transform="rotate\(-?0 [^"]*"')
ALONE = re.compile(r'<g id="\w+">\n(<(?:text|path)\b[^<>]*(?:/>|>[^<]*</text>))\n</g>')
STYLED = re.compile(r' style="([^"]*)"')
NAMED = f"font-family: '{FONT}', sans-serif"
METADATA: dict[str, dict[str, None]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None},
    "png": {},
}


def save_plot(
    folder: Path, stem: str, draw: "Callable[[], Figure]", suffixes: Sequence[str] = ()
) -> str:
    """Draw a figure under the report's style and write it with the suffixes, or all of them;
    returns the stem.
    """
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        return save_figure(folder, stem, draw(), suffixes)


def save_figure(folder: Path, stem: str, figure: "Figure", suffixes: Sequence[str] = ()) -> str:
    """Write a figure that was made under `STYLE`, with the suffixes, or all; returns the stem."""
    figure.draw_without_rendering()
    box = figure.get_tightbbox().padded(MARGIN)
    for suffix in suffixes or SUFFIXES:
        write_figure(figure, folder / f"{stem}.{suffix}", dpi=110, bbox_inches=box)
    return stem


def write_figure(figure: "Figure", path: Path, **options: Any) -> None:
    """Write a figure, without dates; as PNG in 256 colours, which plots hardly exceed."""
    from PIL import Image

    from renderer.image import write_whole

    suffix = path.suffix[1:]

    def write(place: Path) -> None:
        drawn = BytesIO()
        # Names within an SVG are hashes of printed arrays, which NumPy prints otherwise once
        # colour-science was imported.
        with np.printoptions(legacy=False):
            figure.savefig(drawn, format=suffix, metadata=METADATA[suffix], **options)
        if suffix == "png":
            with Image.open(drawn) as picture:
                few = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
            few.save(place, "PNG", optimize=True)
        elif suffix == "svg":
            place.write_text(_compact(drawn.getvalue().decode()), encoding="utf-8")
        else:
            place.write_bytes(drawn.getvalue())

    write_whole(path, write)


def _compact(svg: str) -> str:
    """An SVG without indentation, its places rounded to a hundredth of a point.

    The font is named once, and so is every style that several elements have; turns by nothing and
    groups of one element are left out: of a heatmap that is half of the file.
    """

    def rounded(match: re.Match[str]) -> str:
        return DECIMALS.sub(r"\1", match[0])

    svg = PLACES.sub(rounded, re.sub(r" *\n *", "\n", svg))
    svg = ALONE.sub(r"\1", NO_TURN.sub("", svg)).replace(f"; {NAMED}", "")
    often = [style for style, count in Counter(STYLED.findall(svg)).items() if count > 1]
    names = {style: f"s{index}" for index, style in enumerate(often)}

    def named(match: re.Match[str]) -> str:
        return f' class="{names[match[1]]}"' if match[1] in names else match[0]

    rules = "".join(f".{name}{{{style}}}" for style, name in names.items())
    return STYLED.sub(named, svg).replace("</style>", f"text{{{NAMED}}}{rules}</style>", 1)


def pareto_front(points: pd.DataFrame) -> pd.DataFrame:
    """The points (columns seconds, error) that no other beats in both, fastest first.

    Points whose seconds are NaN are left out.
    """
    known = points[points["seconds"].notna()]
    ordered = known.sort_values(["seconds", "error"], kind="stable")
    return ordered[ordered["error"] < ordered["error"].cummin().shift(fill_value=math.inf)]


def pareto_points(results: list[BudgetResult], metric: Metric) -> pd.DataFrame:
    """One point per sampler and budget that is ranked: error, and seconds to prepare and render."""
    table = pd.concat([result.table for result in results], ignore_index=True)
    points = pd.DataFrame(
        {
            "sampler": table["sampler"],
            "budget": table["budget"],
            "near": False,
            "seconds": table["seconds_lights"] + table["seconds_render"],
            "error": table[metric.name],
        }
    )
    ranked = table[rank_column(metric.name)].notna()
    return points[ranked & (points["error"] > 0.0) & (points["seconds"] > 0.0)]


def label_plainly(axis: "Axis", multiples: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Plain figures, such as 0.05, at these multiples of powers of ten of a logarithmic axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=multiples))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def relative_errors(points: pd.DataFrame) -> pd.Series:
    """Errors of points (columns seconds, error; positive) over the least that anybody has in the
    same time: the front's, between whose points logarithms are interpolated.
    """
    front = np.log(pareto_front(points)[["seconds", "error"]].to_numpy(np.float64))
    return points["error"] / np.exp(np.interp(np.log(points["seconds"]), *front.T))


def pareto_plot(points: pd.DataFrame, metric: Metric, looks: Looks, cost: str) -> "Figure":
    """Mean error against mean cost, log–log, of points as for `over_time_plot`; all have names."""
    names = points["sampler"].nunique()
    figure = new_figure(8.0, max(4.6, names * LINE_OF_TEXT / 72.0 / 0.77))
    axes = figure.add_subplot()  # 0.77 of the figure's height
    _over_time(axes, points, "error", looks)
    _name_ends(axes, points, "error", looks, others=True)
    axes.set_ylabel(f"mean {metric.label}")
    axes.set_xlabel(cost)
    return figure


def over_time_plot(
    panels: Mapping[str, pd.DataFrame], metric: Metric, looks: Looks, cost: str
) -> "Figure":
    """Errors over the least at the same cost: the first panel large, the others small below.

    Samplers on the Pareto front have a colour and their name at the line, all others are grey.

    panels : by title, points (columns sampler, seconds, error, and near: whether within the noise)
    cost : what the seconds are
    """
    small = len(panels) - 1
    columns, rows = min(COLUMNS, max(1, small)), math.ceil(small / COLUMNS)
    heights = [LARGE[1], *[SMALL] * rows]
    figure = new_figure(LARGE[0], sum(heights))
    grid = figure.add_gridspec(1 + rows, columns, height_ratios=heights, hspace=0.35)
    for place, (title, points) in enumerate(panels.items()):
        points = points[(points["error"] > 0.0) & (points["seconds"] > 0.0)]
        points = points.assign(relative=relative_errors(points))
        row, column = divmod(place - 1, columns)
        axes = figure.add_subplot(grid[1 + row, column] if place else grid[0, :])
        axes.set_title(title)
        _over_time(axes, points, "relative", looks, (1.0,) if place else (1.0, 2.0, 5.0))
        axes.set_ylim(0.93, min(MOST_RELATIVE, 1.15 * float(points["relative"].max())))
        if not place:
            _name_ends(axes, points, "relative", looks)
            axes.set_ylabel(f"{metric.label} over the least at the same cost")
            axes.set_xlabel(cost)
    return figure


def _over_time(
    axes: "Axes",
    points: pd.DataFrame,
    value: str,
    looks: Looks,
    multiples: Sequence[float] = (1, 2, 5),
) -> None:
    members = set(pareto_front(points)["sampler"])
    axes.set_xscale("log")
    axes.set_yscale("log")
    for sampler, part in points.sort_values("seconds", kind="stable").groupby("sampler"):
        own, first = looks[str(sampler)], sampler in members
        color, size = (own.color, 1.4) if first else (REST, 0.7)
        drawn: dict[str, Any] = {"color": color, "marker": own.marker, "zorder": 2 + first,
                                 "markersize": 2.5 + 2.0 * size}  # fmt: skip
        line = own.dash if first else "-"
        axes.plot(part["seconds"], part[value], linestyle=line, linewidth=size, **drawn)
        near = part[part["near"]]
        axes.plot(near["seconds"], near[value], linestyle="", markerfacecolor="white", **drawn)
    for axis, column, few in ((axes.xaxis, "seconds", multiples), (axes.yaxis, value, (1, 2, 5))):
        wide = float(points[column].max()) > 5.0 * float(points[column].min())
        label_plainly(axis, few if wide else range(1, 10))


def _name_ends(
    axes: "Axes", points: pd.DataFrame, value: str, looks: Looks, others: bool = False
) -> None:
    """Names of the front's members, or of all, in a column beside the axes, each as near as there
    is room to the height of the dearest point, which a thin line leads to.
    """
    members = set(pareto_front(points)["sampler"])
    ends = points.sort_values("seconds", kind="stable").groupby("sampler").tail(1)
    ends = ends[others | ends["sampler"].isin(members)].sort_values(value, kind="stable")
    axes.autoscale_view()
    to_axes = axes.transData + axes.transAxes.inverted()
    heights = np.clip(to_axes.transform(ends[["seconds", value]])[:, 1], 0.0, 1.0)
    apart = np.arange(len(ends)) * LINE_OF_TEXT / (axes.bbox.height * 72.0 / axes.figure.dpi)
    heights = np.maximum.accumulate(heights - apart)
    heights = np.minimum(heights, 1.0 - apart[-1:]) + apart
    for (sampler, x, y), height in zip(
        ends[["sampler", "seconds", value]].itertuples(index=False), heights, strict=True
    ):
        color = looks[sampler].color if sampler in members else REST
        axes.annotate(
            label_of(sampler), (x, y), (1.03, height), textcoords="axes fraction", va="center",
            color=INK, annotation_clip=False, fontsize="medium" if sampler in members else "small",
            arrowprops={"arrowstyle": "-", "color": color, "relpos": (0, 0.5),
                        "linewidth": 1.0 if sampler in members else 0.5},
        )  # fmt: skip


def line_plot(
    rows: pd.DataFrame, x: str, y: str, label: str,
    axes_labels: tuple[str, str], log_y: bool = True, log_x: bool = True,
) -> "Figure":  # fmt: skip
    """Column `y` over column `x`, one line per value of `label`, in order of appearance.

    Where the columns y_lower and y_upper exist they become error bars.
    """
    figure = new_figure(7.0, 4.2, "constrained")
    axes = figure.add_subplot()
    for index, (name, part) in enumerate(rows.groupby(label, sort=False)):
        part = part.sort_values(x)
        bars = None
        if f"{y}_lower" in part:
            bars = [part[y] - part[f"{y}_lower"], part[f"{y}_upper"] - part[y]]
        axes.errorbar(
            part[x], part[y], bars, label=label_of(str(name)), capsize=2, **look(index).line
        )
    if log_x:
        axes.set_xscale("log")
    if log_y:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)
    for axis, name, log in ((axes.xaxis, x, log_x), (axes.yaxis, y, log_y)):
        shown = rows.loc[rows[name] > 0.0, name]
        if log and 5.0 < shown.max() / shown.min() < 1e3:
            label_plainly(axis)
    axes.set_xlabel(axes_labels[0])
    axes.set_ylabel(axes_labels[1])
    figure.legend(loc="outside right upper")
    return figure


def dot_plot(
    rows: pd.DataFrame, value: str, label: str, axis: str, published: Mapping[str, float]
) -> "Figure":
    """Column `value` of each of the methods in column `label`, in order of appearance.

    published : values printed by a paper, by method; drawn as rings and said so in the legend
    """
    names = list(dict.fromkeys([*map(str, rows[label]), *published]))
    figure = new_figure(7.0, 1.1 + 0.34 * len(names), "constrained")
    axes = figure.add_subplot()
    for place, name in enumerate(names):
        values = rows.loc[rows[label] == name, value].to_numpy(np.float64)
        values = values[np.isfinite(values)]
        if len(values):
            axes.plot(values, np.full(len(values), place), "o", color=COLORS[4], markersize=4)
            axes.plot(
                [values.mean()], [place], "|", color=COLORS[0], markersize=15, markeredgewidth=3
            )
    if published:
        places = [names.index(name) for name in published]
        axes.plot(
            list(published.values()), places, "D", markerfacecolor="none", color=COLORS[1],
            markersize=8, markeredgewidth=1.6, label="the paper's",
        )  # fmt: skip
        figure.legend(loc="outside right upper")
    axes.set_yticks(range(len(names)), list(map(label_of, names)))
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel(axis)
    return figure
