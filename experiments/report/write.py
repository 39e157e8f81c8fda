"""Everything a run leaves to read: CSV tables, a Markdown report, a montage per block."""

from itertools import groupby
from pathlib import Path

import pandas as pd

from experiments.cell import Cell
from experiments.report.tables import cell_rows, markdown, write_csv
from experiments.store import Store
from experiments.table1 import compared, summary
from renderer.image import write_whole

MOST_NAMED = 20
"""More blocks than these are counted, not named."""


def rows_of(store: Store, keys: list[str]) -> pd.DataFrame:
    """The finished rows of these cells alone: what else the folder holds stays out of the table."""
    rows = cell_rows(store)
    return rows if rows.empty else rows[rows["key"].isin(keys)].reset_index(drop=True)


def write_report(store: Store, cells: list[Cell], images: bool) -> tuple[pd.DataFrame, Path]:
    """Write the tables, and the montages where `images`; returns the summary and the report."""
    rows = rows_of(store, [cell.key for cell in cells])
    table = summary(rows)
    folder = store.folder
    write_csv(folder / "cells.csv", rows)
    write_csv(folder / "summary.csv", table)
    if images:
        from experiments.report.montage import write_montage

        by_key = rows.set_index("key")
        for _, group in groupby(cells, key=lambda cell: (cell.block, cell.budget)):
            members = list(group)
            write_montage(folder, members[0].block, members, by_key)
    report = folder / "report.md"
    text = _text(store, cells, rows, table)
    write_whole(report, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return table, report


def _text(store: Store, cells: list[Cell], rows: pd.DataFrame, table: pd.DataFrame) -> str:
    first = cells[0].block.scale
    session = store.sessions()[-1]
    marked = int(rows["near_noise_floor"].sum())
    return "\n".join(
        [
            f"# Table 1 at scale {first.name}"
            + ("" if len(rows) == len(cells) else " (incomplete)"),
            "",
            f"{len(rows)} of {len(cells)} cells finished. "
            f"Scenes: {', '.join(sorted(rows['scene'].unique()))}. "
            f"{rows['environment'].nunique()} environment maps. Images of "
            f"{first.width}×{first.height} pixels with {first.subpixels} sub-pixels.",
            "",
            *_gaps(cells, rows),
            "RMSE and FLIP are means over maps and scenes after each reference's exposure; "
            "ranks are per map, equal errors share the better one, averaged over maps. `rays` "
            "are shadow and BRDF rays per sub-pixel. The last column is Table 1 of Wu 2025, "
            "from other scenes, maps and budgets.",
            "",
            markdown(table),
            f"{marked} cells lie within 3× of their reference's noise floor; `cells.csv` marks "
            "them.",
            "",
            *_repairs(rows),
            f"{session['processor']}, {session['cores']} cores, {session['threads']} threads; "
            f"Python {session['python']}, commit {session['commit'] or 'unknown'}; "
            f"`{session['command']}`.",
            "",
            "Pictures of every block are in `montages/`, images in `images/`, references in "
            "`references/`, all rows in `cells.csv`, the summary in `summary.csv`.",
            "",
        ]
    )


def _gaps(cells: list[Cell], rows: pd.DataFrame) -> list[str]:
    """Which cells have no result, and what that means for the tables."""
    there = set(rows["key"])
    gaps: dict[str, list[str]] = {}
    for cell in cells:
        if cell.key not in there:
            gaps.setdefault(cell.sampler.label, []).append(str(cell.block))
    if not gaps:
        return []
    lines = ["Results are missing:", ""]
    for sampler, found in gaps.items():
        blocks = list(dict.fromkeys(found))
        more = f" and {len(blocks) - MOST_NAMED} more" if len(blocks) > MOST_NAMED else ""
        lines.append(f"- {sampler}: {', '.join(blocks[:MOST_NAMED])}{more}")
    used = sum(len(compared(part)) for _, part in rows.groupby("budget"))
    return [
        *lines,
        "",
        "Errors and ranks are over those blocks alone on which every sampler that has a result "
        f"anywhere has all of them; {len(rows) - used} finished cells are therefore left out.",
        "",
    ]


def _repairs(rows: pd.DataFrame) -> list[str]:
    """Which maps had values clamped."""
    repaired = rows[rows["repaired"] > 0].groupby("environment")["repaired"].first()
    if repaired.empty:
        return []
    counts = ", ".join(f"{name} ({count})" for name, count in repaired.items())
    return [f"Values of NaN, infinity or below 0 were clamped in: {counts}.", ""]
