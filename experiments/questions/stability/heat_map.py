"""A table of figures as a picture: a figure in each cell, its colour says whether it holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

State = Literal["holds", "fails", "declared", "raised", "neutral", "none"]
COLORS: dict[State, str] = {
    "holds": "#cfe3f1",
    "fails": "#f4a259",
    "declared": "#ece7d8",
    "raised": "#8c2d04",
    "neutral": "#f3f3f3",
    "none": "#ffffff",
}
MEANINGS: dict[State, str] = {
    "holds": "holds",
    "fails": "beyond the tolerance",
    "declared": "declared exception",
    "raised": "raised an error",
    "neutral": "accuracy, no tolerance",
}


@dataclass(frozen=True)
class HeatCell:
    text: str
    state: State


def heat_map(
    cells: Sequence[Sequence[HeatCell]], rows: Sequence[str], columns: Sequence[str], title: str
) -> "Figure":
    """Cells (rows × columns) under the names of rows and columns."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    width = max(7.0, 1.6 + 0.09 * max(map(len, rows)) + 0.78 * len(columns))
    figure = Figure((width, 1.7 + 0.25 * len(rows)), layout="constrained", facecolor="white")
    axes = figure.add_subplot()
    axes.grid(False)
    for y, line in enumerate(cells):
        for x, cell in enumerate(line):
            axes.add_patch(Rectangle((x, y), 1, 1, facecolor=COLORS[cell.state], edgecolor="white"))
            ink = "white" if cell.state == "raised" else "#222222"
            axes.text(x + 0.5, y + 0.5, cell.text, ha="center", va="center", fontsize=7, color=ink)
    axes.set_xlim(0, len(columns))
    axes.set_ylim(len(rows), 0)
    axes.set_xticks([x + 0.5 for x in range(len(columns))], columns, rotation=35, ha="left",
                    rotation_mode="anchor")  # fmt: skip
    axes.set_yticks([y + 0.5 for y in range(len(rows))], rows)
    axes.tick_params(length=0, top=False, labeltop=True, labelbottom=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title(title, fontsize=10, pad=8)
    used = {cell.state for line in cells for cell in line}
    patches = [
        Patch(facecolor=COLORS[state], label=text)
        for state, text in MEANINGS.items()
        if state in used
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=5, frameon=False, fontsize=8)
    return figure
