"""Which steps of EnvDirects matter: draws alone, with masking, with k-means, with both.

Reproduces Table 2 of Wu, "Efficient environment map rendering based on decomposition", 2025: mean
RMSE and FLIP of the full method over maps and scenes with its steps switched off, ratios to the
whole method, and the paper's figures beside them.

Scale quick uses two of the four scenes; --scenes takes others.
"""

from pathlib import Path

from experiments.run.defaults import with_quick_scenes
from experiments.run.grid_experiment import GridExperiment, Run, run_grid, scale_budgets
from experiments.run.request import RunRequest
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.table1 import TEST_SCENES

NAME = "table2"
TITLE = "Ablation of EnvDirects (Wu 2025, Table 2)"
WHOLE = "IS + masking + k-means"
CONFIGURATIONS = {
    "IS only": SamplerSpec("ours", (("masking", False), ("kmeans", False))),
    "IS + masking": SamplerSpec("ours", (("kmeans", False),)),
    "IS + k-means": SamplerSpec("ours", (("masking", False),)),
    WHOLE: SamplerSpec("ours"),
}
PAPER = {
    "IS only": (0.0599, 0.0988),
    "IS + masking": (0.0560, 0.0958),
    "IS + k-means": (0.0466, 0.0877),
    WHOLE: (0.0438, 0.0865),
}
"""RMSE and FLIP as printed."""


def configurations() -> tuple[SamplerSpec, ...]:
    """The four samplers in the order of the paper's table."""
    return tuple(CONFIGURATIONS.values())


def report(run: Run) -> list[Path]:
    """The report, the table and a plot of the ratios."""
    import matplotlib as mpl

    from experiments.report.ablation import ablation_table, ratio_plot, write_ablation
    from experiments.report.figures import STYLE, save_figure
    from experiments.report.write import closing, opening
    from experiments.run.record import write_text

    names = {spec.label: name for name, spec in CONFIGURATIONS.items()}
    tables = {
        budget: ablation_table(run.rows[run.rows["budget"] == budget], names, WHOLE, PAPER)
        for budget in run.budgets
        if (run.rows["budget"] == budget).any()
    }
    files = write_ablation(run.folder, NAME, tables, TITLE, [])
    with mpl.rc_context(STYLE):
        save_figure(run.folder, "ratios", ratio_plot(tables, WHOLE))
    body = files[1].read_text(encoding="utf-8").partition("\n\n")[2]
    text = "\n".join(
        [*opening(run, TITLE), body, "![Errors over those of the whole method](ratios.svg)", "",
         *closing(run)]
    )  # fmt: skip
    path = run.folder / "report.md"
    write_text(path, text)
    return [path, *files]


EXPERIMENT = GridExperiment(NAME, TITLE, TEST_SCENES, configurations, scale_budgets, report)


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    return run_grid(EXPERIMENT, with_quick_scenes(request), dry_run)
