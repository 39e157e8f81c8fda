"""The list of embedded maps: a name, a kind, and a function that describes the picture."""

import difflib
from collections.abc import Callable
from dataclasses import dataclass

from experiments.maps.places.raster import Picture
from samplers.errors import EnvlightError

KINDS = (
    "sun", "overcast", "dusk", "night", "interior", "industrial", "studio", "forest", "uniform",
)  # fmt: skip


@dataclass(frozen=True)
class Entry:
    kind: str
    describe: Callable[[], Picture]


_entries: dict[str, Entry] = {}

Describe = Callable[[], Picture]


def embedded_map(name: str, kind: str) -> Callable[[Describe], Describe]:
    """Enter the decorated function, which returns the map's picture, under a name."""
    if kind not in KINDS or name in _entries:
        raise ValueError(f"embedded map '{name}' of kind '{kind}': taken, or no such kind")

    def enter(describe: Describe) -> Describe:
        _entries[name] = Entry(kind, describe)
        return describe

    return enter


def entry_names() -> list[str]:
    """All names, kind by kind."""
    return sorted(_entries, key=lambda name: KINDS.index(_entries[name].kind))


def entry(name: str) -> Entry:
    """The entry of a name; EnvlightError with the nearest names for others."""
    if name not in _entries:
        near = difflib.get_close_matches(name, _entries, 3, 0.4)
        hint = (
            f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(entry_names())}"
        )
        raise EnvlightError(f"no embedded map is called '{name}'; {hint}")
    return _entries[name]
