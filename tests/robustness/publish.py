"""Figures of the campaigns as CSV and Markdown."""

import platform
from pathlib import Path

import pandas as pd

from experiments.run.machine import record
from experiments.run.record import write_csv, write_text
from tests.robustness.kills import End, Kill
from tests.robustness.tally import FAULTS, Tally

KILLED, ENDED = "kills.csv", "killed_runs.csv"


def publish_kills(folder: Path, kills: list[Kill], ends: list[End], seed: int) -> tuple[Path, int]:
    """Write kills.md and its tables; returns it and the number of faults."""
    struck, ended = pd.DataFrame(kills), pd.DataFrame(ends)
    write_csv(folder / KILLED, struck)
    write_csv(folder / ENDED, ended)
    harm = {
        "finished measurements lost": struck["lost"].sum() + ended["lost"].sum(),
        "finished measurements measured again": struck["again"].sum() + ended["again"].sum(),
        "measurements stored twice": struck["twice"].sum(),
        "damaged rows, stores or images": struck["corrupt"].sum(),
        "ends without the sentence that is owed": (~struck["told"]).sum(),
        "runs that did not end with status 0": (ended["status"] != 0).sum(),
        "tables that differ from those of a run never killed": (~ended["table"]).sum(),
        "runs with an image that differs": (~ended["files"]).sum(),
        "files left over": ended["leftovers"].sum(),
    }
    counts = struck.groupby(["phase", "signal"]).size().unstack("signal", fill_value=0)
    lines = [
        f"{len(ended)} runs of {ended['finished'].max()} measurements were killed "
        f"{len(struck)} times "
        f"at random moments (seed {seed}), each one to three times, and left to end.",
        "",
        counts.rename_axis(None, axis="columns").reset_index().to_markdown(index=False),
        "",
        *(f"- {what}: {count}" for what, count in harm.items()),
        "",
        "Tables are compared byte for byte, timed columns left out; images too. `kills.csv` has "
        "every kill, `killed_runs.csv` every run.",
    ]
    return _write(folder / "kills.md", "Runs that were killed", lines), int(sum(harm.values()))


def publish_tally(
    folder: Path, name: str, title: str, about: str, tally: Tally
) -> tuple[Path, int]:
    """Write NAME.md and NAME.csv; returns the first and the number of faults."""
    table = tally.table()
    write_csv(folder / f"{name}.csv", table)
    lines = [
        about,
        "",
        table.to_markdown(index=False),
        "",
        f"The slowest took {tally.slowest:.1f} s, loading of libraries and kernels included; no "
        f"process held more than {tally.peak_bytes / 2**30:.2f} GiB.",
        *(
            f"- number {number}, {group}, {what}: {text}"
            for number, group, what, text in tally.faults
        ),
    ]
    return _write(folder / f"{name}.md", title, lines), int(table[list(FAULTS)].iloc[-1].sum())


def _write(path: Path, title: str, lines: list[str]) -> Path:
    machine = record()
    foot = (
        f"{machine['processor']}, {machine['cores']} cores; Python {platform.python_version()}, "
        f"OpenEXR {machine['versions']['OpenEXR']}, NumPy {machine['versions']['numpy']}; commit "
        f"{machine['commit'] or 'unknown'}."
    )
    text = "\n".join([f"# {title}", "", *lines, "", foot, ""])
    write_text(path, text)
    return path
