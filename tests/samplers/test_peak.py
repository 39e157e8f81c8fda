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
MORE = {
    "mksource": 40, "stratified-regions": 72, "structured": 60, "sun-and-sh": 56,
    "variance-minimization": 40,
}  # fmt: skip
"""Bytes a pixel beside the map: what is left of it, in float64; orders of texels by region; four
summed-area tables."""


@pytest.mark.parametrize("name", sorted(set(sampler_names()) - FIXED))
def test_preparing_takes_at_most_three_times_the_map_beside_it(name):
    sampler = make_sampler(name)
    count = max(16, sampler.minimum_count)
    tiny = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    sampler.prepare(tiny, count, np.random.default_rng(0))  # kernels
    random = np.random.default_rng(0).uniform(-2.0, 2.0, (HEIGHT, 2 * HEIGHT, 3))
    environment = EnvironmentMap((10.0**random).astype(np.float32))
    tracemalloc.start()
    try:
        sampler.prepare(environment, count, np.random.default_rng(0))
        peak = tracemalloc.get_traced_memory()[1] / (2 * HEIGHT * HEIGHT)
    finally:
        tracemalloc.stop()
    assert peak <= MORE.get(name, 3 * MAP)
