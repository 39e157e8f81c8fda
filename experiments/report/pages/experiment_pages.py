"""What the first page says, and the page of a run: its report, LaTeX, record and files."""

import importlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.report.pages.cases import Case
from experiments.report.pages.markdown import as_html, inline, quoted, slug
from experiments.report.pages.ranking import constants, entry
from experiments.report.pages.reported import Reported
from experiments.report.parts import counted
from experiments.report.rankings import verdict
from experiments.report.summary import COSTS
from experiments.report.write import size_sentence
from experiments.run.budget import opening_budget, sorted_budgets
from experiments.run.loaded_run import REPORT
from experiments.run.registry import ROOMS, room_of
from experiments.run.sampler_spec import family_of
from metrics.registry import leading_metric, ranked_metrics

FACTS = ("started", "command", "commit", "processor", "cores", "threads", "system", "python")
LOADS = ("load_average", "load_average_end")
TITLE = "Which light sampler is best, for which environment map, at which cost?"


def context(one: Reported, files: list[str], pages: Path) -> dict[str, Any]:
    """What the template of a run's page reads.

    files : of its folder among the pages, by relative path
    """
    folder = pages / "files" / one.name
    report = (folder / REPORT).read_text("utf-8", "replace") if REPORT in files else ""
    shown = as_html(report, f"../files/{quoted(one.name)}/", set(files))
    summary = one.experiment.summary
    told = f"<p>{inline(summary)}" in shown.html
    return {
        "name": one.name,
        "file": f"{slug(one.name)}.html",
        "title": one.title,
        "summary": "" if told else summary,
        "findings": [said for said in one.findings if inline(said) not in shown.html],
        "size": size_sentence(one.run),
        "report": shown.html,
        "headings": shown.headings,
        "latex": [
            {"file": file, "stem": Path(file).stem,
             "text": (folder / file).read_text("utf-8", "replace")}
            for file in files
            if file.endswith(".tex")
        ],
        "files": files,
        "facts": _facts(one),
        "versions": one.run.record["machine"].get("versions", {}),
    }  # fmt: skip


def _facts(one: Reported) -> dict[str, str]:
    """The record of the machine, by what is recorded; what differs by part, one after the other."""
    machine, found = one.run.record["machine"], {}
    for name in FACTS:
        if name in machine:
            told = [str(part.get(name, machine[name]) or "unknown") for part in one.run.parts]
            found[name] = "; ".join(dict.fromkeys(told))
    found["processor"] = "; ".join(one.run.processors)
    loads = [f"{machine[name]:.2f}" for name in LOADS if machine.get(name) is not None]
    return found | ({"load at start and end": ", ".join(loads)} if loads else {})


def front(found: Sequence[Reported], ranked: Sequence[Reported]) -> dict[str, Any]:
    """What the first page's template reads. ranked : the runs that rank samplers, the main first"""
    lone = found[0] if len(found) == 1 else None
    title = lone.title if lone else TITLE
    said = {
        "production": production(found),
        "catalogue": None,
        "title": title,
        "leading": leading_metric().label,
    }
    if not ranked:
        return said
    main, entries = ranked[0], list(map(entry, ranked))
    main_budgets = main.timed_budgets or [opening_budget(main.run.rows["budget"])]
    return said | {
        "said": verdict(main.at(main_budgets[0]).rankings[0]),
        "catalogue": {
            "run": main.name,
            "budget": main_budgets[0],
            "budgets": sorted_budgets(list({name for one in entries for name in one["budgets"]})),
            "runs": entries,
        },
        "constants": json.dumps(constants(), ensure_ascii=False),
        "metrics": list(reversed(ranked_metrics())),
        "report": f"experiments/{slug(main.name)}.html",
    }


def shared(found: Sequence[Reported], maps: int) -> dict[str, Any]:
    """What all pages know: the columns of costs, and what the pages are made from."""
    grids = [one for one in found if one.is_grid]
    names = {str(name) for one in grids for name in one.run.rows["sampler"].unique()}
    rows = sum(len(one.run.rows) for one in found)
    about = (
        f"{counted(len({family_of(name) for name in names}), 'sampler')}, "
        f"{counted(maps, 'map')}, {rows:,} measurements in {counted(len(found), 'run')}."
    )
    lead = size_sentence(found[0].run) if len(found) == 1 else about
    return {"costs": COSTS, "about": about, "lead": lead}


def links(
    found: Sequence[Reported], contexts: Sequence[dict[str, Any]], cited: bool
) -> list[tuple[str, str]]:
    """The pages that every page leads to."""
    made = [("index.html", "Ranking"), ("samplers.html", "Samplers"), ("maps.html", "Maps")]
    if len(found) > 1:
        made.append(("experiments.html", "Experiments"))
        others = (one.name for one in found if one.experiment.name == PRODUCTION)
        made += [(f"experiments/{slug(name)}.html", "Renderers") for name in others][:1]
    else:
        made.append((f"experiments/{contexts[0]['file']}", "Report"))
    made.append(("downloads.html", "Downloads"))
    return [*made, ("cite.html", "Cite")] if cited else made


def pictures_said(cases: dict[str, list[Case]], skipped: int) -> str:
    """Which images can be compared, or that none can."""
    shown = {name: sum(case.viewable for case in many) for name, many in cases.items()}
    if not any(shown.values()):
        return "No images to be compared are kept or given; pictures stand with their runs."
    names = ", ".join(name for name, count in shown.items() if count)
    more = f"; {counted(skipped, 'case')} more had no room" if skipped else ""
    return f"Images of {counted(sum(shown.values()), 'case')} can be compared, of {names}{more}."


MOST_FINDINGS = 2
"""Sentences of an experiment that stand on the first page."""
PRODUCTION = "production-renderers"


def production(found: Sequence[Reported]) -> dict[str, Any] | None:
    """What the run of other programs says of them, and its page; None without one."""
    able = [one for one in found if one.experiment.name == PRODUCTION]
    if not able or len(found) == 1:
        return None
    sentences = able[0].findings[:MOST_FINDINGS] or (able[0].experiment.summary,)
    return {"sentences": sentences, "page": f"experiments/{slug(able[0].name)}.html"}


def rooms(found: Sequence[Reported], contexts: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The runs under what their room says of itself, in the order of the rooms."""
    by_room: dict[str, list[dict[str, Any]]] = {}
    for one, made in zip(found, contexts, strict=True):
        by_room.setdefault(room_of(one.experiment.name), []).append(made)
    return [
        {
            "title": (importlib.import_module(f"experiments.{room}").__doc__ or room).strip(" .\n"),
            "experiments": by_room[room],
        }
        for room in ROOMS
        if room in by_room
    ]
