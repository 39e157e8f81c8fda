"""All methods in the same time: comparison figures, error maps, insets and numbers.

Reproduces Fig. 1, 9, 10 and 14 of Wu 2025, whose methods had 4 seconds each at 1600×1200 pixels
with 4 sub-pixels on eight cores. Here they have as many seconds per pixel, on the machine at hand.
The time counts rendering; lights are generated apart, as in the paper.

Figures are drawn for the maps that the paper names, for one map of every class of the others, and
for the two hardest (Fig. 14: there, too, every method loses). The paper prints figures of single
images inside its pictures alone; its Table 1, of the same 4 seconds, stands beside ours.
"""

from collections.abc import Iterator

import pandas as pd

from experiments.report.case_figures import comparison_figures, hardest_maps
from experiments.report.parts import Heading, Part, Table, counted
from experiments.report.rankings import results_of
from experiments.report.sections.ranks import ranked
from experiments.report.style import label_of
from experiments.report.summary import errors_in
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.published import TABLE1, seconds_budget
from metrics.registry import find_metric, leading_metric

OWN = "ours"


@experiment("equal-time")
def equal_time() -> GridExperiment:
    """All methods in the same time: comparison figures, error maps, insets and numbers."""
    return GridExperiment(
        title="Equal time (Wu 2025, Fig. 1, 9, 10 and 14)",
        sections=(ranked(TABLE1), hardest, comparison_figures()),
        samplers=lambda: tuple(map(SamplerSpec, TABLE1.values)),
        budgets=seconds_budget,
        quick_scenes=2,
        quick_maps=1,
        published=TABLE1,
        figures=(
            PaperFigure(
                "Fig. 1, 9 and 10",
                "images and errors in equal time",
                lambda run: firsts(run, sorted(set(run.rows["environment"]))),
            ),
            PaperFigure(
                "Fig. 14",
                "the two hardest maps in equal time",
                lambda run: firsts(run, hardest_maps(run.rows)),
            ),
        ),
    )


def firsts(run: Run, maps: list[str]) -> tuple[str, str]:
    """On how many of the maps the paper's method has the least error, by each metric."""
    counts, told = [], []
    for ranking in results_of(run)[0].rankings:
        ranks = ranking.resolved.reindex(maps).dropna().rank(axis="columns", method="min")
        first = (ranks == 1.0).sum().sort_values(ascending=False, kind="stable")
        counts += [int(first.get(OWN, 0))]
        listed = ", ".join(
            f"{label_of(str(name))} on {count}" for name, count in first.items() if count
        )
        told.append(f"by {ranking.metric.label} {listed}")
    of = len(counts) * len(maps)
    return (
        f"{answer(sum(counts), of)}: first in {sum(counts)} of {of}",
        f"Least error, with ties, {'; '.join(told)} of {counted(len(maps), 'map')}.",
    )


def hardest(run: Run) -> Iterator[Part]:
    """Every sampler's errors on the maps that are hardest for the best of them."""
    yield Heading("The hardest maps")
    for budget in run.budgets:
        rows = run.at(budget)
        if len(rows):
            yield _hardest_table(rows)


def _hardest_table(rows: pd.DataFrame) -> Table:
    shown = pd.DataFrame({"sampler": list(dict.fromkeys(rows["sampler"]))})
    formats, headings = {"sampler": "s"}, {}
    for environment in hardest_maps(rows):
        part = rows[rows["environment"] == environment]
        for name in errors_in(rows):
            column, metric = f"{environment}_{name}", find_metric(name)
            shown[column] = shown["sampler"].map(part.groupby("sampler")[name].mean())
            formats[column], headings[column] = ".4f", f"{environment}, {metric.label}"
    caption = (
        f"{rows['budget'].iloc[0]}: maps on which the {leading_metric().label} of even the best is "
        "largest. The paper shows two such maps (Fig. 14), on which every method struggles and its "
        "own has the lowest errors."
    )
    return Table("hardest", shown, formats, headings, caption=caption)
