"""How much a sampler may spend on an image: lights, rays or seconds.

lights=K          the same number of lights or samples per shading point for all
rays=R            the same mean number of shadow and BRDF rays per sub-pixel, over all sub-pixels;
                  the same on every machine
seconds=T         the same time to render; lights are generated apart

rays=SAMPLER:K    as many rays as the sampler traces in the case with K lights
time=SAMPLER:K    as long as it takes there with K lights, measured in the same run: an order at
                  equal time that hardly depends on how fast the machine is
lights=SAMPLER@BUDGET  as many lights as the sampler has there at a budget of rays

At all but the first the number of lights is chosen for each sampler and case. No sampler can go
below its smallest number of lights: what that costs too much is measured there, and marked.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from samplers import EnvlightError

MOST_LIGHTS = 1 << 20
LIMITS = {"lights": (1.0, MOST_LIGHTS), "rays": (0.1, 1e5), "seconds": (1e-3, 3600.0)}
"""Smallest and largest amount of each kind; time is always a sampler's."""
TIMED = ("seconds", "time")
"""Kinds at which what is measured depends on the machine."""
WRITTEN = {
    "lights": "lights=K", "rays": "rays=R or rays=SAMPLER:K", "seconds": "seconds=T",
    "time": "time=SAMPLER:K",
}  # fmt: skip
"""How a budget of each kind is written."""
SPENT_AT = {"lights": "rays", "rays": "lights", "time": "lights"}
"""Kinds that may be what a sampler spends, and the kind of budget at which it does."""
ALLOWED = "allowed"
"""The column of what that came to in the row's case: lights, rays per sub-pixel, or seconds."""

PREFERRED_BUDGET = "lights=16"
"""What is shown of a run at first, where it has it."""


@dataclass(frozen=True)
class Budget:
    """amount : of lights per shading point, rays per sub-pixel, or seconds per image
    like : label of the sampler whose spending at the budget `at` it is; empty where `amount` is one
        of the kind itself
    """

    amount: float
    kind: str = "lights"
    like: str = ""
    at: "Budget | None" = None

    @classmethod
    def parse(cls, text: str) -> "Budget":
        """From "lights=16", plain "16", "rays=8", "seconds=0.5" or "time=median-cut:8".

        Raises EnvlightError for others.
        """
        kind, _, value = text.partition("=") if "=" in text else ("lights", "", text)
        if kind not in WRITTEN:
            raise EnvlightError(f"budget '{text}': write {', '.join(WRITTEN.values())}")
        if kind in SPENT_AT and (like := cls._like(kind, value)) is not None:
            return like
        if kind not in LIMITS:
            raise EnvlightError(f"budget '{text}': write {WRITTEN[kind]}")
        try:
            amount = float(value) if len(value) < 20 else math.nan
        except ValueError:
            amount = math.nan
        least, most = LIMITS[kind]
        if not (least <= amount <= most and (kind != "lights" or value.isdecimal())):
            number = "a whole number" if kind == "lights" else "a number"
            raise EnvlightError(
                f"budget '{text}': write {kind}= and {number} from {least:g} to {most:g}"
            )
        return cls(amount, kind)

    @classmethod
    def _like(cls, kind: str, value: str) -> "Budget | None":
        """From "SAMPLER:K" or "SAMPLER@BUDGET"; None for anything else."""
        like, _, inner = value.partition("@")
        if not inner:
            like, _, inner = value.rpartition(":")
        if not (like and inner):
            return None
        at = cls.parse(inner)
        if at.kind != SPENT_AT[kind]:
            wanted = WRITTEN[SPENT_AT[kind]]
            raise EnvlightError(f"budget '{kind}={value}': write {wanted} behind the sampler")
        return cls(at.amount, kind, like, at)

    @property
    def lights(self) -> int:
        """The number of lights; EnvlightError for a budget of another kind."""
        if self.kind != "lights" or self.like:
            raise EnvlightError(f"budget '{self}': only numbers of lights here; write lights=K")
        return int(self.amount)

    @property
    def timed(self) -> bool:
        """Whether what is measured depends on the machine."""
        return self.kind in TIMED

    @property
    def equal(self) -> str:
        """What samplers have alike at it: lights, rays or time."""
        return "time" if self.timed else self.kind

    @property
    def order(self) -> tuple[int, str, float]:
        """Sorts budgets: lights, rays, seconds, times, and the smaller first."""
        return list(WRITTEN).index(self.kind), self.like, self.amount

    @property
    def in_words(self) -> str:
        """As one says it: "8 rays a sub-pixel", "the time of median-cut with 8 lights"."""
        if self.at is None:
            return f"{self.amount:g} {'rays a sub-pixel' if self.kind == 'rays' else self.kind}"
        how = "with" if self.at.kind == "lights" else "at"
        return f"the {self.kind} of {self.like} {how} {self.at.in_words}"

    def __str__(self) -> str:
        if self.at is None:
            return f"{self.kind}={self.amount:.12g}"
        short = f":{self.amount:.12g}" if self.at.kind == "lights" and not self.at.like else ""
        return f"{self.kind}={self.like}{short or f'@{self.at}'}"


def opening_budget(budgets: Iterable[str]) -> str:
    """The budget that a run's report and pages open with: of its rows', that of the most."""
    rows = Counter(budgets)
    return PREFERRED_BUDGET if PREFERRED_BUDGET in rows else rows.most_common(1)[0][0]


def sorted_budgets(texts: list[str]) -> list[str]:
    """Budgets as text, in their order."""
    return sorted(texts, key=lambda text: Budget.parse(text).order)
