"""One colour, marker and dash per sampler, the same in every figure and on every page.

Where the rows tell the samplers' leagues, a league has a hue and its members have shades of it, so
that what a sampler returns is seen before its name is read. The hues and, where no league is known,
the colours are those of Paul Tol, "Colour schemes", SRON technical note, 2021 ("vibrant" and
"muted", made to be told apart by colour-blind readers), with black, orange and blue added. Where
there are more samplers than colours, markers and dashes tell them apart.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from experiments.report.summary import LEAGUES
from samplers import sampler_names

COLORS = (
    "#332288", "#cc6677", "#117733", "#e69f00", "#88ccee", "#882255", "#44aa99", "#999933",
    "#aa4499", "#000000", "#0077bb",
)  # fmt: skip
SHADES = dict(
    zip(
        LEAGUES,
        (
            ("#0077bb", "#003a5c", "#3d9bd6", "#00527f", "#5aa9dc", "#1f6fa3"),
            ("#cc3311", "#7a1f0a", "#ee6b4f", "#a32a0e", "#e0826c", "#dd4f30"),
            ("#117733", "#093d1a", "#45a264", "#0d5a26", "#68ad7e", "#2f9450"),
            ("#aa4499", "#5c2052", "#c56fb7", "#843277", "#c988be", "#bd5fae"),
            ("#b8860b", "#6b4e06", "#cf9c25", "#8f6808", "#c9a557", "#a5801f"),
        ),
        strict=True,
    )
)
REST = "#b4b8be"
"""What is drawn only for comparison."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*", "d")
DASHES = ("-", "--", ":", "-.")


@dataclass(frozen=True)
class Look:
    color: str
    marker: str
    dash: str


def looks(labels: list[str], leagues: Mapping[str, str] | None = None) -> dict[str, Look]:
    """Looks by label. Registered samplers have theirs whatever else a run holds.

    leagues : by label; shades of a league go to its members in the order of the registry
    """
    known = sampler_names()
    order = [*known, *sorted(set(labels) - set(known))]
    found = {label: _look(order.index(label)) for label in labels}
    for league, shades in SHADES.items():
        members = [
            label for label in order if label in found and (leagues or {}).get(label) == league
        ]
        for place, label in enumerate(members):
            found[label] = Look(
                shades[place % len(shades)],
                MARKERS[place % len(MARKERS)],
                DASHES[math.floor(place / len(shades)) % len(DASHES)],
            )
    return found


def _look(index: int) -> Look:
    return Look(
        COLORS[index % len(COLORS)],
        MARKERS[index % len(MARKERS)],
        DASHES[math.floor(index / len(COLORS)) % len(DASHES)],
    )
