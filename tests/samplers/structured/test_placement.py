"""Farthest-point placement against a search over all pairs."""

import numpy as np
import pytest

from samplers.environment import EnvironmentMap
from samplers.sphere import angular_distance, pixel_directions
from samplers.structured.placement import Texels, spread


def noise(height: int = 24, seed: int = 0) -> EnvironmentMap:
    radiance = np.random.default_rng(seed).random((height, 2 * height, 3)) + 0.01
    return EnvironmentMap(radiance.astype(np.float32))


def region_of(name: str, environment: EnvironmentMap) -> np.ndarray:
    direction = pixel_directions(environment.height).reshape(-1, 3)
    chosen = {
        "all": np.full(len(direction), True),
        "over the seam": direction[:, 2] < -0.8,
        "ring": np.abs(direction[:, 1]) < 0.2,
        "pole": direction[:, 1] > 0.7,
    }
    return np.flatnonzero(chosen[name])


@pytest.mark.parametrize("name", ["all", "over the seam", "ring", "pole"])
@pytest.mark.parametrize("held", [0, 5])
def test_each_sample_is_the_brightest_of_the_farthest(name, held):
    environment = noise()
    region, texels = region_of(name, environment), Texels.of(environment)
    samples = np.random.default_rng(1).choice(region, held, replace=False)
    new = spread(texels, region, samples, 20)
    direction = pixel_directions(environment.height).reshape(-1, 3)
    luminance = environment.luminance.reshape(-1)
    placed = samples.tolist()
    for k, texel in enumerate(new.tolist()):
        if placed:
            far = angular_distance(direction[region][:, None], direction[placed]).min(axis=1)
            # Equal to the rounding of angles: a billionth of a squared chord is half of that here.
            tied = region[far >= far.max() * (1.0 - 1e-9)]
            assert texel in tied and luminance[texel] == luminance[tied].max()
        else:
            assert k == 0
            moment = environment.flux.reshape(-1)[region] @ direction[region]
            near = angular_distance(direction[region], moment)
            assert near.min() == pytest.approx(angular_distance(direction[texel], moment), abs=1e-7)
        placed.append(texel)
    assert len(set(placed)) == held + 20


def test_every_texel_can_be_a_sample():
    environment = noise(4)
    region, texels = np.arange(32), Texels.of(environment)
    assert sorted([*spread(texels, region, np.array([7]), 31).tolist(), 7]) == list(range(32))
    assert len(spread(texels, region, np.array([7]), 0)) == 0
