"""How to cite the project and the papers: `CITATION.cff` as sentences and as BibTeX.

The file's form is the Citation File Format 1.2.0 (Druskat and others).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samplers import EnvlightError

FILE = "CITATION.cff"
FIELDS = {
    "collection-title": "booktitle", "journal": "journal", "institution": "institution",
    "volume": "volume", "issue": "number", "number": "number", "year": "year", "doi": "doi",
    "url": "url", "version": "version",
}  # fmt: skip
KINDS = {"article": "article", "conference-paper": "inproceedings", "report": "techreport"}


@dataclass(frozen=True)
class Source:
    """Something to cite: in words, and as BibTeX."""

    words: str
    bibtex: str


def read_citation(file: Path) -> list[Source]:
    """The project first, then its references; EnvlightError where the file is not of this form."""
    import yaml

    try:
        found = yaml.safe_load(file.read_text(encoding="utf-8"))
        return [_source(one) for one in (found, *found.get("references", []))]
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
        raise EnvlightError(
            f"{file}: it is not in the Citation File Format ({error}); mend it"
        ) from error


def _source(entry: dict[str, Any]) -> Source:
    names = [_name(author) for author in entry["authors"]]
    facts = {key: _word(entry[key]) for key in FIELDS if key in entry}
    year = facts.get("year") or str(entry.get("date-released", ""))[:4]
    where = ", ".join(
        f"version {facts[key]}" if key == "version" else facts[key]
        for key in ("journal", "collection-title", "institution", "number", "volume", "version")
        if key in facts
    )
    words = f"{', '.join(names)}: {entry['title']}. " + ", ".join(filter(None, [where, year])) + "."
    if "doi" in facts:
        words += f" doi:{facts['doi']}"
    lines = [f"  author = {{{' and '.join(names)}}},", f"  title = {{{entry['title']}}},"]
    lines += [f"  {FIELDS[key]} = {{{value}}}," for key, value in facts.items()]
    if "year" not in facts and year:
        lines.append(f"  year = {{{year}}},")
    kind = KINDS.get(entry.get("type", ""), "software")
    return Source(words, "\n".join([f"@{kind}{{{_key(entry, year)},", *lines, "}"]))


def _name(author: dict[str, str]) -> str:
    """A person's names, or the name of a group."""
    if "name" in author:
        return author["name"]
    return f"{author['given-names']} {author['family-names']}"


def _word(value: Any) -> str:
    """A value as text; of an institution its name."""
    return str(value["name"] if isinstance(value, dict) else value)


def _key(entry: dict[str, Any], year: str) -> str:
    first = entry["authors"][0]
    name = first.get("family-names") or entry["title"].split(":")[0]
    return "".join(filter(str.isalnum, name)).lower() + year
