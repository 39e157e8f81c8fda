"""One colour, marker and dash per sampler, the same in every figure and on every page.

The colours are Tol's "muted" scheme, made to be told apart by colour-blind readers (Paul Tol,
"Colour schemes", SRON technical note, 2021), with black, orange and blue added. Where there are
more samplers than colours, markers and dashes tell them apart.
"""

import math
from dataclasses import dataclass

from samplers import sampler_names

COLORS = (
    "#332288", "#cc6677", "#117733", "#e69f00", "#88ccee", "#882255", "#44aa99", "#999933",
    "#aa4499", "#000000", "#0077bb",
)  # fmt: skip
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*", "d")
DASHES = ("-", "--", ":", "-.")


@dataclass(frozen=True)
class Look:
    color: str
    marker: str
    dash: str


def looks(labels: list[str]) -> dict[str, Look]:
    """Looks by label. Registered samplers have theirs whatever else a run holds."""
    known = sampler_names()
    order = [*known, *sorted(set(labels) - set(known))]
    return {label: _look(order.index(label)) for label in labels}


def _look(index: int) -> Look:
    return Look(
        COLORS[index % len(COLORS)],
        MARKERS[index % len(MARKERS)],
        DASHES[math.floor(index / len(COLORS)) % len(DASHES)],
    )
