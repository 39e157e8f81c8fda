"""Words made from rows: sentences about a ranking, each held to the rows by a test."""

from experiments.report.rankings import Ranking


def verdict(ranking: Ranking) -> str:
    """Who is first and by how much, in words."""
    name, maps = ranking.metric.label, len(ranking.per_map)
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
