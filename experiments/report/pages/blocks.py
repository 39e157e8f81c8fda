"""A published report, as `experiments.report.write` wrote it, taken apart for a page.

Only that writer's Markdown is understood: headings, paragraphs, lists of sentences, pipe tables,
and figures whose caption follows in italics. So a page says what was published, also of rows that
are older than the code. Names of pages and links to them are made here, too.
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import quote, unquote

import pandas as pd
from markupsafe import Markup, escape

from experiments.report.tables import numeric_columns, without_escapes
from experiments.run.identity import digest

HEADING = re.compile(r"(#+) (.*)")
FIGURE = re.compile(r"!\[(.*)\]\((.*)\)", re.DOTALL)
CELL = re.compile(r"((?:\\.|[^|\\])*)\|")
SUFFIXES = (".svg", ".pdf", ".jpg", ".png")
LONG = 60
"""Tables of more lines are folded."""


def blocks(report: str, files: set[str]) -> Iterator[dict[str, Any]]:
    """Headings, texts, items, tables and figures of a report, without its title.

    files : what was published; a figure that was not is left out
    """
    used: Counter[str] = Counter()
    heading, caption = "report", ""

    def anchor(text: str) -> str:
        used[text] += 1
        return text if used[text] == 1 else f"{text}-{used[text]}"

    for block in filter(None, map(str.strip, re.split(r"\n{2,}", report))):
        if caption and block == f"*{caption}*":
            continue
        caption = ""
        if found := HEADING.fullmatch(block):
            level, text = len(found[1]), without_escapes(found[2])
            heading = slug(text)
            if level > 1:
                yield {"kind": "heading", "level": level, "text": text, "anchor": anchor(heading)}
        elif found := FIGURE.fullmatch(block):
            caption = found[1]
            yield from _figure(unquote(found[2]), caption, files, anchor)
        elif block.startswith("|"):
            yield table_block(_table(block), anchor(f"{heading}-table"))
        elif block.startswith("- "):
            yield {"kind": "items", "items": list(map(_shown, _items(block)))}
        else:
            yield {"kind": "text", "text": _shown(block)}


def _shown(text: str) -> Markup:
    return inline(without_escapes(text))


def table_block(frame: pd.DataFrame, anchor: str) -> dict[str, Any]:
    """A table of texts as the templates show it; a long one is folded."""
    left = [k for k, numeric in enumerate(numeric_columns(frame)) if not numeric]
    return {
        "kind": "table", "frame": frame, "anchor": anchor, "left": left,
        "folded": len(frame) > LONG,
    }  # fmt: skip


def _table(block: str) -> pd.DataFrame:
    """The texts of a pipe table under its headings, of which several may be alike."""
    lines = [
        [without_escapes(cell.strip()) for cell in CELL.findall(line[1:])]
        for line in block.splitlines()
    ]
    return pd.DataFrame(lines[2:], columns=lines[0])


def _items(block: str) -> list[str]:
    """A list's sentences; further lines of one are its own."""
    return re.sub(r"\n(?!- )", " ", block).removeprefix("- ").split("\n- ")


def _figure(file: str, caption: str, files: set[str], anchor: Any) -> Iterator[dict[str, Any]]:
    if file not in files:
        return
    stem = str(PurePosixPath(file).with_suffix(""))
    yield {
        "kind": "figure", "file": file, "caption": _shown(caption),
        "files": [f"{stem}{suffix}" for suffix in SUFFIXES if f"{stem}{suffix}" in files],
        "anchor": anchor(f"figure-{slug(stem)}"), "raster": not file.endswith(".svg"),
    }  # fmt: skip


def slug(name: str) -> str:
    """A file name, without suffix, for any text; different texts give different names."""
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._")
    return plain if plain == name else f"{plain[:60]}-{digest(name)[:6]}"


def quoted(path: str) -> str:
    """A relative path as it stands in a link."""
    return quote(path, safe="/")


def inline(text: str) -> Markup:
    """Text with `names` as code, and **names** in bold."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    return Markup(re.sub(r"(?<!\w)\*\*([\w-]+)\*\*(?!\w)", r"<strong>\1</strong>", marked))
