"""Mean error and mean rank of every sampler over all maps and scenes.

Reproduces Table 1 of Wu, "Efficient environment map rendering based on decomposition", 2025: RMSE
and FLIP averaged over maps and scenes, and the rank of each method per map, averaged over maps.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from experiments.run.grid_experiment import (
    GridExperiment,
    GridRun,
    all_samplers,
    run_grid,
    scale_budgets,
)

if TYPE_CHECKING:
    from experiments.cli.commands import RunRequest

TEST_SCENES = ("rubiks-cube", "vase", "teapot", "birdcage")
PAPER = {
    "mis": (0.1579, 6.00, 0.1212, 2.81),
    "fhis": (0.1572, 5.63, 0.2217, 6.19),
    "median-cut": (0.0881, 4.16, 0.1819, 5.16),
    "variance-minimization": (0.1035, 4.88, 0.1546, 4.22),
    "tmms": (0.0886, 4.00, 0.1895, 5.72),
    "ours-no-upsampling": (0.0579, 2.16, 0.1191, 2.81),
    "ours": (0.0438, 1.16, 0.0865, 1.06),
}
"""RMSE, its rank, FLIP, its rank, as printed in the paper's Table 1."""


def report(run: GridRun) -> list[Path]:
    """The report, the summary and its LaTeX table."""
    from experiments.report.write import write_report

    return write_report(run, "Table 1")


EXPERIMENT = GridExperiment("table1", "Table 1", TEST_SCENES, all_samplers, scale_budgets, report)


def run(request: "RunRequest", dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    return run_grid(EXPERIMENT, request, dry_run)
