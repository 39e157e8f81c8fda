"""Leagues that may be asked for: samplers by what they return."""

from collections.abc import Mapping, Sequence

LEAGUES: dict[str, tuple[str, ...] | None] = {
    "all": None,
    "fixed": ("fixed lights", "layers", "disc lights"),
    "distribution": ("distribution", "distribution that sees the surface"),
}
"""By what may be asked for, what the samplers in it return; None for all."""


def members(leagues: Mapping[str, str], samplers: Sequence[str], league: str) -> list[int]:
    """The places of the samplers in a league."""
    wanted = LEAGUES[league]
    return [
        k for k, name in enumerate(samplers) if wanted is None or leagues.get(name, "") in wanted
    ]
