"""All plots of a grid's report: which there are, what they are called, and their files."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.report.figures import (
    Looks,
    difference_diagram,
    pareto_plot,
    pareto_points,
    save_plot,
)
from experiments.report.pair_matrix import pair_matrix
from experiments.report.rank_map import rank_map
from experiments.report.rankings import BudgetResult, Ranking
from metrics.registry import ranked_metrics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAPTIONS = {
    "rank": "Rank on every map by {}: lines of the first and the baseline, and all samplers below. "
    "Maps run from the first sampler's clearest win to its clearest loss.",
    "pairs": "Pairs by {}: the row's error over the column's, geometric mean over maps, and the "
    "numbers of maps on which it is smaller · equal · larger. Bold: told apart by Wilcoxon's "
    "signed-rank test with Holm's correction.",
    "cd": "Critical-difference diagram, {}: mean ranks, and bars over samplers that Nemenyi's test "
    "does not tell apart.",
    "pareto": "Mean {} against mean time per image, both axes logarithmic. The grey line is the "
    "Pareto front; who is on it has a colour. A thin line leads back to the time without preparing "
    "lights.",
}
"""What is said below each kind of plot, of a metric's label."""


def save_figures(
    folder: Path, results: list[BudgetResult], looks: Looks
) -> dict[str, dict[tuple[str, str], str]]:
    """Draw all plots into `folder`; file stems by budget, and under "" for all budgets.

    Within a budget they go by kind, as in `CAPTIONS`, and the metric's name.
    """
    made: dict[str, dict[tuple[str, str], str]] = {"": {}}
    for result in results:
        names = made[result.budget] = {}
        for found in result.rankings:
            for kind, draw in _drawn(found, looks).items():
                stem = f"{kind}_{found.metric.name}_{result.budget.replace('=', '')}"
                names[kind, found.metric.name] = save_plot(folder, stem, draw)
    for metric in ranked_metrics():
        if all(metric.name in result.table for result in results) and len(
            pareto_points(results, metric)
        ):
            draw = partial(pareto_plot, results, metric, looks)
            stem = save_plot(folder, f"pareto_{metric.name}", draw)
            made[""]["pareto", metric.name] = stem
    return made


def _drawn(found: Ranking, looks: Looks) -> dict[str, "Callable[[], Figure]"]:
    """The plots of a ranking by kind."""
    if not found.maps:
        return {}
    drawn: dict[str, Callable[[], Figure]] = {"rank": partial(rank_map, found, looks)}
    if not math.isnan(found.difference):
        drawn["pairs"] = partial(pair_matrix, found)
        drawn["cd"] = partial(difference_diagram, found, looks)
    return drawn
