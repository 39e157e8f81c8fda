"""Experiments over grids of measurements, their store, and the command line.

from experiments import load_run, summary

run = load_run("runs/table1-quick")   # or a folder under results/
run.rows                              # a DataFrame; results/columns.md says what is in it
summary(run.rows)                     # mean errors, ranks and costs by sampler and budget
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from experiments.run.loaded_run import Run

__all__ = ["load_run", "summary"]


def load_run(folder: str | Path) -> "Run":
    """The run in a folder: rows, record, kept images. EnvlightError where there is none."""
    from experiments.run.loaded_run import Run

    return Run.load(Path(folder))


def summary(rows: "pd.DataFrame") -> "pd.DataFrame":
    """One line per sampler and budget, by mean rank; see `experiments.report.summary.summary`."""
    from experiments.report import summary as home

    return home.summary(rows)
