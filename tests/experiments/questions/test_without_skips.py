"""Without skips the image stays the same bit for bit, and rays that are not skipped are traced."""

import numpy as np
import pytest

from experiments.questions.without_skips import Kept, shade_every_light, shade_every_sample
from renderer import scenes
from renderer.direct import interleaved, shade_directional
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.render import DIRECT_STREAM, INTERLEAVED_SETS
from renderer.view import View, make_view
from samplers import DirectionalLights, EnvironmentMap, LightDistribution, make_sampler


@pytest.fixture(scope="module")
def view() -> View:
    return make_view(scenes.make("glossy"), 40, 30, 4)


@pytest.fixture(scope="module")
def environment() -> EnvironmentMap:
    """Noise with a sun, black below the horizon."""
    radiance = np.random.default_rng(1).uniform(0.0, 1.0, (32, 64, 3)) ** 4
    radiance[8, 20] = 1e4
    radiance[16:] = 0.0
    return EnvironmentMap.from_array(radiance, "sky")


CHOICES = [Kept(True, True), Kept(False, True), Kept(True, False), Kept(False, False)]


def shaded(view: View, lights: DirectionalLights):
    rng = np.random.default_rng([0, DIRECT_STREAM])
    return shade_directional(view, *interleaved(lights, INTERLEAVED_SETS, rng))


@pytest.mark.parametrize("kept", CHOICES)
def test_lights_give_the_same_radiance(view, environment, kept):
    lights = make_sampler("median-cut").prepare(environment, 16, np.random.default_rng(0))
    assert isinstance(lights, DirectionalLights)
    usual, rays = shaded(view, lights)
    full, traced = shade_every_light(view, lights, kept)
    np.testing.assert_array_equal(full, usual)
    assert traced == rays.shadow if kept == CHOICES[0] else traced >= rays.shadow


@pytest.mark.parametrize("name", ["mis", "kd-tree"])
@pytest.mark.parametrize("kept", CHOICES)
def test_samples_give_the_same_radiance(view, environment, name, kept):
    lighting = make_sampler(name).prepare(environment, 16, np.random.default_rng(0))
    assert isinstance(lighting, LightDistribution)
    usual, rays = shade_distribution(view, environment, lighting, 0)
    full, traced = shade_every_sample(view, environment, lighting, kept)
    np.testing.assert_array_equal(full, usual)
    assert traced == rays.traced if kept == CHOICES[0] else traced > rays.traced


def test_without_skips_every_light_is_traced_from_every_point(view):
    lights = DirectionalLights(
        np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
        np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]),
        np.zeros(3),
    )
    usual, rays = shaded(view, lights)
    full, traced = shade_every_light(view, lights, CHOICES[-1])
    assert traced == 3 * len(view) == rays.shadow + rays.skipped
    assert rays.shadow < len(view)
    np.testing.assert_array_equal(full, usual)


def test_mean_is_the_same_without_brdf_sampling(environment):
    diffuse = make_view(scenes.make("three-boxes"), 24, 18, 4)
    assert diffuse.is_lambertian
    lighting = make_sampler("mis").prepare(environment, 64, np.random.default_rng(0))
    assert isinstance(lighting, LightDistribution)

    def means(split: SampleSplit) -> np.ndarray:
        runs = [shade_distribution(diffuse, environment, lighting, s, split) for s in range(8)]
        return np.array([points.mean(dtype=np.float64) for points, _ in runs])

    with_brdf, without = means(SampleSplit.half_and_half(64)), means(SampleSplit.light_only(64))
    error = np.sqrt((with_brdf.var(ddof=1) + without.var(ddof=1)) / 8)
    # Student's t with 14 degrees of freedom exceeds 4.14 once in a thousand.
    assert abs(with_brdf.mean() - without.mean()) < 4.14 * error
