"""Resampled light in place: the samples that `sample_at` gives, to the last bit."""

from typing import Any

import numpy as np
import pytest

from renderer.render import render
from renderer.resampled import candidates_in_place, shade_in_place
from renderer.surface import shade_surface
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.grids.resampled_light import ResampledLight
from samplers.lighting import Surface, SurfaceSamples
from tests.renderer import lab
from tests.renderer.lab import SURFACES, prepared

BOTH = pytest.mark.parametrize("name", ["ris", "ris-stratified"])


def resampled(name: str, environment: EnvironmentMap, count: int, **given: Any) -> ResampledLight:
    lighting = prepared(name, environment, count, **given)
    assert isinstance(lighting, ResampledLight)
    return lighting


def in_place(view: View, environment: EnvironmentMap, lighting: ResampledLight, seed: int) -> tuple:
    density = candidates_in_place(lighting, environment)
    assert density is not None
    return shade_in_place(view, environment, lighting, density, seed)


def assert_same(view: View, environment: EnvironmentMap, lighting: ResampledLight) -> None:
    """In place, light is what it is by samples that are handed over."""
    handed_over, rays = shade_surface(view, environment, lighting, 5)
    found, same = in_place(view, environment, lighting, 5)
    np.testing.assert_array_equal(found, handed_over)
    assert same == rays and rays.traced + rays.skipped == lighting.count * len(view)
    assert found.any() and rays.shadow > 0


@pytest.mark.parametrize(("count", "candidates"), [(1, 2), (1, 7), (4, 8), (16, 3), (6, 24)])
@pytest.mark.parametrize("surface", SURFACES)
@BOTH
def test_in_place_gives_the_same_as_samples_that_are_handed_over(
    name: str, surface: str, count: int, candidates: int
) -> None:
    """Of a ball whose points do not fill their last packet."""
    view = make_view(lab.ball_scene(SURFACES[surface]), 23, 19, 4)
    environment = lab.stormy_map(8, sun=60.0)
    assert len(view) % 16
    assert_same(view, environment, resampled(name, environment, count, candidates=candidates))


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("ris", {"source": "map"}), ("ris", {"source": "brdf"}), ("ris", {}), ("ris-stratified", {})],
)
def test_shadows_and_candidates_of_one_kind_in_place(name: str, parameters: dict[str, str]) -> None:
    environment = lab.stormy_map(8)
    lighting = resampled(name, environment, 3, **parameters)
    assert_same(make_view(lab.box_scene(), 23, 19, 4), environment, lighting)


class Foreign:
    """A resampling of another program's making, whose samples nobody is to ask for."""

    def __init__(self, given: ResampledLight) -> None:
        self.radiance, self.candidates, self.curve = given.radiance, given.candidates, given.curve
        self.from_map, self.from_brdf, self.count = given.from_map, given.from_brdf, given.count
        self.draws = given.draws

    def sample_at(self, surface: Surface, u: list) -> SurfaceSamples:
        raise AssertionError("it is shaded in place")


def test_what_resamples_is_shaded_in_place_whoever_made_it() -> None:
    view, environment = make_view(lab.box_scene(), 23, 19, 4), lab.stormy_map(8)
    lighting = resampled("ris-stratified", environment, 4)
    ours, theirs = (render(view, one, environment, 3) for one in (lighting, Foreign(lighting)))
    np.testing.assert_array_equal(theirs.image, ours.image)
    assert theirs.rays == ours.rays


def test_another_map_and_a_black_one_go_the_other_way() -> None:
    """Densities are found from the radiance that is looked up, and a black map has no table."""
    view, environment = make_view(lab.box_scene(), 16, 12, 1), lab.stormy_map(8)
    brighter = EnvironmentMap.from_array(3.0 * environment.radiance)
    lighting = resampled("ris", environment, 2)
    assert candidates_in_place(lighting, brighter) is None
    black = EnvironmentMap.from_array(np.zeros((4, 8, 3)))
    in_the_dark = resampled("ris", black, 2)
    assert candidates_in_place(in_the_dark, black) is None
    assert not render(view, in_the_dark, black).image.any()
