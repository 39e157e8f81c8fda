"""The one style of all plots and pages: fonts, sizes, and a look for every sampler.

A family of samplers (what they return: fixed lights, layers, a distribution …) has a hue, and its
members have shades of it with a marker and a dash of their own, so that what a sampler returns is
seen before its name is read, and nobody is told apart by colour alone. A registered sampler looks
the same in every figure and on every page, whatever else a run holds. The hues and the colours of
everything else are those of Paul Tol, "Colour schemes", SRON technical note, 2021 ("vibrant" and
"muted", made to be told apart by colour-blind readers), with black, orange and blue added.
"""

import re
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from samplers import (
    DirectionalLights,
    DiscLights,
    EnvlightError,
    LayeredLights,
    LightDistribution,
    SurfaceDistribution,
    sampler_class,
    sampler_labels,
    sampler_names,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = (
    "#332288", "#cc6677", "#117733", "#e69f00", "#88ccee", "#882255", "#44aa99", "#999933",
    "#aa4499", "#000000", "#0077bb",
)  # fmt: skip
SHADES = {
    "fixed lights": ("#0077bb", "#003a5c", "#3d9bd6", "#00527f", "#5aa9dc", "#1f6fa3"),
    "layers": ("#cc3311", "#7a1f0a", "#ee6b4f", "#a32a0e", "#e0826c", "#dd4f30"),
    "disc lights": ("#117733", "#093d1a", "#45a264", "#0d5a26", "#68ad7e", "#2f9450"),
    "distribution": ("#aa4499", "#5c2052", "#c56fb7", "#843277", "#c988be", "#bd5fae"),
    "distribution that sees the surface": (
        "#b8860b", "#6b4e06", "#cf9c25", "#8f6808", "#c9a557", "#a5801f",
    ),
}  # fmt: skip
"""By family, as rows call them: leagues."""
LEAGUES = tuple(SHADES)
RETURNED = DirectionalLights, LayeredLights, DiscLights, LightDistribution, SurfaceDistribution
FAMILIES: dict[type, str] = dict(zip(RETURNED, LEAGUES, strict=True))
"""The families by what their samplers return."""
NAMED = re.compile(r"(?P<project>(?:envlight )?)(?P<name>[\w.-]+)(?P<rest>.*)", re.DOTALL)
"""How rows name a sampler: by its name; beside production renderers, the project's comes first."""
REST = "#b4b8be"
"""What is drawn only for comparison."""
FRONT = "#888888"
"""A Pareto front."""
INK = "#222222"
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*", "d")
DASHES = ("-", "--", ":", "-.")
FONT = "DejaVu Sans"
STYLE: Any = {
    "svg.hashsalt": "envlight",
    "svg.fonttype": "none",
    # Hinted letters have other widths at other resolutions, and the margin is found at one.
    "text.hinting": "none",
    # A text names its fonts; one name and the generic one are a fifth of matplotlib's list.
    "font.sans-serif": [FONT],
    "font.size": 9.0, "figure.facecolor": "white", "figure.labelsize": "medium",
    "axes.titlesize": "medium", "axes.labelsize": "medium", "xtick.labelsize": "small",
    "ytick.labelsize": "small", "legend.fontsize": "small", "legend.frameon": False,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.color": "#e4e4e4", "axes.axisbelow": True, "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
}  # fmt: skip


@dataclass(frozen=True)
class Look:
    """How a sampler is drawn."""

    color: str
    marker: str
    dash: str

    @property
    def line(self) -> dict[str, Any]:
        """For a line of matplotlib's."""
        return {"color": self.color, "marker": self.marker, "linestyle": self.dash}


Looks = dict[str, Look]


def look(index: int, colors: tuple[str, ...] = COLORS) -> Look:
    """The look of the `index`-th of things that have these colours, no samplers by default."""
    count = len(colors)
    dash = DASHES[index // count % len(DASHES)]
    return Look(colors[index % count], MARKERS[index % len(MARKERS)], dash)


def looks(labels: list[str], leagues: Mapping[str, str] | None = None) -> Looks:
    """Looks by label. Registered samplers have theirs whatever else a run holds.

    leagues : the family by label, of samplers that are not registered
    """
    families, known = leagues or {}, sampler_names()
    order = [*known, *sorted(set(labels) - set(known))]
    found = {label: look(order.index(label)) for label in labels}
    members: dict[str, list[str]] = {league: [] for league in LEAGUES}
    for label in order:
        family = family_returned(label) or families.get(label, "")
        if family in members:
            members[family].append(label)
    for league, names in members.items():
        found |= {
            label: look(place, SHADES[league])
            for place, label in enumerate(names)
            if label in found
        }
    return found


def label_of(sampler: object) -> str:
    """What sentences, tables, plots and pages show for a sampler of rows: its class's label, with
    author and year, and what follows the name: parameters in brackets, or words. What no sampler
    is known by here stays as it is.
    """
    found = NAMED.fullmatch(str(sampler))
    known = sampler_labels()
    if found is None or found["name"] not in known or str(sampler) in known.values():
        return str(sampler)
    space = " " if found["rest"].startswith("[") else ""
    return f"{found['project']}{known[found['name']]}{space}{found['rest']}"


def family_returned(label: str) -> str:
    """The family of a sampler by what its `_prepare` says that it returns; empty where it does not.

    A label may have parameters in brackets.
    """
    try:
        hints = typing.get_type_hints(sampler_class(label.partition("[")[0])._prepare)
    except (EnvlightError, NameError, TypeError):  # not installed; its hints cannot be evaluated
        return ""
    returned = hints.get("return")
    return FAMILIES.get(returned, "") if isinstance(returned, type) else ""


def new_figure(width: float, height: float, layout: Any = None) -> "Figure":
    """A figure of so many inches that belongs to no window and to no global list."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), facecolor="white", layout=layout)
