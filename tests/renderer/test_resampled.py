"""Resampled light in place: the samples that `sample_at` gives, to the last bit."""

from types import SimpleNamespace

import numpy as np
import pytest

from renderer.render import render
from renderer.resampled import is_in_place, shade_in_place
from renderer.surface import shade_surface
from renderer.view import make_view
from samplers.environment import EnvironmentMap
from samplers.grids.resampled_light import ResampledLight
from tests.renderer.surfaces import SURFACES, prepared


def resampled(environment: EnvironmentMap, count: int, candidates: int = 8) -> ResampledLight:
    lighting = prepared("ris", environment, count, candidates=candidates)
    assert isinstance(lighting, ResampledLight)
    return lighting


@pytest.mark.parametrize(("count", "candidates"), [(1, 2), (1, 7), (4, 8), (16, 3), (6, 24)])
@pytest.mark.parametrize("surface", SURFACES)
def test_in_place_gives_the_same_as_samples_that_are_handed_over(
    lab: SimpleNamespace, surface: str, count: int, candidates: int
) -> None:
    """Of a ball whose points do not fill their last packet."""
    view = make_view(lab.ball_scene(SURFACES[surface]), 23, 19, 4)
    environment = lab.stormy_map(8, sun=60.0)
    lighting = resampled(environment, count, candidates)
    assert len(view) % 16 and is_in_place(lighting, environment)
    handed_over, rays = shade_surface(view, environment, lighting, 5)
    in_place, same = shade_in_place(view, environment, lighting, 5)
    np.testing.assert_array_equal(in_place, handed_over)
    assert same == rays and rays.traced + rays.skipped == count * len(view)
    assert in_place.any()


def test_shadows_and_several_materials_in_place(lab: SimpleNamespace) -> None:
    view, environment = make_view(lab.box_scene(), 40, 30, 4), lab.stormy_map(8)
    lighting = resampled(environment, 4)
    handed_over, rays = shade_surface(view, environment, lighting, 2)
    in_place, same = shade_in_place(view, environment, lighting, 2)
    np.testing.assert_array_equal(in_place, handed_over)
    assert same == rays and rays.shadow > 0


def test_the_renderer_shades_in_place_with_any_number_of_threads(lab: SimpleNamespace) -> None:
    view, environment = make_view(lab.box_scene(), 80, 60, 1), lab.stormy_map(8)
    lighting = resampled(environment, 4)
    one, four = lab.one_and_four_threads(lambda: render(view, lighting, environment, 7).image)
    np.testing.assert_array_equal(one, four)


def test_another_map_and_a_black_one_go_the_other_way(lab: SimpleNamespace) -> None:
    """Densities are found from the radiance that is looked up, and a black map has no table."""
    view, environment = make_view(lab.box_scene(), 16, 12, 1), lab.stormy_map(8)
    brighter = EnvironmentMap.from_array(3.0 * environment.radiance)
    lighting = resampled(environment, 2)
    assert not is_in_place(lighting, brighter)
    black = EnvironmentMap.from_array(np.zeros((4, 8, 3)))
    in_the_dark = resampled(black, 2)
    assert not is_in_place(in_the_dark, black)
    assert not render(view, in_the_dark, black).image.any()
