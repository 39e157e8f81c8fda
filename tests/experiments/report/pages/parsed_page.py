"""A page taken apart: what it links to, what can be linked to, its tables and its text."""

import json
from html.parser import HTMLParser
from pathlib import Path

VOID = {"meta", "link", "img", "br", "input", "hr"}


class Page(HTMLParser):
    """Links, ids, tables (attributes and rows of cells), text and the viewer's data of a page.

    Elements that are not closed in order are an error."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: list[str] = []
        self.tables: list[tuple[dict, list[list[str]]]] = []
        self.text = ""
        self.open: list[str] = []
        self.data: dict = {}
        self.feed(path.read_text(encoding="utf-8"))
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.links += [found[name] for name in ("href", "src") if found.get(name)]
        self.ids += [found["id"]] if "id" in found else []
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.tables.append((found, []))
        if tag == "tr":
            self.tables[-1][1].append([])
        if tag in ("td", "th"):
            self.tables[-1][1][-1].append("")

    def handle_startendtag(self, tag, attributes):
        self.links += [value for name, value in attributes if name == "href"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, self.getpos()

    def handle_data(self, data):
        if self.open[-1:] == ["script"] and data.strip():
            if data.startswith("{") and "errors" in (found := json.loads(data)):
                self.data = found
            return
        self.text += data
        if self.tables and {"td", "th"} & set(self.open):
            self.tables[-1][1][-1][-1] += data
