"""One function renders every kind of lighting, in front of the map, and counts its rays."""

import numpy as np
import pytest

from renderer import scenes
from renderer.background import background_radiance
from renderer.render import render
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.inversion import MultipleImportance
from samplers.lighting import DirectionalLights, DiscLights, LayeredLights, Lighting
from samplers.registry import make_sampler
from samplers.sphere import pixel_direction
from tests.renderer import lab


@pytest.fixture(scope="module")
def view() -> View:
    return make_view(lab.ball_scene(field=45.0), 40, 32, 4)


def smooth_map(height: int = 32) -> EnvironmentMap:
    direction = pixel_direction(np.arange(height)[:, None], np.arange(2 * height)[None], height)
    return EnvironmentMap.from_array(np.exp(direction))


def every_lighting(environment: EnvironmentMap) -> dict[str, Lighting]:
    up = DirectionalLights(np.array([[0.0, 1.0, 0.0]]), np.ones((1, 3)), np.array([0.5]))
    side = DirectionalLights(np.array([[0.6, 0.8, 0.0]]), np.ones((1, 3)), np.array([0.5]))
    discs = DiscLights(side.direction, side.irradiance, np.array([0.2]), environment, 4)
    mis = MultipleImportance().prepare(environment, 4, np.random.default_rng(0))
    return {
        "directional": side,
        "layered": LayeredLights(up, side, 2),
        "layered-whole": LayeredLights(up, side, 1),
        "discs": discs,
        "distribution": mis,
    }


KINDS = ("directional", "layered", "layered-whole", "discs", "distribution")


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_is_repeatable_in_front_of_the_map(view: View, kind: str) -> None:
    environment = smooth_map()
    lighting = every_lighting(environment)[kind]
    first, second = (render(view, lighting, environment, seed=5) for _ in range(2))
    np.testing.assert_array_equal(first.image, second.image)
    assert first.rays == second.rays and first.rays.traced > 0
    assert first.rays.primary == 40 * 32 * 4
    assert (render(view, lighting, environment, seed=6).image != first.image).any()
    behind = view.to_image(np.zeros((len(view), 3)), background_radiance(view, environment))
    empty = view.coverage == 0.0
    np.testing.assert_array_equal(first.image[empty], behind[empty])
    assert np.isfinite(first.image).all() and first.image.min() >= 0.0


LOOKING = ("filtered-importance-sampling", "ris", "ris-stratified", "restir")
"""Samplers of each way to shade what looks at the surface or the picture."""


@pytest.mark.parametrize("kind", [*KINDS, *LOOKING])
def test_thread_count_changes_no_bit(kind: str) -> None:
    """Of a picture of more points than a thread takes at once."""
    view, environment = make_view(lab.box_scene(), 80, 60, 4), lab.stormy_map(8)
    if kind in LOOKING:
        sampler = make_sampler(kind)
        count = max(4, sampler.minimum_count)
        lighting = sampler.prepare(environment, count, np.random.default_rng(0))
    else:
        lighting = every_lighting(environment)[kind]
    one, four = lab.one_and_four_threads(lambda: render(view, lighting, environment, seed=5).image)
    np.testing.assert_array_equal(one, four)


def test_the_background_is_the_map_interpolated(view: View) -> None:
    fine = smooth_map(256)
    expected = np.exp(view.background_direction)
    # Bilinear in steps of π/256 of a function whose second derivatives are below 2e: h²/8 · 5.4.
    np.testing.assert_allclose(background_radiance(view, fine), expected, atol=1.5e-4)


def test_layers_add_up(view: View) -> None:
    black = EnvironmentMap.from_array(np.zeros((4, 8, 3)))
    lightings = every_lighting(smooth_map())
    whole = lightings["layered-whole"]
    assert isinstance(whole, LayeredLights)
    both = render(view, whole, black, sets=1).image
    parts = [render(view, part, black, sets=1).image for part in (whole.direct, whole.indirect)]
    np.testing.assert_allclose(both, parts[0] + parts[1], rtol=2e-7, atol=1e-7)
    none = LayeredLights(whole.direct, DirectionalLights.none(), 4)
    np.testing.assert_array_equal(render(view, none, black, sets=1).image, parts[0])


def test_layers_are_perturbed_independently(view: View) -> None:
    """The same lights in both layers meet other perturbations, so their sum is not twice one."""
    black = EnvironmentMap.from_array(np.zeros((4, 8, 3)))
    lights = every_lighting(smooth_map())["directional"]
    assert isinstance(lights, DirectionalLights)
    wide = DirectionalLights(lights.direction, lights.irradiance, np.array([3.0]))
    twice = render(view, LayeredLights(wide, wide, 1), black, seed=1).image
    single = render(view, wide, black, seed=1).image
    assert np.abs(twice - 2.0 * single).max() > 1e-3


def test_pixels_do_not_depend_on_how_the_picture_is_tiled() -> None:
    """A light's image in a picture of several tiles equals the same pixels' in one of one tile.

    Pictures share the aspect and the sub-pixels' places: 2 × 2 pixels of 1 sub-pixel are one pixel
    of 4."""
    black = EnvironmentMap.from_array(np.zeros((4, 8, 3)))
    fine = make_view(lab.box_scene(), 64, 48, 1)
    coarse = make_view(lab.box_scene(), 32, 24, 4)
    lights = lab.texel_lights(lab.stormy_map(4))
    a = render(fine, lights, black, sets=1).image.astype(float)
    b = render(coarse, lights, black, sets=1).image
    blocks = a.reshape(24, 2, 32, 2, 3).mean(axis=(1, 3))
    # Rays through the same points are rounded alike but for their last bit: a shadow's rim may
    # take one sub-pixel in a thousand to the other side, all else agrees to float32.
    same = np.isclose(b, blocks, rtol=1e-5).all(axis=2)
    assert same.mean() > 0.99


def test_other_things_are_refused(view: View) -> None:
    with pytest.raises(TypeError, match="not a lighting"):
        render(view, "sun", smooth_map())  # type: ignore[arg-type]


def test_an_empty_layer_changes_nothing_and_costs_no_rays() -> None:
    """Against a layer of one black light, which is shaded and upsampled."""
    view = make_view(scenes.make("three-boxes"), 40, 30, 4)
    environment = EnvironmentMap.from_array(np.random.default_rng(1).random((16, 32, 3)))
    lights = make_sampler("median-cut").prepare(environment, 8, np.random.default_rng(0))
    assert isinstance(lights, DirectionalLights)
    black = DirectionalLights(np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3)), np.zeros(1))
    empty = render(view, LayeredLights(lights, DirectionalLights.none(), 2), environment)
    full = render(view, LayeredLights(lights, black, 2), environment)
    np.testing.assert_array_equal(full.image, empty.image)
    assert full.rays.traced == empty.rays.traced


@pytest.mark.parametrize("name", ["median-cut", "mis", "ris", "center-surround", "ours"])
def test_images_under_the_largest_maps_are_finite_or_refused(name: str) -> None:
    """A white surface under a constant map is as bright as the map, which float32 holds.

    Few samples may estimate more than that; then the image is refused, in a sentence."""
    largest = EnvironmentMap.from_array(np.full((16, 32, 3), 2e38))
    view = make_view(lab.box_scene(), 24, 24, 4)
    lighting = make_sampler(name).prepare(largest, 64, np.random.default_rng(0))
    image = render(view, lighting, largest).image
    assert np.isfinite(image).all() and image.max() > 1e38
    one = make_sampler(name).prepare(largest, 1, np.random.default_rng(0))
    try:
        assert np.isfinite(render(view, one, largest).image).all()
    except EnvlightError as error:
        assert "scale the map down" in str(error)
