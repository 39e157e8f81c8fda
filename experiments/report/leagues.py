"""Leagues: samplers side by side with those that return the same kind of lighting.

A fixed set of lights and a distribution that is drawn from afresh at every point err in different
ways, the one by bias alone, the other by noise; one that looks at the surface before it draws has
an easier task. Each row of a grid says what its sampler returns, in the column `league`; rows that
were measured before there was such a column do not.
"""

import pandas as pd

LEAGUE = "league"
LEAGUES = (
    "fixed lights",
    "layers",
    "disc lights",
    "distribution",
    "distribution that sees the surface",
)


def leagues_of(rows: pd.DataFrame) -> dict[str, str]:
    """The league of every sampler by its label; empty where the rows do not tell."""
    if LEAGUE not in rows:
        return {}
    found = rows.dropna(subset=[LEAGUE]).groupby("sampler", sort=True)[LEAGUE].first()
    return {str(sampler): str(league) for sampler, league in found.items()}


def in_order(leagues: dict[str, str]) -> list[str]:
    """The leagues that have members, the known ones first."""
    present = set(leagues.values())
    return [*(name for name in LEAGUES if name in present), *sorted(present - set(LEAGUES))]
