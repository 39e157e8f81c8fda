"""Points that use their neighbours' samples: the mean is right where nothing is spared."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t as student

from renderer.monte_carlo import shade_distribution
from renderer.picture import ViewPicture, shade_picture
from renderer.render import render
from renderer.scene import Scene
from renderer.surface import PacketSurface
from renderer.view import View, make_view
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import Picture, PictureDistribution, SurfaceSamples
from samplers.registry import make_sampler
from samplers.restir import ReservoirLight
from samplers.sphere import pixel_directions, row_solid_angle
from tests.renderer import lab
from tests.renderer.lab import SURFACES, prepared

SEEDS = 48
UNBIASED: dict[str, dict[str, Any]] = {
    "pairwise": {},
    "balance": {"weights": "balance"},
    "visibility first": {"visibility": "first", "neighbours": 2},
    "balance, visibility first": {"visibility": "first", "neighbours": 2, "weights": "balance"},
    "three frames": {"frames": 3, "cap": 2.0},
}


def of(environment: EnvironmentMap, **parameters: Any) -> PictureDistribution:
    count = make_sampler("restir", **parameters).minimum_count
    lighting = prepared("restir", environment, count, **parameters)
    assert isinstance(lighting, PictureDistribution)
    return lighting


def means(view: View, environment: EnvironmentMap, lighting: PictureDistribution) -> NDArray:
    """Mean radiance of the view's points by each seed."""
    runs = [shade_picture(view, environment, lighting, seed)[0] for seed in range(SEEDS)]
    return np.array([run.mean(dtype=np.float64) for run in runs])


def brute_force(view: View, environment: EnvironmentMap) -> NDArray:
    """The same, by many independent samples."""
    mis = make_sampler("mis").prepare(environment, 512, np.random.default_rng(0))
    runs = [shade_distribution(view, environment, mis, seed)[0] for seed in range(8)]  # type: ignore[arg-type]
    return np.array([run.mean(dtype=np.float64) for run in runs])


def scene_of(name: str) -> Scene:
    scenes = {
        "boxes": lab.box_scene,
        "coated ball": lambda: lab.ball_scene(SURFACES["coated"]),
        "metal ball": lambda: lab.ball_scene(SURFACES["conductor"]),
    }
    scene: Scene = scenes[name]()
    return scene


@pytest.mark.parametrize("how", UNBIASED)
@pytest.mark.parametrize("name", ["boxes", "coated ball", "metal ball"])
def test_the_mean_is_that_of_brute_force(name: str, how: str) -> None:
    view, environment = make_view(scene_of(name), 32, 24, 1), lab.stormy_map(8, sun=60.0)
    found = means(view, environment, of(environment, radius=4.0, **UNBIASED[how]))
    other = brute_force(view, environment)
    error = math.sqrt(found.var(ddof=1) / len(found) + other.var(ddof=1) / len(other))
    # At a risk of 1 % in all 15 cases, with the degrees of freedom of the fewer runs.
    limit = student.isf(0.5 * (1.0 - 0.99 ** (1.0 / 15.0)), len(other) - 1)
    assert error < 1e-2 * other.mean()
    assert abs(found.mean() - other.mean()) < limit * error


def test_without_weights_for_what_neighbours_cannot_see_light_is_lost() -> None:
    """In proportion to candidates a neighbour takes its share of each direction, and hands on what
    it sees alone: of E, ∫ f_r L cos V dω, a point keeps the mean over all of them of
    ∫ f_r L cos V · [V_j p̂_j > 0] dω."""
    view, environment = make_view(lab.box_scene(), 32, 24, 1), lab.stormy_map(8, sun=60.0)
    biased = {"weights": "biased", "visibility": "first", "neighbours": 5, "normal": 180.0}
    lighting = of(environment, radius=4.0, depth=1.0, **biased)
    assert isinstance(lighting, ReservoirLight)
    found, picture = means(view, environment, lighting), ViewPicture(view, 0)
    every, rows = np.arange(len(view)), 32
    way = pixel_directions(rows).reshape(-1, 3).astype(np.float32)
    flux = environment.lookup(way) * row_solid_angle(rows, 64).repeat(64)[:, None]
    lit = np.empty((len(way), len(view)))  # what arrives of each direction's light
    for d, one in enumerate(np.broadcast_to(way[:, None], (len(way), len(view), 3))):
        reflected = picture.reflect_at(every, one)[0] @ flux[d] / 3.0
        lit[d] = reflected * picture.sees(every, one, reflected > 0.0)
    kept = []
    for stream in range(8):
        near = lighting._neighbours(picture, stream, 0, len(view))
        group = np.concatenate([every[None], np.where(near < 0, every, near)])
        part = np.concatenate([np.ones((1, len(view))), near >= 0])
        shown = ((lit[:, group] > 0.0) * part).sum(axis=1) / part.sum(axis=0)
        kept.append((lit * shown).sum(axis=0).mean())
    truth, whole = brute_force(view, environment), lit.sum(axis=0).mean()
    # The grid's whole is that of brute force to .2 %; noise is of found, and of who is near.
    assert whole == pytest.approx(truth.mean(), rel=2e-3)
    error = math.sqrt(found.var(ddof=1) / len(found) + np.var(kept, ddof=1) / len(kept)) / whole
    assert 1.0 - np.mean(kept) / whole > 8.0 * error  # so that it is seen
    assert found.mean() / truth.mean() == pytest.approx(np.mean(kept) / whole, abs=4.0 * error)


def test_neighbours_lower_the_noise_at_the_same_rays() -> None:
    view, environment = make_view(lab.plane_scene(), 32, 24, 1), lab.stormy_map(8, sun=60.0)
    noise = {}
    for neighbours in (0, 3):
        lighting = of(environment, neighbours=neighbours, radius=4.0)
        runs = [shade_picture(view, environment, lighting, seed) for seed in range(8)]
        assert all(rays.shadow <= len(view) and rays.brdf == 0 for _, rays in runs)
        # A target is all the luminance that a sample carries; colours it does not know.
        noise[neighbours] = np.std([out @ LUMINANCE_WEIGHTS for out, _ in runs], axis=0).mean()
    # Four times the candidates would halve what they leave over; a third of it is asked for.
    assert noise[3] < 0.83 * noise[0]


@pytest.mark.parametrize("how", UNBIASED)
def test_rays_stay_within_the_budget(how: str) -> None:
    view, environment = make_view(lab.box_scene(), 32, 24, 1), lab.stormy_map(8)
    lighting = of(environment, **UNBIASED[how])
    rays = shade_picture(view, environment, lighting, 0)[1]
    assert 0 < rays.shadow <= lighting.count * len(view)
    assert rays.shadow + rays.skipped == lighting.count * len(view)


@pytest.mark.parametrize("name", SURFACES)
def test_a_picture_answers_as_its_surface_does(name: str) -> None:
    """Points in any order, as those of a packet, to the last bit."""
    view = make_view(lab.ball_scene(SURFACES[name]), 12, 12, 1)
    surface, picture = PacketSurface(view, (0, 32)), ViewPicture(view, 0)
    u = np.random.default_rng(0).random((1, 32, 3), np.float32)
    order = np.random.default_rng(1).permutation(32)
    direction = surface.draw(u)
    reflected, pdf = surface.reflect(direction)
    np.testing.assert_array_equal(picture.draw_at(order, u[0, order]), direction[0, order])
    found, density = picture.reflect_at(order, direction[0, order])
    np.testing.assert_array_equal(found, reflected[0, order])
    np.testing.assert_array_equal(density, pdf[0, order])


def test_what_all_samplers_share_is_read_only() -> None:
    view = make_view(lab.ball_scene(SURFACES[next(iter(SURFACES))]), 12, 12, 1)
    picture = ViewPicture(view, 0)
    shared = (picture.normal, picture.depth, picture.pixel, *picture.by_pixel)
    assert not any(array.flags.writeable for array in shared)


def test_a_picture_traces_only_what_is_asked_for() -> None:
    view = make_view(lab.plane_scene(), 9, 7, 1)
    picture, point = ViewPicture(view, 0), np.arange(len(view))
    up = np.tile(np.float32([0.0, 1.0, 0.0]), (len(view), 1))
    asked = point % 3 > 0
    np.testing.assert_array_equal(picture.sees(point, up, asked), asked)
    assert sum(picture.traced) == asked.sum()
    assert not picture.sees(point, -up, asked).any()


class Fixed:
    """Gives every point the same samples."""

    count, draws = 2, (1,)

    def __init__(self, number: int, weight: float) -> None:
        self.number, self.weight = number, weight

    def sample_at(self, surface: Any, u: Any) -> SurfaceSamples:
        raise AssertionError("it is asked for the picture")

    def sample_picture(self, picture: Picture) -> Iterator[SurfaceSamples]:
        shape = (1, len(picture.pixel))
        way = np.broadcast_to(np.float32([0.6, 0.8, 0.0]), (*shape, 3))
        for _ in range(self.number):
            yield SurfaceSamples(way, np.full(shape, self.weight))


def test_a_distribution_of_anybodys_making_is_shaded_and_checked() -> None:
    view, environment = make_view(lab.plane_scene(), 9, 7, 1), lab.stormy_map(8)
    result = render(view, Fixed(2, math.pi), environment)
    expected = lab.GREY.albedo * environment.lookup([0.6, 0.8, 0.0]) * 0.8
    # float32 roundings of the reflectance, the cosine and the result.
    np.testing.assert_allclose(result.image, np.tile(expected, (7, 9, 1)), rtol=4e-7)
    assert result.rays.shadow == 2 * len(view)
    for lighting, sentence in (
        (Fixed(3, 1.0), "3 samples at a point; at most 2, its count"),
        (Fixed(1, -1.0), "a weight that is negative"),
    ):
        with pytest.raises(EnvlightError, match=f"lighting Fixed: it gave {sentence}"):
            shade_picture(view, environment, lighting, 0)
