"""What preparing lights takes at its peak, beside the map."""

import tracemalloc

import numpy as np
import pytest

from samplers import EnvironmentMap, make_sampler
from samplers.registry import sampler_names

HEIGHT = 512
MAP = 12
"""Bytes a pixel in float32."""
FIXED = {"center-surround", "cycles"}
"""Their own tables have a size that does not follow a small map's."""


def noise(height: int) -> EnvironmentMap:
    """Four decades of light, of which every path of a sampler has something to do."""
    random = np.random.default_rng(0).uniform(-2.0, 2.0, (height, 2 * height, 3))
    return EnvironmentMap((10.0**random).astype(np.float32))


@pytest.mark.parametrize("name", sorted(set(sampler_names()) - FIXED))
def test_preparing_takes_at_most_three_times_the_map_beside_it(name):
    sampler = make_sampler(name)
    count = max(16, sampler.minimum_count)
    sampler.prepare(noise(8), count, np.random.default_rng(0))  # kernels
    environment = noise(HEIGHT)
    tracemalloc.start()
    try:
        sampler.prepare(environment, count, np.random.default_rng(0))
        peak = tracemalloc.get_traced_memory()[1] / (2 * HEIGHT * HEIGHT)
    finally:
        tracemalloc.stop()
    assert peak <= 3 * MAP
