"""Which steps of EnvDirects matter: draws alone, with masking, with k-means, with both.

Reproduces Table 2 of Wu 2025: mean RMSE and FLIP of the full method over maps and scenes with its
steps switched off, ratios to the whole method, and the paper's figures beside them.
"""

from experiments.report.rankings import results_of
from experiments.report.sections.ratios import ratios
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.published import TABLE2

CONFIGURATIONS = {
    "IS only": SamplerSpec("ours", (("masking", False), ("kmeans", False))),
    "IS + masking": SamplerSpec("ours", (("kmeans", False),)),
    "IS + k-means": SamplerSpec("ours", (("masking", False),)),
    "IS + masking + k-means": SamplerSpec("ours"),
}
"""In the order of the paper's table."""


@experiment("table2")
def table2() -> GridExperiment:
    """Which steps of EnvDirects matter: masking, k-means, both or neither."""
    names = {spec.label: name for name, spec in CONFIGURATIONS.items()}
    return GridExperiment(
        title="Ablation of EnvDirects (Wu 2025, Table 2)",
        sections=(ratios(names, "ours", TABLE2),),
        samplers=lambda: tuple(CONFIGURATIONS.values()),
        quick_scenes=2,
        published=TABLE2,
        figures=(PaperFigure("Table 2", "errors without masking and k-means", order),),
    )


def order(run: Run) -> tuple[str, str]:
    """How many pairs of configurations have the paper's order, and their ratios."""
    means = results_of(run)[0].table.set_index("sampler")
    pairs = [TABLE2.ordered_alike(name, means[name].to_dict()) for name in ("rmse", "flip")]
    alike, of = (sum(counts) for counts in zip(*pairs, strict=True))
    told = [
        f"{name} {means['rmse'][label] / means['rmse']['ours']:.2f} "
        f"({TABLE2.values[label]['rmse'][0] / TABLE2.values['ours']['rmse'][0]:.2f})"
        for name, label in ((name, spec.label) for name, spec in CONFIGURATIONS.items())
        if label in means.index and label != "ours"
    ]
    return (
        f"{answer(alike, of)}: {alike} of {of} pairs ordered alike",
        f"RMSE over the whole method's, in brackets the paper's: {', '.join(told)}.",
    )
