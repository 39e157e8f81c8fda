"""Eight sets of a method's own: each stands for the whole map, and lights stay where they were."""

import math
from dataclasses import fields

import numpy as np
import pytest

from samplers import DirectionalLights, EnvironmentMap, make_sampler
from samplers.lighting import SETS, LayeredLights
from samplers.registry import sampler_class, sampler_names
from samplers.sphere import pixel_direction

WITH_SETS = [
    name
    for name in sampler_names()
    if name != "fhis" and any(field.name == "sets" for field in fields(sampler_class(name)))
]
HEIGHT, ROW, COLUMN = 32, 11, 40


def sun_map() -> EnvironmentMap:
    """A textured sky, and a sun of one texel that has nine tenths of the flux."""
    sky = np.random.default_rng(5).uniform(0.5, 1.0, (HEIGHT, 2 * HEIGHT, 3))
    sky[ROW, COLUMN] = 9.0 * sky.sum(axis=(0, 1))
    return EnvironmentMap.from_array(sky.astype(np.float32))


def all_sets(lighting: DirectionalLights | LayeredLights) -> list[tuple[DirectionalLights, ...]]:
    """By set, the lights of all layers."""
    layers = (
        [lighting]
        if isinstance(lighting, DirectionalLights)
        else [lighting.direct, lighting.indirect]
    )
    return list(zip(*(layer.sets for layer in layers), strict=True))


@pytest.mark.parametrize("name", WITH_SETS)
def test_every_set_has_the_flux_and_the_sun(name):
    environment = sun_map()
    lighting = make_sampler(name, sets="independent").prepare(
        environment, 16, np.random.default_rng(1)
    )
    sets = all_sets(lighting)
    assert len(sets) == SETS
    sun = pixel_direction(np.array([ROW]), np.array([COLUMN]), HEIGHT)[0]
    for layers in sets:
        direction = np.concatenate([layer.direction for layer in layers])
        flux = np.concatenate([layer.irradiance for layer in layers])
        # The flux is summed in float64 from float32 radiance: 4096 texels round 1e-13 of it.
        np.testing.assert_allclose(flux.sum(axis=0), environment.total_flux, rtol=1e-11)
        # Nine tenths of the flux are the sun's: within a region of 60° the rest, a sixteenth or
        # less of a tenth, moves the centroid by 7° at most.
        bright = direction[flux.sum(axis=1).argmax()]
        assert math.degrees(math.acos(min(1.0, bright @ sun))) < 7.0
    seen = {b"".join(layer.direction.tobytes() for layer in layers) for layers in sets}
    assert len(seen) == SETS


def test_perturbed_is_the_default_and_has_one_set():
    for name in WITH_SETS:
        lighting = make_sampler(name).prepare(sun_map(), 16, np.random.default_rng(1))
        assert len(all_sets(lighting)) == 1
