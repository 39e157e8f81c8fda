"""Experiments over grids of measurements, their store, and the command line.

from experiments import load_run, summary

run = load_run("runs/table1-quick")   # or a folder under results/
run.rows                              # a DataFrame; results/columns.md says what is in it
summary(run.rows)                     # mean errors, ranks and costs by sampler and budget
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from experiments.report.summary import summary
    from experiments.run.loaded_run import load_run

__all__ = ["load_run", "summary"]
HOMES = {"load_run": "experiments.run.loaded_run", "summary": "experiments.report.summary"}
"""By name, not imported: what a map or a score depends on does not hang on reports."""


def __getattr__(name: str) -> Any:
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(HOMES[name]), name)
