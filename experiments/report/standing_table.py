"""A standing as the first page shows it: in words, as lines with intervals, and its losses."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.report.full_table import full_table
from experiments.report.links import slug
from experiments.report.palette import Look
from experiments.report.standings import NAMES, BudgetResult, Standing

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
class StandingTable:
    """The standing by one measure.

    baseline : to whose error the ratios are
    ticks : position in percent and text of the ratio axis; sentence : the result in words
    rivals : who is best on how many of the blocks that the winner lost
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
    blocks: int
    rivals: str
    losses: list[dict[str, Any]]


def standing_table(
    result: BudgetResult,
    standing: Standing,
    looks: dict[str, Look],
    files: dict[tuple[str, str], str],
) -> StandingTable:
    axis = _axis(standing)
    text = full_table(result.table)
    start = list(text.columns).index(NAMES[standing.measure])
    words = dict(zip(result.table["sampler"], text.to_numpy(str).tolist(), strict=True))
    lines = []
    for place, label in enumerate(standing.samplers):
        error, rank, ratio, group = words[label][start : start + 4]
        lines.append(
            Line(
                place + 1, label, looks[label].color, f"samplers/{slug(label)}.html", error, rank,
                ratio, _whisker(standing, place, axis), group, standing.tied[place],
            )
        )  # fmt: skip
    return StandingTable(
        standing.measure, NAMES[standing.measure], standing.baseline, sentence(standing),
        doubt(standing), remarks(standing), lines, _ticks(axis), standing.blocks, _rivals(standing),
        _losses(standing, files),
    )  # fmt: skip


def sentence(standing: Standing) -> str:
    """Who won and by how much, in words."""
    name, maps = NAMES[standing.measure], len(standing.per_map)
    if not maps:
        return f"No map is finished by all samplers yet, so nobody has won by {name}."
    if len(standing.samplers) == 1:
        return f"{standing.winner} is the only sampler."
    first, second = standing.samplers[:2]
    ranks = standing.ranks.mean(axis=0)
    text = (
        f"{first} has the best mean rank by {name}, {ranks[0]:.2f}, and is first on "
        f"{standing.firsts[0]} of {maps} maps."
    )
    if standing.margin is None:
        return text
    margin, low, high = (
        float(values[1])
        for values in (standing.margin.ratio, standing.margin.low, standing.margin.high)
    )
    return (
        f"{text} The next, {second} ({ranks[1]:.2f}), has {margin:.2f} times the {name} of {first} "
        f"(geometric mean over maps, 95 % interval {low:.2f} to {high:.2f})."
    )


def doubt(standing: Standing) -> str:
    """What limits the conclusion; empty where nothing does."""
    maps = len(standing.per_map)
    if not maps or len(standing.samplers) < 2:
        return ""
    tied = [name for name, same in zip(standing.samplers, standing.tied, strict=True) if same][1:]
    if not tied:
        return ""
    return (
        f"Over {maps} map{'s' * (maps > 1)}, mean ranks less than {standing.difference:.2f} apart "
        f"may be chance (Nemenyi, 0.05): {standing.winner} is not told apart from "
        f"{_listed(tied)}."
    )


def remarks(standing: Standing) -> list[str]:
    """The Friedman test, and what the ratios leave out."""
    found = []
    test = standing.friedman
    if test is not None:
        found.append(
            f"Friedman test that all {test.methods} samplers are alike: χ² = {test.statistic:.1f}, "
            f"p = {test.p_value:.2g}."
        )
    left_out = len(standing.per_map) - standing.ratio_maps
    if left_out:
        found.append(
            f"Ratios leave out {left_out} map{'s' * (left_out > 1)} on which a sampler has no "
            "error at all."
        )
    return found


def _listed(names: list[str], most: int = 4) -> str:
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _axis(standing: Standing) -> tuple[float, float]:
    """Smallest and largest ratio of the axis."""
    if standing.ratio is None:
        return 1.0, 2.0
    low = float(np.min(standing.ratio.low))
    high = float(np.max(standing.ratio.high))
    return min(low, 1.0) / 1.03, max(high, 1.25) * 1.03


def _position(value: float, axis: tuple[float, float]) -> float:
    low, high = axis
    return round(100.0 * math.log(value / low) / math.log(high / low), 2)


def _whisker(standing: Standing, place: int, axis: tuple[float, float]) -> Whisker | None:
    if standing.ratio is None:
        return None
    low, middle, high = (
        _position(float(values[place]), axis)
        for values in (standing.ratio.low, standing.ratio.ratio, standing.ratio.high)
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


def _rivals(standing: Standing) -> str:
    counts = Counter(loss.best for loss in standing.losses)
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{name} on {count}" for name, count in ordered)


def _losses(standing: Standing, files: dict[tuple[str, str], str]) -> list[dict[str, Any]]:
    return [
        {
            "scene": loss.scene,
            "environment": loss.environment,
            "best": loss.best,
            "ratio": f"{loss.ratio:.2f}",
            "numbers": f"{loss.error:.4f} against {loss.best_error:.4f}",
            "page": files[loss.scene, loss.environment],
        }
        for loss in standing.losses
    ]
