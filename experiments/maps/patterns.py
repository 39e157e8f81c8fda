"""Choosing by name: comma-separated lists on the command line, and shell patterns in them."""

import difflib
import fnmatch
from collections.abc import Callable, Iterable
from typing import Any

from samplers import EnvlightError

MOST_NAMED = 12


def split_list(texts: Iterable[str]) -> list[str]:
    """The items of comma-separated lists; commas in brackets belong to the item."""
    parts: list[str] = []
    for text in texts:
        depth, start = 0, 0
        for place, letter in enumerate(text):
            depth += (letter in "[(") - (letter in "])")
            if letter == "," and depth <= 0:
                parts.append(text[start:place])
                start = place + 1
        parts.append(text[start:])
    return [part.strip() for part in parts if part.strip()]


def select(
    items: list, patterns: list[str], kind: str, name_of: Callable[[Any], str] = str
) -> list:
    """The items whose names match any of the shell patterns, all where there is none.

    patterns : each may be several with commas between

    Raises EnvlightError for a pattern that matches nothing.
    """
    wanted = split_list(patterns)
    if not wanted:
        return items
    chosen = set()
    for pattern in wanted:
        matching = {
            index for index, item in enumerate(items) if fnmatch.fnmatchcase(name_of(item), pattern)
        }
        if not matching:
            raise EnvlightError(f"no {kind} matches '{pattern}'; {_hint(pattern, items, name_of)}")
        chosen |= matching
    return [item for index, item in enumerate(items) if index in chosen]


def _hint(pattern: str, items: list, name_of: Callable[[Any], str]) -> str:
    names = [name_of(item) for item in items]
    near = difflib.get_close_matches(pattern, names, n=3, cutoff=0.4)
    if near:
        return f"did you mean {' or '.join(near)}?"
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"there are {', '.join(names[:MOST_NAMED])}{more}"
