"""The modified illumination cut of EnvIndirects against the original one, at the same budgets.

Reproduces Fig. 6 of Wu, "Efficient environment map rendering based on decomposition", 2025. The
original cut (Cheslack-Postava et al. 2008) splits by luminance variance alone, w_V, w_D, w_E =
1, 0, 0 in Eq. 3; the modified one has 1, 5, 1. EnvDirects are the same. Both are compared with and
without upsampling, by RMSE, FLIP and false edges (see `metrics.false_edges`): shadow boundaries
that the reference does not have. The paper shows a pair of images, says "fewer shadow artifacts"
and that the original is worse with 8 to 32 lights; it prints no figures.

Scale quick uses two of the four scenes and one or two embedded maps of every kind, chosen by kind
alone; --maps '*' takes all. False edges need the images, which --no-images leaves out.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from experiments.report.case_figures import CaseImages
from experiments.run.budget import Budget
from experiments.run.defaults import with_quick_maps, with_quick_scenes
from experiments.run.foreground import foreground
from experiments.run.grid_experiment import GridExperiment, Run, run_grid
from experiments.run.request import RunRequest
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from experiments.wu2025.table1 import TEST_SCENES

NAME = "illumination-cut"
TITLE = "Modified against original illumination cut (Wu 2025, Fig. 6)"
ORIGINAL = (("variance_weight", 1.0), ("extent_weight", 0.0), ("energy_weight", 0.0))
CONFIGURATIONS = {
    "modified": SamplerSpec("ours-no-upsampling"),
    "original": SamplerSpec("ours-no-upsampling", ORIGINAL),
    "modified, upsampled": SamplerSpec("ours"),
    "original, upsampled": SamplerSpec("ours", ORIGINAL),
}
BASELINE = "modified"
LIGHTS = (8, 16, 32)
SHOWN = 16
FORMATS = {
    "budget": "s", "configuration": "s", "false_edges": ".5f", "ratio": ".3f", "more_false": "s",
}  # fmt: skip


def configurations() -> tuple[SamplerSpec, ...]:
    """The four samplers."""
    return tuple(CONFIGURATIONS.values())


def few_lights(scale: Scale) -> tuple[Budget, ...]:
    """The numbers of lights for which the paper modified the cut."""
    return tuple(Budget(count) for count in LIGHTS)


def false_edge_rows(run: Run) -> pd.DataFrame:
    """False edges of every kept image: scene, environment, budget, sampler, false_edges."""
    from experiments.report.case_figures import case_images
    from metrics.false_edges import false_edges

    found = []
    cases = run.rows[["scene", "environment", "budget"]].drop_duplicates()
    for scene, environment, budget in cases.itertuples(index=False):
        case = case_images(run, scene, environment, budget)
        if case is None:
            continue
        mask = foreground(run, scene)
        found += [
            {
                "scene": scene, "environment": environment, "budget": budget,
                "sampler": row["sampler"], "false_edges": false_edges(image, case.truth, mask),
            }
            for row, image in zip(case.rows, case.images, strict=True)
        ]  # fmt: skip
    return pd.DataFrame(found)


def edge_table(edges: pd.DataFrame, budgets: list[str]) -> pd.DataFrame:
    """Mean false edges by budget and configuration, ratio of means to the modified cut's at the
    same resolution, and on how many cases there are more than with it."""
    lines = []
    for budget in budgets:
        part = edges[edges["budget"] == budget]
        values = part.pivot_table(
            index=["scene", "environment"], columns="sampler", values="false_edges"
        ).dropna()
        for name, spec in CONFIGURATIONS.items():
            if spec.label not in values:
                continue
            base = CONFIGURATIONS[name.replace("original", "modified")].label
            mean = float(values[spec.label].mean())
            line: dict[str, object] = {"budget": budget, "configuration": name, "false_edges": mean}
            if name.startswith("original") and base in values:
                line["ratio"] = mean / float(values[base].mean())
                more = int((values[spec.label] > values[base]).sum())
                line["more_false"] = f"{more} of {len(values)}"
            lines.append(line)
    return pd.DataFrame(lines)


def report(run: Run) -> list[Path]:
    """The report with errors, false edges, their ratios and pairs of images; tables as CSV."""
    import matplotlib as mpl

    from experiments.report.ablation import ablation_table, ratio_plot, write_ablation
    from experiments.report.case_figures import gallery, shown_maps, write_strips
    from experiments.report.figures import STYLE, save_figure
    from experiments.report.frames import rounded, table
    from experiments.report.write import closing, opening
    from experiments.run.record import found_or_kept, write_text

    names = {spec.label: name for name, spec in CONFIGURATIONS.items()}
    tables = {
        budget: ablation_table(run.rows[run.rows["budget"] == budget], names, BASELINE, {})
        for budget in run.budgets
        if (run.rows["budget"] == budget).any()
    }
    files = write_ablation(run.folder, NAME, tables, TITLE, [])
    with mpl.rc_context(STYLE):
        save_figure(run.folder, "ratios", ratio_plot(tables, BASELINE))
    body = files[1].read_text(encoding="utf-8").partition("\n\n")[2]
    lines = [*opening(run, TITLE), body, "![Errors over those of the modified cut](ratios.svg)", ""]
    kept = run.folder / "false_edges.csv"
    edges = found_or_kept(kept, false_edge_rows(run))
    if len(edges):
        files.append(kept)
        lines += [
            "## False edges",
            "",
            table(rounded(edge_table(edges, run.budgets), FORMATS), "pipe"),
            "",
            "Mean over cases and foreground pixels of how much steeper the image is than its "
            "reference, per pixel, over the reference's mean luminance; both first averaged over "
            "the 4 × 2 pixels of the interleaving pattern. `ratio` is to the modified cut at the "
            "same resolution, `more false` the cases on which the original has more.",
            "",
        ]
    strips = write_strips(_pairs(run), shown_maps(run.rows), _edge_lines(run), names)
    lines += [*gallery(run, strips), *closing(run)]
    path = run.folder / "report.md"
    write_text(path, "\n".join(lines))
    return [path, *files]


def _pairs(run: Run) -> Run:
    """The run's rows at the middle budget, of the two cuts at full resolution."""
    budget = f"lights={SHOWN}"
    shown = [budget] if budget in run.budgets else run.budgets[:1]
    labels = [CONFIGURATIONS[name].label for name in ("original", "modified")]
    rows = run.rows[run.rows["budget"].isin(shown) & run.rows["sampler"].isin(labels)]
    return Run(run.folder, rows, {**run.record, "budgets": shown, "samplers": labels})


def _edge_lines(run: Run):
    from metrics.false_edges import false_edges

    def lines(case: "CaseImages") -> dict[str, str]:
        mask: np.ndarray | None = foreground(run, str(case.rows[0]["scene"]))
        return {
            str(row["sampler"]): f"false edges {false_edges(image, case.truth, mask):.5f}"
            for row, image in zip(case.rows, case.images, strict=True)
        }

    return lines


EXPERIMENT = GridExperiment(NAME, TITLE, TEST_SCENES, configurations, few_lights, report)


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    return run_grid(EXPERIMENT, with_quick_maps(with_quick_scenes(request), 2), dry_run)
