"""What `envlight run` was asked for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.maps.sources import EMBEDDED
from experiments.run.budget import WRITTEN, Budget
from experiments.run.executors import SERIAL
from samplers import EnvlightError

OPTIONS = {
    "environments": "--environments", "maps": "--maps", "scenes": "--scenes",
    "samplers": "--samplers", "budgets": "--budget", "repair": "--repair", "as_json": "--json",
    "executor": "--executor", "workers": "--workers", "cluster": "--cluster",
    "strict": "--strict", "reference_noise": "--reference-noise", "seeds": "--seeds",
    "timeout": "--timeout", "host": "--host", "tls": "--tls",
}  # fmt: skip
"""What an experiment may have no use for, by the fields' names, as options are written."""
USUAL = {"environments": EMBEDDED, "executor": SERIAL}
"""What stands where an option is not given; nothing, or nought, for the others."""


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
    timeout: float = 0.0
    host: str = ""
    tls: Path | None = None
    store: Path | None = None

    def budget(self, default: Budget) -> Budget:
        """The budget of an experiment that takes one of a kind; EnvlightError for others."""
        budgets = [Budget.parse(text) for text in self.budgets] or [default]
        if len(budgets) > 1 or budgets[0].kind != default.kind:
            told = ", ".join(self.budgets)
            raise EnvlightError(f"--budget {told}: one of {WRITTEN[default.kind]} here")
        return budgets[0]


class WatchedRequest(RunRequest):
    """A request that knows which of its options were read: what was not had no effect."""

    def __init__(self, request: RunRequest) -> None:
        super().__init__(**vars(request))
        vars(self)["_read"] = set()

    def __getattribute__(self, name: str) -> Any:
        if name in OPTIONS:
            vars(self)["_read"].add(name)
        return super().__getattribute__(name)

    def unread(self) -> list[str]:
        """The options that were given and not read, as they are written."""
        given = vars(self)
        return [
            option
            for name, option in OPTIONS.items()
            if name not in given["_read"] and given[name] and given[name] != USUAL.get(name)
        ]


def run_folder(output: Path | None, experiment: str, scale: str) -> Path:
    """The folder of a run: the one asked for, or runs/EXPERIMENT-SCALE."""
    return output or Path("runs") / f"{experiment}-{scale}"
