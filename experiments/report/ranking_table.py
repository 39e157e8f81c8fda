"""A ranking as the first page shows it: in words, as lines with intervals, and its losses.

Words and figures are those of the report: `sentences` and `sections.ranks.ranked_table`.
"""

import math
from dataclasses import dataclass

import numpy as np

from experiments.report.leagues import LEAGUE
from experiments.report.links import slug
from experiments.report.palette import Look
from experiments.report.rankings import BudgetResult, Ranking
from experiments.report.sections.ranks import ranked_table
from experiments.report.sentences import doubt, loss_sentence, remarks, rivals, verdict
from experiments.report.tables import text_of

TICKS = (*(0.125, 0.25, 0.5, 0.7, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0, 64.0),)


@dataclass(frozen=True)
class Whisker:
    """A ratio with its interval as positions in percent of a logarithmic axis."""

    low: float
    middle: float
    high: float


@dataclass(frozen=True)
class Line:
    """One sampler by one metric, as text. alike : the mark of who is not told apart from the first

    league : empty where the rows do not tell
    """

    place: int
    label: str
    color: str
    page: str
    error: str
    rank: str
    ratio: str
    whisker: Whisker | None
    alike: str
    league: str


@dataclass(frozen=True)
class LossLine:
    """A case that the winner loses: the page of its images, and a sentence."""

    case: str
    page: str
    sentence: str


@dataclass(frozen=True)
class RankingTable:
    """The ranking by one metric.

    baseline : to whose error the ratios are
    ticks : position in percent and text of the ratio axis; verdict : the result in words
    notes : what limits it
    rivals : who is best on how many of the cases that the winner lost
    """

    metric: str
    name: str
    baseline: str
    verdict: str
    notes: list[str]
    lines: list[Line]
    ticks: list[tuple[float, str]]
    cases: int
    rivals: str
    losses: list[LossLine]


def ranking_table(
    result: BudgetResult,
    ranking: Ranking,
    looks: dict[str, Look],
    files: dict[tuple[str, str], str],
) -> RankingTable:
    """The ranking as text. files : the pages of cases, by scene and map"""
    axis, name = _axis(ranking), ranking.metric.name
    table = ranked_table(result)
    text = text_of(table).set_index(table.rows["sampler"].to_numpy())
    shown = [table.headings[f"{name}{part}"] for part in ("", "_rank", "_interval", "_alike")]
    lines = []
    for place, label in enumerate(ranking.samplers):
        error, rank, ratio, alike = map(str, text.loc[label, shown])
        league = str(text.loc[label, LEAGUE]) if LEAGUE in table.rows else ""
        lines.append(
            Line(
                place + 1, label, looks[label].color, f"samplers/{slug(label)}.html", error, rank,
                ratio, _whisker(ranking, place, axis), alike, league,
            )
        )  # fmt: skip
    return RankingTable(
        name, ranking.metric.label, ranking.baseline, verdict(ranking),
        [*filter(None, [doubt(ranking)]), *remarks(ranking)], lines, _ticks(axis), ranking.cases,
        rivals(ranking),
        [
            LossLine(
                f"{loss.scene} · {loss.environment}", files[loss.scene, loss.environment],
                loss_sentence(ranking, loss),
            )
            for loss in ranking.losses
        ],
    )  # fmt: skip


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


def _whisker(ranking: Ranking, place: int, axis: tuple[float, float]) -> Whisker | None:
    if ranking.ratio is None:
        return None
    low, middle, high = (
        _position(float(values[place]), axis)
        for values in (ranking.ratio.low, ranking.ratio.ratio, ranking.ratio.high)
    )
    return Whisker(low, middle, high)


def _ticks(axis: tuple[float, float]) -> list[tuple[float, str]]:
    """Ticks at least a fifth of the axis apart; 1 is always among them."""
    one = _position(1.0, axis)
    chosen = [(one, "1×")]
    for tick in TICKS:
        position = _position(tick, axis)
        if 0.0 <= position <= 100.0 and all(abs(position - at) > 20.0 for at, _ in chosen):
            chosen.append((position, f"{tick:g}×"))
    return sorted(chosen)
