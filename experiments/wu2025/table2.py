"""Which steps of EnvDirects matter: draws alone, with masking, with k-means, with both.

Reproduces Table 2 of Wu, "Efficient environment map rendering based on decomposition", 2025: mean
RMSE and FLIP of the full method over maps and scenes with its steps switched off, ratios to the
whole method, and the paper's figures beside them.
"""

from experiments.report.sections.ratios import ratios
from experiments.run.experiment import GridExperiment, experiment
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
    )
