"""Mean error and mean rank of every sampler over all maps and scenes.

Reproduces Table 1 of Wu 2025: errors averaged over maps and scenes, and the rank of each method per
map, averaged over maps.
"""

from experiments.report.sections.bias_variance import bias_and_variance
from experiments.report.sections.ranks import pairwise, ranked
from experiments.run.experiment import GridExperiment, experiment
from experiments.wu2025.published import TABLE1


@experiment("table1")
def table1() -> GridExperiment:
    """Mean errors with mean ranks over maps and scenes."""
    return GridExperiment(
        title="Table 1",
        sections=(ranked(TABLE1, leagues=True), pairwise, bias_and_variance),
        published=TABLE1,
    )
