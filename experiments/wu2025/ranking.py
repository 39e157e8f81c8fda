"""Rank of every sampler on every map, how ranks are distributed, and which differ surely.

Reproduces Fig. 8 of Wu, "Efficient environment map rendering based on decomposition", 2025, by RMSE
and by FLIP: one line a method over the maps, in order of the error of the paper's full method. To
that come the distribution of the ranks and a critical-difference diagram (Friedman and Nemenyi, as
in Demšar 2006; see `metrics.ranking`), whose cases are the maps: scenes under one map are not
independent, so a map's error is the mean over its scenes. The paper prints no ranks per map; the
mean ranks of its Table 1 stand beside ours.

Scale quick uses two of the four scenes; --scenes takes others.
"""

from pathlib import Path

import pandas as pd

from experiments.report.rankings import Ranking
from experiments.run.defaults import with_quick_scenes
from experiments.run.grid_experiment import (
    GridExperiment,
    Run,
    all_samplers,
    run_grid,
    scale_budgets,
)
from experiments.run.request import RunRequest
from experiments.wu2025.table1 import PAPER, TEST_SCENES

NAME = "ranking"
TITLE = "Ranks per map (Wu 2025, Fig. 8)"
SORTED_BY = "ours"
PAPER_RANK = {"rmse": 1, "flip": 3}
"""Where the ranks stand in the rows of `PAPER`."""
FORMATS = {
    "sampler": "s", "error": ".4f", "mean_rank": ".2f", "paper_rank": ".2f", "first": "d",
    "worst_rank": ".0f", "ratio": ".2f", "group": "s", "near_floor": "d",
}  # fmt: skip


def report(run: Run) -> list[Path]:
    """The report, the ranks as CSV, and three plots by either error and budget."""
    import matplotlib as mpl

    from experiments.report.figures import STYLE, difference_diagram, rank_plot, save_figure
    from experiments.report.frames import rounded, table
    from experiments.report.palette import looks
    from experiments.report.rank_distribution import rank_distribution
    from experiments.report.ranking_table import doubt, remarks, sentence
    from experiments.report.rankings import NAMES, results
    from experiments.report.write import closing, opening
    from experiments.run.record import write_csv, write_text

    styles = looks(run.samplers)
    lines = opening(run, TITLE)
    ranks = []
    for result in results(run.rows):
        for found in result.rankings:
            lines += [f"## {NAMES[found.measure]}, {result.budget}", ""]
            if not len(found.per_map):
                lines += ["No map has a result of every sampler yet.", ""]
                continue
            ranks.append(_long(result.budget, found))
            stem = f"{found.measure}_{result.budget.replace('=', '')}"
            with mpl.rc_context(STYLE):
                order, words = _order(found)
                plots = {
                    f"Rank on each map; maps by {words}, least first.": save_figure(
                        run.folder, f"rank_{stem}", rank_plot(found, styles, order)
                    ),
                    "Distribution of the ranks.": save_figure(
                        run.folder, f"distribution_{stem}", rank_distribution(found)
                    ),
                }
                if found.difference == found.difference:
                    caption = (
                        f"Mean ranks over {len(found.per_map)} cases (maps) of "
                        f"{len(found.samplers)} samplers; bars join those that Nemenyi's test at "
                        f"5 % does not tell apart, critical difference {found.difference:.2f}."
                    )
                    plots[caption] = save_figure(
                        run.folder, f"cd_{stem}", difference_diagram(found, styles)
                    )
            lines += [sentence(found), *([doubt(found)] if doubt(found) else []), ""]
            lines += [table(rounded(_table(run, result.budget, found), FORMATS), "pipe"), ""]
            lines += [*remarks(found), ""]
            for caption, name in plots.items():
                lines += [f"![{caption}]({name}.svg)", "", f"*{caption}*", ""]
    lines += [
        "`paper rank` is the mean rank in Table 1 of Wu 2025, among seven methods on 32 other maps "
        "and four other scenes. `ratio` is the geometric mean over maps of the ratio to the error "
        "of median cut (of the best-ranked sampler where that was not run). Samplers that share a "
        "letter under `group` are not told apart. `near floor` counts "
        "measurements whose error is within 3× of the noise of their reference.",
        "",
        *closing(run),
    ]
    path, csv = run.folder / "report.md", run.folder / "ranks.csv"
    write_text(path, "\n".join(lines))
    if ranks:
        write_csv(csv, pd.concat(ranks, ignore_index=True))
    return [path, csv] if ranks else [path]


def _order(found: "Ranking") -> tuple:
    """The errors by which maps are sorted, and their description."""
    name = SORTED_BY if SORTED_BY in found.samplers else found.winner
    return found.per_map[name].to_numpy(), f"the error of {name}"


def _long(budget: str, found: "Ranking") -> pd.DataFrame:
    """Error and rank of every sampler on every map, one line each."""
    ranks = pd.DataFrame(found.ranks, found.per_map.index, found.per_map.columns)
    both = pd.DataFrame({"error": found.per_map.stack(), "rank": ranks.stack()})
    named = both.reset_index()
    named.insert(0, "measure", found.measure)
    named.insert(0, "budget", budget)
    return named


def _table(run: Run, budget: str, found: "Ranking") -> pd.DataFrame:
    near = run.rows[run.rows["budget"] == budget].groupby("sampler")["near_noise_floor"].sum()
    position = PAPER_RANK[found.measure]
    return pd.DataFrame(
        {
            "sampler": found.samplers,
            "error": found.per_map.mean().to_numpy(),
            "mean_rank": found.ranks.mean(axis=0),
            "paper_rank": [
                PAPER[name][position] if name in PAPER else float("nan") for name in found.samplers
            ],
            "first": found.firsts,
            "worst_rank": found.ranks.max(axis=0),
            "ratio": found.ratio.ratio if found.ratio else float("nan"),
            "group": found.letters,
            "near_floor": near.reindex(found.samplers).to_numpy(),
        }
    )


EXPERIMENT = GridExperiment(NAME, TITLE, TEST_SCENES, all_samplers, scale_budgets, report)


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    return run_grid(EXPERIMENT, with_quick_scenes(request), dry_run)
