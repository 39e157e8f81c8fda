"""Lights and the residual map carry what the map does, whatever parts it."""

import numpy as np
import pytest

from experiments.export.light_set import audit, light_set, part
from samplers import EnvironmentMap, make_sampler, sampler_names
from samplers.conformance.stress_maps import STRESS_MAPS, stress_map
from samplers.lighting import LightDistribution, SurfaceDistribution

ON = ("sun-and-sky", "noise", "black")


def parted(sampler, environment, count=24):
    return part(sampler, environment, count, np.random.default_rng(1))


SMOOTHED = ("mksource", "sun-and-sh")
"""Samplers whose ambient map is no part of the map, but harmonics of what is left of it."""


@pytest.mark.parametrize("name", SMOOTHED)
def test_what_discs_leave_may_be_smaller_than_the_map(name):
    large = stress_map("sun-and-sky").radiance.repeat(8, axis=0).repeat(8, axis=1)
    environment = EnvironmentMap(large)
    found = parted(make_sampler(name), environment)
    assert found.residual.height < environment.height
    left = light_set(found.lights, environment, name, 24, 1, residual=found.residual)
    assert left.residual is found.residual and np.allclose(
        sum(layer.irradiance.sum(axis=0) for layer in left.layers), found.carried
    )


@pytest.mark.parametrize("name", sampler_names())
def test_lights_and_residual_carry_the_maps_energy_in_every_channel(name):
    sampler = make_sampler(name)
    for of_map in ON:
        environment = stress_map(of_map)
        found = parted(sampler, environment)
        if isinstance(found.lights, LightDistribution | SurfaceDistribution):
            return
        assert np.abs(found.error).max() <= 1e-6
        if name not in SMOOTHED:
            assert not (found.residual.radiance > environment.radiance).any()


@pytest.mark.parametrize("name", STRESS_MAPS)
@pytest.mark.parametrize("parameters", [{}, {"kmeans": False}, {"kmeans": False, "masking": False}])
def test_ours_leaves_the_pixels_that_env_directs_does_not_carry(name, parameters):
    environment, sampler = stress_map(name), make_sampler("ours", **parameters)
    found = parted(sampler, environment)
    whole = sampler.prepare(environment, 24, np.random.default_rng(1))
    assert np.array_equal(found.lights.irradiance, whole.direct.irradiance)
    assert np.abs(found.error).max() <= 1e-6
    # What EnvIndirects would have stood for is what is left.
    indirect = whole.indirect.irradiance.sum(axis=0)
    assert np.allclose(found.left, indirect, rtol=1e-6, atol=1e-6 * found.whole.max(initial=0.0))
    kept = found.residual.radiance == environment.radiance
    assert (kept | (found.residual.radiance == 0.0)).all()
    nothing = found.meaning.endswith("no lights; the residual is the map")
    assert nothing == (len(found.lights) == 0) and kept.all() >= nothing


def test_a_light_that_carries_too_much_shows_in_the_audit():
    environment = stress_map("sun-and-sky")

    class Greedy:
        name = "greedy"

        def prepare(self, environment, count, rng):
            lights = make_sampler("median-cut").prepare(environment, count, rng)
            return type(lights)(lights.direction, 1.01 * lights.irradiance, lights.extent)

    found = parted(Greedy(), environment)
    assert np.allclose(found.error, 0.01, rtol=1e-4)
    assert "off by +1.0e-02" in audit(found)
