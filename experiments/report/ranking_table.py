"""A ranking as the first page shows it: in words, as lines with intervals, and its losses."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.report.full_table import full_table
from experiments.report.links import slug
from experiments.report.palette import Look
from experiments.report.rankings import NAMES, BudgetResult, Ranking

TICKS = (1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0, 64.0)


@dataclass(frozen=True)
class Whisker:
    """A ratio with its interval as positions in percent of a logarithmic axis."""

    low: float
    middle: float
    high: float


@dataclass(frozen=True)
class Line:
    """One sampler by one measure, as text."""

    place: int
    label: str
    color: str
    page: str
    error: str
    rank: str
    ratio: str
    whisker: Whisker | None
    group: str
    tied: bool


@dataclass(frozen=True)
class RankingTable:
    """The ranking by one measure.

    baseline : to whose error the ratios are
    ticks : position in percent and text of the ratio axis; sentence : the result in words
    rivals : who is best on how many of the cases that the winner lost
    losses : text, link and numbers of each of them
    """

    measure: str
    name: str
    baseline: str
    sentence: str
    doubt: str
    remarks: list[str]
    lines: list[Line]
    ticks: list[tuple[float, str]]
    cases: int
    rivals: str
    losses: list[dict[str, Any]]


def ranking_table(
    result: BudgetResult,
    ranking: Ranking,
    looks: dict[str, Look],
    files: dict[tuple[str, str], str],
) -> RankingTable:
    axis = _axis(ranking)
    text = full_table(result.table)
    start = list(text.columns).index(NAMES[ranking.measure])
    words = dict(zip(result.table["sampler"], text.to_numpy(str).tolist(), strict=True))
    lines = []
    for place, label in enumerate(ranking.samplers):
        error, rank, ratio, group = words[label][start : start + 4]
        lines.append(
            Line(
                place + 1, label, looks[label].color, f"samplers/{slug(label)}.html", error, rank,
                ratio, _whisker(ranking, place, axis), group, ranking.tied[place],
            )
        )  # fmt: skip
    return RankingTable(
        ranking.measure, NAMES[ranking.measure], ranking.baseline, sentence(ranking),
        doubt(ranking), remarks(ranking), lines, _ticks(axis), ranking.cases, _rivals(ranking),
        _losses(ranking, files),
    )  # fmt: skip


def sentence(ranking: Ranking) -> str:
    """Who won and by how much, in words."""
    name, maps = NAMES[ranking.measure], len(ranking.per_map)
    if not maps:
        return f"No map is finished by all samplers yet, so nobody has won by {name}."
    if len(ranking.samplers) == 1:
        return f"{ranking.winner} is the only sampler."
    first, second = ranking.samplers[:2]
    ranks = ranking.ranks.mean(axis=0)
    text = (
        f"{first} has the best mean rank by {name}, {ranks[0]:.2f}, and is first on "
        f"{ranking.firsts[0]} of {maps} maps."
    )
    if ranking.margin is None:
        return text
    margin, low, high = (
        float(values[1])
        for values in (ranking.margin.ratio, ranking.margin.low, ranking.margin.high)
    )
    return (
        f"{text} The next, {second} ({ranks[1]:.2f}), has {margin:.2f} times the {name} of {first} "
        f"(geometric mean over maps, 95 % interval {low:.2f} to {high:.2f})."
    )


def doubt(ranking: Ranking) -> str:
    """What limits the conclusion; empty where nothing does."""
    maps = len(ranking.per_map)
    if not maps or len(ranking.samplers) < 2:
        return ""
    tied = [name for name, same in zip(ranking.samplers, ranking.tied, strict=True) if same][1:]
    if not tied:
        return ""
    return (
        f"Over {maps} map{'s' * (maps > 1)}, mean ranks less than {ranking.difference:.2f} apart "
        f"may be chance (Nemenyi, 0.05): {ranking.winner} is not told apart from "
        f"{_listed(tied)}."
    )


def remarks(ranking: Ranking) -> list[str]:
    """The Friedman test, and what the ratios leave out."""
    found = []
    test = ranking.friedman
    if test is not None:
        found.append(
            f"Friedman test that all {test.methods} samplers are alike: χ² = {test.statistic:.1f}, "
            f"p = {test.p_value:.2g}."
        )
    left_out = len(ranking.per_map) - ranking.ratio_maps
    if left_out:
        found.append(
            f"Ratios leave out {left_out} map{'s' * (left_out > 1)} on which a sampler has no "
            "error at all."
        )
    return found


def _listed(names: list[str], most: int = 4) -> str:
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


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
    """Ticks at least a fifth of the axis apart."""
    chosen: list[tuple[float, str]] = []
    for tick in TICKS:
        position = _position(tick, axis)
        if position <= 100.0 and (not chosen or position - chosen[-1][0] > 20.0):
            chosen.append((position, f"{tick:g}×"))
    return chosen


def _rivals(ranking: Ranking) -> str:
    counts = Counter(loss.best for loss in ranking.losses)
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{name} on {count}" for name, count in ordered)


def _losses(ranking: Ranking, files: dict[tuple[str, str], str]) -> list[dict[str, Any]]:
    return [
        {
            "scene": loss.scene,
            "environment": loss.environment,
            "best": loss.best,
            "ratio": f"{loss.ratio:.2f}",
            "numbers": f"{loss.error:.4f} against {loss.best_error:.4f}",
            "page": files[loss.scene, loss.environment],
        }
        for loss in ranking.losses
    ]
