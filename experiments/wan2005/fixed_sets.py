"""Which samplers make one global set of lights for a map, the same for all shading points."""

from experiments.run.experiment import all_samplers
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.trial import trial_lighting
from samplers import DirectionalLights, EnvlightError, LayeredLights

COUNT = 300
"""The paper's number of lights."""


def fixed_sets() -> tuple[SamplerSpec, ...]:
    """All registered samplers that do; others draw at each point, or choose their own number."""
    return tuple(spec for spec in all_samplers() if makes_fixed_set(spec))


def makes_fixed_set(spec: SamplerSpec) -> bool:
    """Whether a sampler does, by what it makes of a small map."""
    return isinstance(trial_lighting(spec), DirectionalLights | LayeredLights)


def chosen_fixed_sets(texts: list[str], count: int) -> tuple[SamplerSpec, ...]:
    """The samplers that the texts name, all of `fixed_sets` without any, that can make so many.

    Raises EnvlightError for one that makes no fixed set.
    """
    specs = choose_samplers(texts) if texts else fixed_sets()
    other = next((spec.label for spec in specs if not makes_fixed_set(spec)), None)
    if other is not None:
        raise EnvlightError(
            f"sampler '{other}': it makes no fixed set of lights for a map; leave it out here"
        )
    return tuple(spec for spec in specs if count >= spec.sampler.minimum_count)
