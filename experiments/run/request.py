"""What `envlight run` was asked for."""

from dataclasses import dataclass
from pathlib import Path

from experiments.run.budget import Budget
from experiments.run.executors import SERIAL

OF_GRIDS = {
    "as_json": "--json", "executor": "--executor", "workers": "--workers",
    "cluster": "--cluster", "strict": "--strict", "seeds": "--seeds",
}  # fmt: skip
"""Options that a study has no use for, as they are written: it runs in one process, and its rows
say which seeds there are."""


@dataclass(frozen=True)
class RunRequest:
    """The options of `envlight run`."""

    experiment: str
    scale: str
    environments: str
    maps: list[str]
    scenes: list[str]
    samplers: list[str]
    budgets: list[str]
    output: Path | None
    repair: bool
    images: bool
    threads: int
    as_json: bool = False
    executor: str = SERIAL
    workers: int = 0
    cluster: str = ""
    strict: bool = False
    reference_noise: float = 0.0
    seeds: int = 0

    def lights(self, default: int) -> int:
        """The number of lights of an experiment that takes one: the first budget's."""
        return Budget.parse(self.budgets[0]).lights if self.budgets else default

    def given_of_grids(self) -> list[str]:
        """The options given that only grids take, as they are written."""
        return [
            option
            for name, option in OF_GRIDS.items()
            if getattr(self, name) != getattr(RunRequest, name)  # its default
        ]
