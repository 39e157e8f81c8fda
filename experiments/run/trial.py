"""What a sampler makes of a small map: enough to tell what kind of lighting it returns."""

from functools import cache

import numpy as np

from experiments.run.sampler_spec import SamplerSpec
from samplers import EnvironmentMap, Lighting


@cache
def trial_lighting(spec: SamplerSpec) -> Lighting:
    """Its lighting of a map of 16 × 32 texels, none of them dark, at 16 lights or its least."""
    radiance = np.random.default_rng(0).uniform(0.2, 1.0, (16, 32, 3))
    count = max(16, spec.sampler.minimum_count)
    environment = EnvironmentMap.from_array(radiance)
    return spec.sampler.prepare(environment, count, np.random.default_rng(0))
