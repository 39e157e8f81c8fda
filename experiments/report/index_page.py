"""What the first page says: winners, margins, losses, plots, and how it was all measured.

The templates read plain values, texts and positions. Words and figures are those of the report:
`sentences` and `sections.ranks.ranked_table`.
"""

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.report.case_pages import CasePage
from experiments.report.figures import pareto_plot, pareto_points, save_plot
from experiments.report.parts import Part, Table, Text
from experiments.report.previews import decoding_table
from experiments.report.ranking_plots import difference_diagram, pair_matrix, rank_map
from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.run_data import RunData, slug
from experiments.report.sections.ranks import KEY, beside_paper, ranked_table
from experiments.report.sentences import doubt, loss_sentence, remarks, rivals, verdict
from experiments.report.style import Looks
from experiments.report.summary import LEAGUE
from experiments.report.tables import text_of
from experiments.run.experiment import Published
from metrics.registry import NEAR, find_metric, leading_metric, ranked_metrics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BUSY = 1.25
"""A load above this many times the cores at the start makes times doubtful."""
TICKS = (*(0.125, 0.25, 0.5, 0.7, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0, 64.0),)
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


def context(
    data: RunData,
    found: list[BudgetResult],
    looks: Looks,
    figures: dict[str, dict[tuple[str, str], str]],
    cases: list[CasePage],
    published: Published | None = None,
) -> dict[str, Any]:
    """Everything that the first page's template reads.

    figures : as `save_figures` gives them; winners : the sampler of least error by case page
    """
    files = {(case.scene, case.environment): f"cases/{case.file}" for case in cases}
    width, height, subpixels = data.view
    scenes = sorted(data.rows["scene"].unique())
    maps = data.rows["environment"].nunique()
    return {
        "budgets": [
            {
                "name": result.budget,
                "anchor": slug(result.budget),
                "maps": result.rankings[0].maps,
                "tables": [ranking_table(result, one, looks, files) for one in result.rankings],
                "numbers": text_of(ranked_table(result)),
                "paper": list(_shown(beside_paper(result, published))) if published else [],
                "figures": _figures(figures[result.budget]),
            }
            for result in found
        ],
        "figures": _figures(figures[""]),
        "facts": _facts(data),
        "versions": data.measuring[-1]["versions"],
        "notes": _notes(data),
        "summary": f"{data.rows['sampler'].nunique()} samplers, {maps} environment maps, "
        f"{len(scenes)} scenes ({', '.join(scenes)}), budgets {', '.join(data.budgets)}. "
        f"Scale {data.scale}: images of {width}×{height} pixels with {subpixels} sub-pixels.",
        "winners": {case.file: next(iter(case.budgets.values()))[0].label for case in cases},
        "leading": leading_metric().label,
        "key": KEY,
        "decoding": " ".join(f"{value:g}" for value in decoding_table()),
    }


def _shown(parts: Iterable[Part]) -> Iterable[str | pd.DataFrame]:
    """Paragraphs and tables as the page prints them."""
    for part in parts:
        if isinstance(part, Text):
            yield part.text
        elif isinstance(part, Table):
            yield text_of(part)


def _figures(stems: dict[tuple[str, str], str]) -> list[dict[str, Any]]:
    """Kind, stem of the files, and what is said below; ranks have the page's whole width."""
    ordered = sorted(stems.items(), key=lambda item: [*CAPTIONS].index(item[0][0]))
    return [
        {
            "kind": kind, "stem": stem, "wide": kind == "rank",
            "caption": CAPTIONS[kind].format(find_metric(name).label),
        }
        for (kind, name), stem in ordered
    ]  # fmt: skip


def _facts(data: RunData) -> dict[str, str]:
    """Of the starts that measured: where they differ the first's time, the last's command and
    machine, and every commit."""
    last = data.measuring[-1]
    commits = dict.fromkeys(str(start["commit"] or "unknown") for start in data.measuring)
    return {
        "started": str(data.measuring[0]["started"]),
        "command": str(last["command"]),
        "commit": ", ".join(commits),
        "processor": f"{last['processor']}, {last['cores']} cores, {last['threads']} threads",
        "system": str(last["system"]),
        "python": str(last["python"]),
        "starts": str(len(data.measuring)),
    }


def _notes(data: RunData) -> list[str]:
    """What a reader has to bear in mind about noise."""
    rows, notes = data.rows, []
    for metric in ranked_metrics():
        if metric.near_column not in rows:
            continue
        near = rows[rows[metric.near_column].astype(bool)]
        if near.empty:
            notes.append(
                f"By {metric.label}, no measurement lies within {NEAR:g}× of what its reference's "
                "own noise gives."
            )
            continue
        counts = near["sampler"].value_counts().sort_index()
        who = ", ".join(f"{name} ({count})" for name, count in counts.items())
        notes.append(
            f"By {metric.label}, {len(near)} of {len(rows)} measurements lie within {NEAR:g}× of "
            f"what their reference's own noise gives: {who}. The pages of scenes and maps mark "
            "them."
        )
    loads = [
        session["load_average"] / session["cores"]
        for session in data.measuring
        if session.get("load_average") is not None and session.get("cores")
    ]
    if loads and max(loads) > BUSY:
        notes.append(
            f"Others used the machine, too: at a start {max(loads):.1f} processes waited for each "
            "core. Take times as rough."
        )
    if data.rows["environment"].nunique() < 10:
        notes.append(
            "There are few maps: ranks tell only large differences apart, and intervals are "
            "themselves uncertain."
        )
    return notes


def ranking_table(
    result: BudgetResult, ranking: Ranking, looks: Looks, files: dict[tuple[str, str], str]
) -> dict[str, Any]:
    """The ranking by one metric as texts.

    files : the pages of cases, by scene and map

    Ratios are to the error of `baseline`; `ticks` are positions in percent and texts of their
    logarithmic axis, a line's `whisker` the positions of its ratio and interval. `alike` marks who
    is not told apart from the first, `league` is empty where the rows do not tell. `notes` say what
    limits the verdict, `rivals` who is best on how many of the cases that the winner loses.
    """
    axis, name = _axis(ranking), ranking.metric.name
    table = ranked_table(result)
    text = text_of(table).set_axis(list(table.formats), axis="columns")
    text = text.set_index(table.rows["sampler"].to_numpy())
    shown = [f"{name}{part}" for part in ("", "_rank", "_interval", "_alike")]
    lines = []
    for place, label in enumerate(ranking.samplers):
        error, rank, ratio, alike = map(str, text.loc[label, shown])
        lines.append(
            {
                "place": place + 1, "label": label, "color": looks[label].color,
                "page": f"samplers/{slug(label)}.html", "error": error, "rank": rank,
                "ratio": ratio, "whisker": _whisker(ranking, place, axis), "alike": alike,
                "league": str(text.loc[label, LEAGUE]) if LEAGUE in table.rows else "",
            }
        )  # fmt: skip
    return {
        "metric": name,
        "name": ranking.metric.label,
        "baseline": ranking.baseline,
        "verdict": verdict(ranking),
        "notes": [*filter(None, [doubt(ranking)]), *remarks(ranking)],
        "lines": lines,
        "ticks": _ticks(axis),
        "cases": ranking.cases,
        "rivals": rivals(ranking),
        "losses": [
            {
                "case": f"{loss.scene} · {loss.environment}",
                "page": files[loss.scene, loss.environment],
                "sentence": loss_sentence(ranking, loss),
            }
            for loss in ranking.losses
        ],
    }


def _axis(ranking: Ranking) -> tuple[float, float]:
    """Smallest and largest ratio of the axis."""
    if ranking.ratio is None:
        return 1.0, 2.0
    low = float(np.min(ranking.ratio.low))
    high = float(np.max(ranking.ratio.high))
    return min(low, 1.0) / 1.03, max(high, 1.25) * 1.03


def _position(value: float, axis: tuple[float, float]) -> float:
    low, high = axis
    return round(100.0 * math.log(value / low) / math.log(high / low), 2)


def _whisker(ranking: Ranking, place: int, axis: tuple[float, float]) -> dict[str, float] | None:
    found = ranking.ratio
    if found is None:
        return None
    values = {"low": found.low, "middle": found.ratio, "high": found.high}
    return {name: _position(float(value[place]), axis) for name, value in values.items()}


def _ticks(axis: tuple[float, float]) -> list[tuple[float, str]]:
    """Ticks at least a fifth of the axis apart; 1 is always among them."""
    one = _position(1.0, axis)
    chosen = [(one, "1×")]
    for tick in TICKS:
        position = _position(tick, axis)
        if 0.0 <= position <= 100.0 and all(abs(position - at) > 20.0 for at, _ in chosen):
            chosen.append((position, f"{tick:g}×"))
    return sorted(chosen)


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
