"""A module docstring as parts of a page: paragraphs, and lists of "name : text" under a heading."""

import inspect
import re
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

from markupsafe import Markup, escape

ENTRY = re.compile(r"^(?P<name>\S[^:]*?) : (?P<text>.*)$")


@dataclass(frozen=True)
class Part:
    """kind : "text" (text), "list" (heading text, items) or "code" (text as it stands)"""

    kind: Literal["text", "list", "code"]
    text: Markup
    items: tuple[tuple[Markup, Markup], ...] = ()


def parts_of(docstring: str) -> list[Part]:
    """The parts of a docstring in their order."""
    lines = inspect.cleandoc(docstring).splitlines()
    groups = [
        list(group) for filled, group in groupby(lines, lambda line: bool(line.strip())) if filled
    ]
    return [part for group in groups for part in _parts(group)]


def _parts(lines: list[str]) -> list[Part]:
    """Unindented lines are a paragraph; what is indented below one is its list, or code."""
    head = [line for line in lines if not line.startswith(" ")]
    body = lines[len(head) :]
    if not body or body != [line for line in lines if line.startswith(" ")]:
        return [Part("text", inline(" ".join(line.strip() for line in lines)))]
    title = inline(" ".join(head))
    items = _items(body)
    if items:
        return [Part("list", title, items)]
    code = Part("code", escape(inspect.cleandoc("\n" + "\n".join(body))))
    return [Part("text", title), code] if head else [code]


def _items(lines: list[str]) -> tuple[tuple[Markup, Markup], ...]:
    """Entries "name : text", whose further lines are indented; empty where the first is none."""
    margin = min(len(line) - len(line.lstrip()) for line in lines)
    found: list[tuple[str, list[str]]] = []
    for line in (line[margin:] for line in lines):
        entry = None if line.startswith(" ") else ENTRY.match(line)
        if entry:
            found.append((entry["name"], [entry["text"]]))
        elif found:
            found[-1][1].append(line.strip())
        else:
            return ()
    return tuple((inline(name), inline(" ".join(text))) for name, text in found)


def inline(text: str) -> Markup:
    """Text with `names` as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))
