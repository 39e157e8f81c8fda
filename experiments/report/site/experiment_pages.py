"""The page of a published run: its report, its tables as LaTeX, its record and its files."""

from pathlib import Path
from typing import Any

from markupsafe import escape

from experiments.report.publish import size_sentence
from experiments.report.run_data import slug
from experiments.report.site.publications import Publication
from experiments.report.site.report_blocks import blocks
from experiments.report.write import REPORT

FACTS = ("started", "command", "commit", "processor", "cores", "threads", "system", "python")
LOADS = ("load_average", "load_average_end")


def context(one: Publication, files: list[str]) -> dict[str, Any]:
    """What the template of a run's page reads.

    files : of its folder in the site, by relative path
    """
    folder = one.run.folder
    report = _text(folder / REPORT) if REPORT in files else ""
    found = list(blocks(report, set(files)))
    return {
        "name": one.name,
        "file": f"{slug(one.name)}.html",
        "title": one.title,
        "summary": "" if _begins_with(found, one.experiment.summary) else one.experiment.summary,
        "findings": one.findings,
        "size": size_sentence(one.run),
        "blocks": found,
        "headings": [block for block in found if block["kind"] == "heading" and block["level"] < 4],
        "latex": [
            {"file": file, "stem": Path(file).stem, "text": _text(folder / file)}
            for file in files
            if file.endswith(".tex")
        ],
        "files": files,
        "facts": _facts(one),
        "versions": one.run.record["machine"].get("versions", {}),
    }


def _begins_with(found: list[dict[str, Any]], summary: str) -> bool:
    """Whether the report says what the experiment is about itself."""
    return bool(found) and found[0].get("text", "").startswith(escape(summary))


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def _facts(one: Publication) -> dict[str, str]:
    """The record of the machine, by what is recorded; what differs by part, one after the other."""
    machine, found = one.run.record["machine"], {}
    for name in FACTS:
        if name in machine:
            told = [str(part.get(name, machine[name]) or "unknown") for part in one.run.parts]
            found[name] = "; ".join(dict.fromkeys(told))
    found["processor"] = "; ".join(one.run.processors)
    loads = [f"{machine[name]:.2f}" for name in LOADS if machine.get(name) is not None]
    return found | ({"load at start and end": ", ".join(loads)} if loads else {})
