"""How much a sampler may spend on an image: lights, rays or seconds.

lights=K   the same number of lights or samples per shading point for all
rays=R     the same mean number of shadow and BRDF rays per sub-pixel, over all sub-pixels; the same
           on every machine
seconds=T  the same time to render; lights are generated apart

At the last two the number of lights is chosen for each sampler and case. No sampler can go below
its smallest number of lights: what that costs too much is measured there, and marked.
"""

import math
from dataclasses import dataclass

from samplers import EnvlightError

MOST_LIGHTS = 1 << 20
LIMITS = {"lights": (1.0, MOST_LIGHTS), "rays": (0.1, 1e5), "seconds": (1e-3, 3600.0)}
"""Smallest and largest amount of each kind."""


@dataclass(frozen=True)
class Budget:
    """amount : of lights per shading point, rays per sub-pixel, or seconds per image"""

    amount: float
    kind: str = "lights"

    @classmethod
    def parse(cls, text: str) -> "Budget":
        """From "lights=16", plain "16", "rays=8" or "seconds=0.5"; EnvlightError for others."""
        kind, _, value = text.rpartition("=")
        kind = kind or "lights"
        try:
            amount = float(value) if len(value) < 20 else math.nan
        except ValueError:
            amount = math.nan
        if kind not in LIMITS:
            raise EnvlightError(f"budget '{text}': write lights=K, rays=R or seconds=T")
        least, most = LIMITS[kind]
        whole = kind != "lights" or value.isdecimal()
        if not (least <= amount <= most and whole):
            number = "a whole number" if kind == "lights" else "a number"
            raise EnvlightError(
                f"budget '{text}': write {kind}= and {number} from {least:g} to {most:g}"
            )
        return cls(amount, kind)

    @property
    def lights(self) -> int:
        """The number of lights; EnvlightError for a budget of another kind."""
        if self.kind != "lights":
            raise EnvlightError(f"budget '{self}': only numbers of lights here; write lights=K")
        return int(self.amount)

    @property
    def timed(self) -> bool:
        """Whether what is measured depends on the machine."""
        return self.kind == "seconds"

    @property
    def order(self) -> tuple[int, float]:
        """Sorts budgets: lights, rays, seconds, and the smaller first."""
        return list(LIMITS).index(self.kind), self.amount

    def __str__(self) -> str:
        return f"{self.kind}={self.amount:.12g}"


def sorted_budgets(texts: list[str]) -> list[str]:
    """Budgets as text, in their order."""
    return sorted(texts, key=lambda text: Budget.parse(text).order)
