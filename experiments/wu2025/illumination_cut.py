"""The modified illumination cut of EnvIndirects against the original one, at the same budgets.

Reproduces Fig. 6 of Wu, "Efficient environment map rendering based on decomposition", 2025. The
original cut (Cheslack-Postava et al. 2008) splits by luminance variance alone, w_V, w_D, w_E =
1, 0, 0 in Eq. 3; the modified one has 1, 5, 1. EnvDirects are the same. Both are compared with and
without upsampling, by errors and by false edges. The paper shows a pair of images, says "fewer
shadow artifacts" and that the original is worse with 8 to 32 lights; it prints no figures.
"""

from dataclasses import replace

from experiments.report.sections.comparison_figures import comparison_figures
from experiments.report.sections.ratios import ratios
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.false_edge_table import edge_lines, false_edge_section

ORIGINAL = (("variance_weight", 1.0), ("extent_weight", 0.0), ("energy_weight", 0.0))
CONFIGURATIONS = {
    "modified": SamplerSpec("ours-no-upsampling"),
    "original": SamplerSpec("ours-no-upsampling", ORIGINAL),
    "modified, upsampled": SamplerSpec("ours"),
    "original, upsampled": SamplerSpec("ours", ORIGINAL),
}
LIGHTS = (8, 16, 32)
"""The numbers of lights for which the paper modified the cut."""


@experiment("illumination-cut")
def illumination_cut() -> GridExperiment:
    """The modified illumination cut against the original one, with false shadow edges."""
    names = {spec.label: name for name, spec in CONFIGURATIONS.items()}
    modified, original, *upsampled = names
    pairs = {original: modified, upsampled[1]: upsampled[0]}

    def shown(run: Run) -> Run:
        """Both cuts at full resolution, at the middle budget where there is one."""
        middle = f"lights={LIGHTS[1]}"
        budgets = [middle] if middle in run.budgets else run.budgets[:1]
        labels = [original, modified]
        rows = run.rows[run.rows["budget"].isin(budgets) & run.rows["sampler"].isin(labels)]
        return replace(
            run, rows=rows, record={**run.record, "budgets": budgets, "samplers": labels}
        )

    return GridExperiment(
        title="Modified against original illumination cut (Wu 2025, Fig. 6)",
        sections=(
            ratios(names, modified),
            false_edge_section(pairs, names),
            comparison_figures(part=shown, lines=edge_lines, names=names),
        ),
        samplers=lambda: tuple(CONFIGURATIONS.values()),
        budgets=lambda scale: tuple(map(Budget, LIGHTS)),
        quick_scenes=2,
        quick_maps=2,
    )
