"""Comma-separated lists on the command line."""

from collections.abc import Iterable


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
