"""Skips: the image stays the same bit for bit, and rays that are not skipped are traced."""

from dataclasses import replace

import numpy as np
import pytest

from renderer import scenes
from renderer.render import render
from renderer.skips import Skips
from renderer.view import View, make_view
from samplers import DirectionalLights, EnvironmentMap, LayeredLights, make_sampler

NONE = Skips(facing_away=False, zero=False, empty_layer=False)


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


@pytest.mark.parametrize("name", ["median-cut", "mis", "kd-tree", "center-surround", "ours"])
@pytest.mark.parametrize("field", ["facing_away", "zero", "empty_layer"])
def test_image_is_the_same_without_a_skip(view, environment, name, field):
    lighting = make_sampler(name).prepare(environment, 16, np.random.default_rng(0))
    usual = render(view, lighting, environment)
    full = render(view, lighting, environment, skips=replace(Skips(), **{field: False}))
    np.testing.assert_array_equal(full.image, usual.image)
    assert full.rays.traced >= usual.rays.traced
    assert full.rays.traced + full.rays.skipped == usual.rays.traced + usual.rays.skipped


def test_without_skips_every_light_is_traced_from_every_point(view):
    lights = DirectionalLights(
        np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
        np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]),
        np.zeros(3),
    )
    black = EnvironmentMap.from_array(np.zeros((2, 4, 3)), "black")
    usual, full = render(view, lights, black), render(view, lights, black, skips=NONE)
    assert full.rays.shadow == 3 * len(view) and full.rays.skipped == 0
    assert usual.rays.shadow + usual.rays.skipped == 3 * len(view)
    assert usual.rays.shadow < len(view) < full.rays.shadow
    np.testing.assert_array_equal(full.image, usual.image)


def test_empty_layer_costs_no_rays(view, environment):
    lights = make_sampler("median-cut").prepare(environment, 8, np.random.default_rng(0))
    assert isinstance(lights, DirectionalLights)
    layered = LayeredLights(lights, DirectionalLights.none(), 2)
    usual = render(view, layered, environment)
    full = render(view, layered, environment, skips=Skips(empty_layer=False))
    np.testing.assert_array_equal(full.image, usual.image)
    assert full.rays == usual.rays


def test_brdf_sampling_goes_only_where_all_is_lambertian_and_light_is_covered(view, environment):
    diffuse = make_view(scenes.make("three-boxes"), 40, 30, 4)
    skips = Skips(lambert_brdf=True)
    plain = make_sampler("mis").prepare(environment, 16, np.random.default_rng(0))
    assert diffuse.is_lambertian and not view.is_lambertian
    assert render(diffuse, plain, environment, skips=skips).rays.brdf == 0
    assert render(view, plain, environment, skips=skips).rays.brdf > 0
    # A compensated density is 0 where the map is dim, which only BRDF samples then reach.
    part = make_sampler("mis-compensated").prepare(environment, 16, np.random.default_rng(0))
    assert render(diffuse, part, environment, skips=skips).rays.brdf > 0
    assert render(diffuse, plain, environment, skips=skips).rays.brdf == 0


def test_mean_is_the_same_without_brdf_sampling(environment):
    diffuse = make_view(scenes.make("three-boxes"), 24, 18, 4)
    lighting = make_sampler("mis").prepare(environment, 64, np.random.default_rng(0))

    def means(skips: Skips) -> np.ndarray:
        return np.array(
            [render(diffuse, lighting, environment, seed, skips=skips).image.mean()
             for seed in range(8)], np.float64,
        )  # fmt: skip

    with_brdf, without = means(Skips()), means(Skips(lambert_brdf=True))
    error = np.sqrt((with_brdf.var(ddof=1) + without.var(ddof=1)) / 8)
    # Student's t with 14 degrees of freedom exceeds 4.14 once in a thousand.
    assert abs(with_brdf.mean() - without.mean()) < 4.14 * error
