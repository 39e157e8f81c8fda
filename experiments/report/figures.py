"""How the report's plots are drawn and written, and the plots of plain tables: lines, dots, fronts.

Each is written as SVG, PDF and PNG, in a published folder as SVG alone, with the same bytes
whenever the numbers are. Error against time: prepare and render together, log–log, the samplers on
the Pareto front in colour and the others in grey.
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
from experiments.report.style import COLORS, FONT, FRONT, INK, REST, STYLE, Looks, look, new_figure
from metrics.registry import Metric

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

SUFFIXES = ("svg", "pdf", "png")
KEPT = ("svg",)
"""What a published folder keeps of them."""
MARGIN = 0.1
"""Inches around what is drawn."""
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
    returns the stem."""
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
    """One point per sampler and budget: error, and seconds to prepare and render."""
    table = pd.concat([result.table for result in results], ignore_index=True)
    points = pd.DataFrame(
        {
            "sampler": table["sampler"],
            "budget": table["budget"],
            "render": table["seconds_render"],
            "seconds": table["seconds_lights"] + table["seconds_render"],
            "error": table[metric.name],
        }
    )
    return points[(points["error"] > 0.0) & (points["seconds"] > 0.0)]


def label_plainly(axis: "Axis", multiples: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Plain figures, such as 0.05, at these multiples of powers of ten of a logarithmic axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=multiples))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def pareto_plot(results: list[BudgetResult], metric: Metric, looks: Looks) -> "Figure":
    """Mean error against mean seconds; a thin line leads back to the time without preparation."""
    points = pareto_points(results, metric)
    on_front = set(pareto_front(points)["sampler"])
    figure = new_figure(7.2, 4.6)
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    front = pareto_front(points)
    axes.plot(
        front["seconds"], front["error"], color=FRONT, linewidth=6, alpha=0.28,
        drawstyle="steps-post", label="Pareto front", zorder=1,
    )  # fmt: skip
    for sampler, part in points.groupby("sampler", sort=True):
        own, first = looks[str(sampler)], sampler in on_front
        color = own.color if first else REST
        axes.hlines(part["error"], part["render"].clip(lower=1e-6), part["seconds"], color=color,
                    linewidth=0.8, alpha=0.7, zorder=2 + first)  # fmt: skip
        axes.plot(
            part["seconds"], part["error"], color=color, marker=own.marker, linestyle=own.dash,
            markersize=8 if first else 5, linewidth=1.4 if first else 0.8, zorder=2 + first,
            markeredgecolor="white",
        )  # fmt: skip
        dearest = part.sort_values("seconds").iloc[-1]
        axes.annotate(
            str(sampler), (float(dearest["seconds"]), float(dearest["error"])), (6, 5),
            textcoords="offset points", color=color if first else INK, zorder=4,
            alpha=1.0 if first else 0.55,
            fontsize="medium" if first else "x-small",
        )  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        label_plainly(axis)
    axes.margins(0.08)
    axes.set_xlabel("seconds per image: preparing the lights and rendering (mean)")
    axes.set_ylabel(f"mean {metric.label}")
    axes.grid(True, which="minor", alpha=0.5)
    axes.margins(x=0.16)
    axes.legend(loc="lower left")
    return figure


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
        axes.errorbar(part[x], part[y], bars, label=str(name), capsize=2, **look(index).line)
    if log_x:
        axes.set_xscale("log")
    if log_y:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlabel(axes_labels[0])
    axes.set_ylabel(axes_labels[1])
    figure.legend(loc="outside right upper")
    return figure


def dot_plot(
    rows: pd.DataFrame, value: str, label: str, axis: str, published: Mapping[str, float]
) -> "Figure":  # fmt: skip
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
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel(axis)
    return figure
