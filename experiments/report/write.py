"""The report of a grid run: Markdown, and its summary as CSV."""

from pathlib import Path

import pandas as pd

from experiments.grid_experiment import GridRun
from experiments.report.tables import markdown
from experiments.run_record import write_csv
from experiments.summary import compared, summary
from renderer.image import write_whole

MOST_NAMED = 20
"""More blocks than these are counted, not named."""


def write_report(run: GridRun, title: str) -> list[Path]:
    """Write report.md and summary.csv; returns both."""
    table = summary(run.rows)
    report, csv = run.folder / "report.md", run.folder / "summary.csv"
    write_csv(csv, table)
    text = _text(run, title, table)
    write_whole(report, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return [report, csv]


def _text(run: GridRun, title: str, table: pd.DataFrame) -> str:
    return "\n".join(
        [
            *opening(run, title),
            "RMSE and FLIP are means over maps and scenes after each reference's exposure; "
            "ranks are per map, equal errors share the better one, averaged over maps. `rays` "
            "are shadow and BRDF rays per sub-pixel. The last column is Table 1 of Wu 2025, "
            "from other scenes, maps and budgets.",
            "",
            markdown(table),
            *closing(run),
            "Pictures of every block are in `montages/`, images in `images/`, references in "
            "`references/`, all rows in `cells.csv`, the summary in `summary.csv`.",
            "",
        ]
    )


def opening(run: GridRun, title: str) -> list[str]:
    """Lines of Markdown: the heading, what was measured and what is missing."""
    rows, scale, planned = run.rows, run.record["scale"], run.record["planned"]
    return [
        f"# {title} at scale {scale['name']}" + ("" if len(rows) == planned else " (incomplete)"),
        "",
        f"{len(rows)} of {planned} cells finished. "
        f"Scenes: {', '.join(sorted(rows['scene'].unique()))}. "
        f"{rows['environment'].nunique()} environment maps. Images of "
        f"{scale['width']}×{scale['height']} pixels with {scale['subpixels']} sub-pixels.",
        "",
        *_gaps(run),
    ]


def closing(run: GridRun) -> list[str]:
    """Lines of Markdown: cells near the noise floor, repaired maps, and the machine."""
    machine = run.record["machine"]
    marked = int(run.rows["near_noise_floor"].sum())
    return [
        f"{marked} cells lie within 3× of their reference's noise floor; `cells.csv` marks them.",
        "",
        *_repairs(run.rows),
        f"{machine['processor']}, {machine['cores']} cores, {machine['threads']} threads; "
        f"Python {machine['python']}, commit {machine['commit'] or 'unknown'}; "
        f"`{machine['command']}`.",
        "",
    ]


def _gaps(run: GridRun) -> list[str]:
    """Which cells have no result, and what that means for the tables."""
    gaps: dict[str, list[str]] = run.record["missing"]
    if not gaps:
        return []
    lines = ["Results are missing:", ""]
    for sampler, blocks in gaps.items():
        more = f" and {len(blocks) - MOST_NAMED} more" if len(blocks) > MOST_NAMED else ""
        lines.append(f"- {sampler}: {', '.join(blocks[:MOST_NAMED])}{more}")
    used = sum(len(compared(part)) for _, part in run.rows.groupby("budget"))
    return [
        *lines,
        "",
        "Errors and ranks are over those blocks alone on which every sampler that has a result "
        f"anywhere has all of them; {len(run.rows) - used} finished cells are therefore left out.",
        "",
    ]


def _repairs(rows: pd.DataFrame) -> list[str]:
    """Which maps had values clamped."""
    repaired = rows[rows["repaired"] > 0].groupby("environment")["repaired"].first()
    if repaired.empty:
        return []
    counts = ", ".join(f"{name} ({count})" for name, count in repaired.items())
    return [f"Values of NaN, infinity or below 0 were clamped in: {counts}.", ""]
