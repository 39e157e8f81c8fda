"""What a comparison measures: all combinations of scenes, maps, samplers, budgets and seeds."""

from dataclasses import dataclass

from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from experiments.run.scene_choice import name_and_file

STOCHASTIC_SEEDS = 3


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
        return [
            Measurement(Case(name, environment, self.scale, file), sampler, budget, seed)
            for environment in self.environments
            for name, file in map(name_and_file, self.scenes)
            for sampler, budget in self._pairs()
            for seed in range(self.seeds if sampler.sampler.stochastic else 1)
            if _possible(sampler, budget)
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
