"""Rank of every sampler on every map, how ranks are distributed, and which differ surely.

Reproduces Fig. 8 of Wu, "Efficient environment map rendering based on decomposition", 2025, by RMSE
and by FLIP: one line a method over the maps, in order of the error of the paper's full method. To
that come the distribution of the ranks and a critical-difference diagram. The paper prints no ranks
per map; the mean ranks of its Table 1, among seven methods on 32 other maps and four other scenes,
stand beside ours.
"""

from experiments.report.sections.rank_plots import rank_plots
from experiments.run.experiment import GridExperiment, experiment
from experiments.wu2025.published import TABLE1


@experiment("ranking")
def ranking() -> GridExperiment:
    """Rank of every sampler on every map, with the statistics of the differences."""
    return GridExperiment(
        title="Ranks per map (Wu 2025, Fig. 8)",
        sections=(rank_plots("ours", TABLE1),),
        quick_scenes=2,
        published=TABLE1,
    )
