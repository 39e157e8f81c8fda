"""The report of a grid run: Markdown, and its summary as CSV and LaTeX."""

from pathlib import Path

import pandas as pd

from experiments.report.budget_section import budget_lines
from experiments.report.latex import latex
from experiments.report.rankings import BudgetResult, results
from experiments.run.bench import SPREAD, load_sentence, noise_sentence
from experiments.run.grid_experiment import GridRun
from experiments.run.record import write_csv, write_text
from experiments.run.summary import compared, machine_sentence

LOADS = ("load_average", "load_average_end")
MOST_NAMED = 20
"""More cases than these are counted, not named."""


def write_report(run: GridRun, title: str) -> list[Path]:
    """Write report.md, summary.csv and summary.tex; returns them."""
    found = results(run.rows)
    report, csv = run.folder / "report.md", run.folder / "summary.csv"
    tex = csv.with_suffix(".tex")
    write_csv(csv, pd.concat([result.table for result in found], ignore_index=True))
    write_text(report, _text(run, title, found))
    write_text(tex, latex(found))
    return [report, csv, tex]


def _text(run: GridRun, title: str, found: list[BudgetResult]) -> str:
    return "\n".join(
        [
            *opening(run, title),
            "RMSE and FLIP are means over maps and scenes after each reference's exposure; "
            "ranks are per map, equal errors share the better one, averaged over maps; seeds are "
            "averaged first, and all samplers share them. `× base` is the geometric mean over maps "
            "of the ratio to median cut (to the best-ranked sampler where that was not run), with "
            "the 95 % interval of a bootstrap over maps; samplers that share a letter under "
            "`group` are not told apart by Nemenyi's test. `rays` are shadow and BRDF rays per "
            "sub-pixel. `floor` is the mean noise of the references, in RMSE; `near` counts "
            "measurements "
            "whose RMSE is within 3× of it.",
            "",
            *(line for result in found for line in budget_lines(run, result)),
            *closing(run),
            "Pictures of every case are in `montages/`, images in `images/`, references in "
            "`references/`, all rows in `measurements.csv`, the summary in `summary.csv` "
            "and, for LaTeX, "
            "`summary.tex`.",
            "",
        ]
    )


def opening(run: GridRun, title: str) -> list[str]:
    """Lines of Markdown: the heading, what was measured and what is missing."""
    rows, scale, planned = run.rows, run.record["scale"], run.record["planned"]
    return [
        f"# {title} at scale {scale['name']}" + ("" if len(rows) == planned else " (incomplete)"),
        "",
        f"{len(rows)} of {planned} measurements finished. "
        f"Scenes: {', '.join(sorted(rows['scene'].unique()))}. "
        f"{rows['environment'].nunique()} environment maps. Images of "
        f"{scale['width']}×{scale['height']} pixels with {scale['subpixels']} sub-pixels.",
        "",
        *_gaps(run),
    ]


def closing(run: GridRun) -> list[str]:
    """Lines of Markdown: measurements near the noise floor, repaired maps, and the machine."""
    machine = run.record["machine"]
    marked = int(run.rows["near_noise_floor"].sum())
    return [
        f"{marked} measurements lie within 3× of their reference's noise floor; "
        "`measurements.csv` marks them.",
        "",
        *_repairs(run.rows),
        *_machines(run.rows),
        *_times(run),
        f"{machine['processor']}, {machine['cores']} cores, {machine['threads']} threads; "
        f"Python {machine['python']}, commit {machine['commit'] or 'unknown'}; "
        f"`{machine['command']}`.",
        "",
    ]


def _times(run: GridRun) -> list[str]:
    """How far times can be trusted: those taken in rounds (equal time), and the others."""
    rows, machine, lines = run.rows, run.record["machine"], []
    rounds = rows[SPREAD].notna() if SPREAD in rows else pd.Series(False, rows.index)
    if rounds.any():
        lines += [
            f"Equal-time measurements are timed in rounds. {noise_sentence(rows[rounds])}",
            "",
        ]
    if not rounds.all():
        loads = [machine[name] for name in LOADS if name in machine]
        lines += [load_sentence(loads, machine["cores"]), ""]
    return lines


def _machines(rows: pd.DataFrame) -> list[str]:
    """Which times are compared, where more than one kind of machine measured."""
    sentence = machine_sentence(rows)
    return [sentence, ""] if sentence else []


def _gaps(run: GridRun) -> list[str]:
    """Which measurements have no result, and what that means for the tables."""
    gaps: dict[str, list[str]] = run.record["missing"]
    if not gaps:
        return []
    lines = ["Results are missing:", ""]
    for sampler, cases in gaps.items():
        more = f" and {len(cases) - MOST_NAMED} more" if len(cases) > MOST_NAMED else ""
        lines.append(f"- {sampler}: {', '.join(cases[:MOST_NAMED])}{more}")
    used = sum(len(compared(part)) for _, part in run.rows.groupby("budget"))
    return [
        *lines,
        "",
        "Errors and ranks are over those cases alone on which every sampler that has a result "
        f"anywhere has all of them; {len(run.rows) - used} finished measurements are "
        "therefore left out.",
        "",
    ]


def _repairs(rows: pd.DataFrame) -> list[str]:
    """Which maps had values clamped."""
    repaired = rows[rows["repaired"] > 0].groupby("environment")["repaired"].first()
    if repaired.empty:
        return []
    counts = ", ".join(f"{name} ({count})" for name, count in repaired.items())
    return [f"Values of NaN, infinity or below 0 were clamped in: {counts}.", ""]
