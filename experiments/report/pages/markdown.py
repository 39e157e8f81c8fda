"""Markdown as HTML: a page shows a report as it was published, also one older than the code.

What is written for one page alone, a table or a docstring, goes the same way. Names of pages and
links to them are made here, too.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import PurePosixPath
from typing import TYPE_CHECKING
from urllib.parse import quote, unquote

import pandas as pd
from markupsafe import Markup

from experiments.report.parts import Table
from experiments.report.tables import as_markdown
from experiments.run.identity import digest

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.tree import SyntaxTreeNode

SUFFIXES = (".svg", ".pdf", ".webp", ".png")
LONG = 60
"""Tables of more lines are folded."""
WIDE = 14
"""Letters from which on a cell may take several lines."""
PARAMETER = re.compile(r"^ {4}(\S[^:\n]*?) : ", re.MULTILINE)


@dataclass
class Shown:
    """A text as HTML. headings : anchor and words of those that a list of contents has"""

    html: Markup = field(default_factory=Markup)
    headings: list[tuple[str, str]] = field(default_factory=list)


@cache
def _parser(emphasis: bool = True) -> "MarkdownIt":
    from markdown_it import MarkdownIt

    made = MarkdownIt("commonmark", {"html": False}).enable("table")
    return made.disable(["link", "autolink", "entity", *([] if emphasis else ["emphasis"])])


def as_html(
    text: str, folder: str = "", files: Collection[str] = (), heading: str = "report"
) -> Shown:
    """Markdown but for its title; headings, tables and figures can be linked to.

    folder : where pages have the files of the run
    files : those that are there; a figure that is not is left out
    heading : after which tables above all headings are named
    """
    from markdown_it.tree import SyntaxTreeNode

    parser, shown, used = _parser(), Shown(), Counter[str]()
    caption = ""

    def anchor(words: str) -> str:
        used[words] += 1
        return words if used[words] == 1 else f"{words}-{used[words]}"

    for node in SyntaxTreeNode(parser.parse(text)).children:
        inside = node.children[0] if node.children else node
        picture = next((one for one in inside.children if one.type == "image"), None)
        if caption and inside.type == "inline" and inside.content == f"*{caption}*":
            continue
        caption = ""
        if node.type == "heading":
            words = "".join(one.content for one in inside.children)
            heading = slug(words)
            if node.tag != "h1":
                place = anchor(heading)
                shown.html += heading_html(node.tag, place, words)
                if node.tag < "h4":
                    shown.headings.append((place, words))
        elif picture is not None:
            caption = inside.content.rpartition("](")[0].removeprefix("![")
            file = unquote(str(picture.attrs["src"]))
            if file in files:
                stem = str(PurePosixPath(file).with_suffix(""))
                place = anchor(f"figure-{slug(stem)}")
                shown.html += _figure(file, stem, inline(caption), folder, files, place)
        elif node.type == "table":
            shown.html += _table(node, anchor(f"{heading}-table"))
        else:
            shown.html += Markup(parser.renderer.render(node.to_tokens(), parser.options, {}))
    return shown


def heading_html(tag: str, place: str, words: str) -> Markup:
    """A heading that can be linked to."""
    return Markup(
        '<{0} id="{1}">{2} <a class="anchor" href="#{1}" aria-label="Link to {2}">#</a></{0}>\n'
    ).format(tag, place, words)


def _figure(
    file: str, stem: str, told: Markup, folder: str, files: Collection[str], place: str
) -> Markup:
    """A picture, its caption, and the same in other formats."""
    address = folder + quoted(file)
    others = [f"{stem}{suffix}" for suffix in SUFFIXES if f"{stem}{suffix}" in files]
    links = Markup(" ").join(
        Markup('<a href="{}">{}</a>').format(folder + quoted(one), one.rpartition(".")[2].upper())
        for one in others
    )
    return Markup(
        '<figure id="{}"{}><a href="{}"><img loading="lazy" src="{}" alt="{}"></a>'
        "<figcaption>{} {}</figcaption></figure>\n"
    ).format(
        place, Markup("" if file.endswith(".svg") else ' class="raster"'), address, address,
        told.striptags(), told, links,
    )  # fmt: skip


def _table(node: "SyntaxTreeNode", place: str) -> Markup:
    """A table; a long one is folded. On a narrow window each cell has its heading beside it."""
    render, options = _parser().renderer.render, _parser().options
    head, *lines = (row.children for part in node.children for row in part.children)
    headings = [cell.children[0].content for cell in head]
    left = [str(cell.attrs.get("style", "")).endswith("left") for cell in head]

    def cell(column: int, one: "SyntaxTreeNode") -> Markup:
        html = Markup(render(one.children[0].to_tokens(), options, {}))
        text = html.striptags()
        if not column:
            return Markup('<th scope="row" class="name">{}</th>').format(html)
        kinds = ["name"] if left[column] else ["two"] if " [" in text else []
        kinds += ["long"] if len(text) > WIDE and "two" not in kinds else []
        return Markup('<td data-label="{}" class="{}">{}</td>').format(
            headings[column], " ".join(kinds), Markup(html.replace(" [", "\n["))
        )

    names = Markup("").join(
        Markup("<th{}>{}</th>").format(
            Markup(' class="name"') if left[column] or not column else "", words
        )
        for column, words in enumerate(headings)
    )
    rows = Markup("\n").join(
        Markup("<tr>{}</tr>").format(Markup("").join(cell(k, one) for k, one in enumerate(line)))
        for line in lines
    )
    table = Markup(
        '<div class="scroll">\n<table class="numbers stack">\n<thead><tr>{}</tr></thead>\n'
        "<tbody>\n{}\n</tbody></table>\n</div>"
    ).format(names, rows)
    if len(lines) > LONG:
        words = f"A table of {len(lines)} lines"
        table = Markup("<details><summary>{}</summary>{}</details>").format(words, table)
    return Markup('<div class="block" id="{}">{}</div>\n').format(place, table)


def table_html(table: Table, place: str) -> Markup:
    """A table that stands on a page alone; nothing where it has no line."""
    if table.rows.empty:
        return Markup()
    return as_html(as_markdown(table), heading=place.removesuffix("-table")).html


def text_table(lines: Sequence[Mapping[str, str]], place: str) -> Markup:
    """Such a table of texts, a line each, under the names of its columns."""
    rows = pd.DataFrame(lines)
    return table_html(Table("", rows, dict.fromkeys(map(str, rows), "s")), place)


def docstring_html(text: str) -> Markup:
    """A docstring: what is indented as "name : text" is a list, what is indented else is code."""
    return Markup(_parser(emphasis=False).render(PARAMETER.sub(r"- `\1`: ", text)))


def inline(text: str) -> Markup:
    """A sentence in Markdown."""
    return Markup(_parser().renderInline(text))


def slug(name: str) -> str:
    """A file name, without suffix, for any text; different texts give different names."""
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._")
    return plain if plain == name else f"{plain[:60]}-{digest(name)[:6]}"


def quoted(path: str) -> str:
    """A relative path as it stands in a link."""
    return quote(path, safe="/")
