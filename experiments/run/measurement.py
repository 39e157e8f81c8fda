"""A measurement: a sampler at a budget with a seed on a case, and what determines its row.

Three things are told apart, so that a change touches what depends on it and nothing else: the
reference (`Case.reference_key`), the image (`Measurement.key`), and the score of an image by one
metric (`Case.score_keys`). A changed sampler leaves references alone; a changed metric renders
nothing.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import TIMED, Budget
from experiments.run.case import Case, name_and_file
from experiments.run.identity import Shared, digest, library_versions, own_programs, programs
from experiments.run.machine import machine_identity
from experiments.run.sampler_spec import SamplerSpec, single_sampler
from experiments.run.scale import Scale
from samplers import EnvlightError
from samplers.threads import thread_count

RENDERING = "experiments.run.rendering"
"""Its own file counts; what it imports stands in the identities under names of its own."""
TIMING = tuple(f"experiments.run.{name}" for name in ("timed", "counts", "bench"))
"""Decide about measurements with a budget of seconds; so does the machine."""
STOCHASTIC_SEEDS = 3


@dataclass(frozen=True, slots=True)
class Measurement:
    """One sampler at one budget with one seed on one case. There may be a million of them."""

    case: Case
    sampler: SamplerSpec
    budget: Budget
    seed: int
    _key: str = field(default="", init=False, repr=False, compare=False)

    def __reduce__(self) -> tuple:
        """Another process finds the key from its own programs."""
        return Measurement, (self.case, self.sampler, self.budget, self.seed)

    @property
    def identity(self) -> dict[str, Any]:
        """What determines the image."""
        case = self.case
        return image_identity(case.shared, self.sampler, self.budget, self.seed, case.scale.sets)

    @property
    def like(self) -> "Measurement":
        """The measurement of the same case whose spending the budget is; its seed is 0."""
        if self.budget.at is None:
            raise EnvlightError(f"budget '{self.budget}': it is not what a sampler spends")
        return Measurement(self.case, single_sampler(self.budget.like), self.budget.at, 0)

    @property
    def key(self) -> str:
        """Hash of the identity: an image and its row are found again by it, and by nothing else."""
        if not self._key:
            object.__setattr__(self, "_key", digest(self.identity))
        return self._key

    @property
    def names(self) -> tuple[Any, ...]:
        """What its row says of it, whatever its programs: see `NAMES`."""
        case = self.case
        return case.scene, case.environment.name, self.sampler.label, str(self.budget), self.seed

    def __str__(self) -> str:
        return f"{self.case} · {self.sampler.label} · {self.budget} · seed {self.seed}"


def image_identity(
    case: Shared, sampler: SamplerSpec, budget: Budget, seed: int, sets: int
) -> dict[str, Any]:
    """What determines an image in a case of this identity."""
    found = {
        "case": case,
        "sampler": sampler.shared,
        "budget": str(budget),
        "seed": seed,
        "sets": sets,
        "program": program(budget.kind, thread_count()),
    }
    if budget.at is not None:
        like = image_identity(case, single_sampler(budget.like), budget.at, 0, sets)
        found["like"] = Shared(like)
    return found


NAMES = ("scene", "environment", "sampler", "budget", "seed")
"""The columns that tell measurements of an experiment at a scale apart."""


@lru_cache(maxsize=64)
def program(kind: str, threads: int) -> Shared:
    """What renders, and finds the counts that no budget of lights gives; times depend on the
    machine, too. threads : of kernels, now
    """
    found: dict[str, Any] = {
        "programs": programs("renderer.render") | own_programs(RENDERING),
        "libraries": library_versions("renderer.render"),
    }
    if kind in TIMED:
        found["programs"] |= own_programs(*TIMING)
        found["machine"] = machine_identity()
    elif kind == "rays":
        found["programs"] |= own_programs("experiments.run.counts")
    return Shared(found)


@dataclass(frozen=True)
class Grid:
    """What is compared: every combination of these, at one scale.

    scenes : names of built-in scenes and paths of scene files
    also : further pairs of sampler and budget, on every case
    """

    scenes: tuple[str, ...]
    environments: tuple[EnvironmentSource, ...]
    samplers: tuple[SamplerSpec, ...]
    budgets: tuple[Budget, ...]
    scale: Scale
    seeds: int = STOCHASTIC_SEEDS
    also: tuple[tuple[SamplerSpec, Budget], ...] = ()

    def measurements(self) -> list[Measurement]:
        """All measurements, case by case. Only stochastic samplers get several seeds."""
        pairs = [
            (sampler, budget, self.seeds if sampler.sampler.stochastic else 1)
            for sampler, budget in self._pairs()
            if _possible(sampler, budget)
        ]
        return [
            Measurement(case, sampler, budget, seed)
            for environment in self.environments
            for name, file in map(name_and_file, self.scenes)
            for case in [Case(name, environment, self.scale, file)]
            for sampler, budget, seeds in pairs
            for seed in range(seeds)
        ]

    def _pairs(self) -> list[tuple[SamplerSpec, Budget]]:
        product = [(sampler, budget) for budget in self.budgets for sampler in self.samplers]
        return list(dict.fromkeys((*product, *self.also)))

    def left_out(self) -> list[str]:
        """Sentences about samplers that cannot meet a budget, and so have no measurement at it."""
        return [
            f"{sampler.label} needs at least {sampler.sampler.minimum_count} lights and is left "
            f"out at {budget}"
            for sampler, budget in self._pairs()
            if not _possible(sampler, budget)
        ]


def _possible(sampler: SamplerSpec, budget: Budget) -> bool:
    """Whether a budget of lights has as many as the sampler needs; any other may be exceeded."""
    if budget.kind != "lights" or budget.like:
        return True
    return budget.lights >= sampler.sampler.minimum_count
