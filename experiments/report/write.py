"""Everything a run leaves to read: CSV tables, a Markdown report, a montage per block."""

from itertools import groupby
from pathlib import Path

import pandas as pd

from experiments.cell import Cell
from experiments.report.tables import cell_rows, markdown, write_csv
from experiments.store import Store
from experiments.table1 import summary


def rows_of(store: Store, cells: list[Cell]) -> pd.DataFrame:
    """The finished rows of these cells alone: what else the folder holds stays out of the table."""
    rows = cell_rows(store)
    if rows.empty:
        return rows
    return rows[rows["key"].isin({cell.key for cell in cells})].reset_index(drop=True)


def write_report(store: Store, cells: list[Cell], images: bool) -> tuple[pd.DataFrame, Path]:
    """Write the tables, and the montages where `images`; returns the summary and the report."""
    rows = rows_of(store, cells)
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
    report.write_text(_text(store, cells, rows, table), encoding="utf-8")
    return table, report


def _text(store: Store, cells: list[Cell], rows: pd.DataFrame, table: pd.DataFrame) -> str:
    first = cells[0].block.scale
    done = f"{len(rows)} of {len(cells)} cells finished"
    session = store.sessions()[-1]
    marked = int(rows["near_noise_floor"].sum())
    return "\n".join(
        [
            f"# Table 1 at scale {first.name}"
            + ("" if len(rows) == len(cells) else " (incomplete)"),
            "",
            f"{done}. Scenes: {', '.join(sorted(rows['scene'].unique()))}. "
            f"{rows['environment'].nunique()} environment maps. Images of "
            f"{first.width}×{first.height} pixels with {first.subpixels} sub-pixels.",
            "",
            "RMSE and FLIP are means over maps and scenes after each reference's exposure; "
            "ranks are per map, equal errors share the better one, averaged over maps. `rays` "
            "are shadow and BRDF rays per sub-pixel. The last column is Table 1 of Wu 2025, "
            "from other scenes, maps and budgets.",
            "",
            markdown(table),
            f"{marked} cells lie within 3× of their reference's noise floor; `cells.csv` marks "
            "them.",
            "",
            f"{session['processor']}, {session['cores']} cores, {session['threads']} threads; "
            f"Python {session['python']}, commit {session['commit'] or 'unknown'}; "
            f"`{session['command']}`.",
            "",
            "Pictures of every block are in `montages/`, images in `images/`, references in "
            "`references/`, all rows in `cells.csv`, the summary in `summary.csv`.",
            "",
        ]
    )
