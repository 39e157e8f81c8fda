"""Diffuse light before shadows: as known and as sampled, and what its errors tell of radiance."""

from dataclasses import replace

import numpy as np
import pytest

from renderer.control_variate import LEAST_PIXELS, expected_diffuse, fitted_beta
from renderer.irradiance import SHARP_HEIGHT
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.grids.tabulated import by_luminance
from tests.renderer import lab

ALBEDO = (0.7, 0.4, 0.2)
BLACK = (0.0, 0.0, 0.0)
WITH_BASE: dict[str, tuple[Material, Material]] = {
    "lambert": (Lambert(ALBEDO), Lambert(BLACK)),
    "coated": (Coated(ALBEDO, 0.3), Coated(BLACK, 0.3)),
    "dense coat": (Coated(ALBEDO, 0.2, 2.2), Coated(BLACK, 0.2, 2.2)),
    "ward": (Ward(ALBEDO, (0.2, 0.2, 0.2), 0.2, 0.4), Ward(BLACK, (0.2, 0.2, 0.2), 0.2, 0.4)),
    "metal": (Conductor(ALBEDO, 0.3), Conductor(ALBEDO, 0.3)),
}
"""Surfaces, and the same without what is diffuse."""


def smooth_ball(material: Material, size: int = 24) -> View:
    """A ball whose facets hide nothing from its smooth normals."""
    view = make_view(lab.ball_scene(material), size, size, 1)
    return replace(view, geometric=view.normal)


@pytest.fixture(scope="module")
def storm() -> EnvironmentMap:
    return lab.stormy_map(8, sun=300.0)


@pytest.mark.parametrize("name", WITH_BASE)
def test_what_is_known_is_the_sum_over_texels(storm: EnvironmentMap, name: str) -> None:
    """A surface less its black twin is its diffuse part.

    At the edge where a light sets, the slope of its cosine steps by 1: between rows of h = π/256 it
    is off by h/4 at most, 3.1e-3, and the harmonics cut off leave 1e-3 more. Its root mean square
    over all orientations, of which h/2 are that near an edge, is below 3e-4. Suns here are of many
    texels, whose edges lie apart."""
    whole, black = (smooth_ball(material, 14) for material in WITH_BASE[name])
    texels = lab.finer(storm, 32)
    truth = lab.unoccluded(whole, texels) - lab.unoccluded(black, texels)
    error = expected_diffuse(whole, storm) - truth
    flux = storm.total_flux * np.array(ALBEDO) / np.pi
    assert (np.abs(error) <= 4.1e-3 * flux).all()
    assert (np.sqrt((error**2).mean(axis=0)) <= 3e-4 * flux).all()
    assert SHARP_HEIGHT == 256


@pytest.mark.parametrize("name", WITH_BASE)
@pytest.mark.parametrize("compensation", [None, 0.7])
def test_samples_carry_what_is_known_in_the_mean(
    storm: EnvironmentMap, name: str, compensation: float | None
) -> None:
    """Also at points whose facets hide light, and where the table leaves dim texels to the BRDF."""
    view = make_view(lab.ball_scene(WITH_BASE[name][0], steps=6), 16, 16, 1)
    lighting = by_luminance(storm, 16, compensation=compensation)
    runs = []
    for seed in range(48):
        diffuse = np.zeros((len(view), 3), np.float32)
        shade_distribution(view, storm, lighting, seed, SampleSplit(64, 32), diffuse=diffuse)
        runs.append(diffuse.astype(np.float64))
    mean, deviation = np.mean(runs, axis=0), np.std(runs, axis=0, ddof=1) / np.sqrt(len(runs))
    known = expected_diffuse(view, storm)
    # The error of what is known, as above, and five standard errors of some 400 values.
    allowed = 5.0 * deviation + 4.1e-3 * storm.total_flux * np.array(ALBEDO) / np.pi
    assert (np.abs(mean - known) <= allowed).all()
    # Over all points the sign of an error is not the same.
    total = (mean - known).sum() / max(known.sum(), 1e-30)
    assert abs(total) < 5.0 * np.sqrt((deviation**2).sum()) / max(known.sum(), 1e-30) + 1e-3


def test_radiance_and_rays_are_the_same_where_diffuse_light_is_found(storm: EnvironmentMap) -> None:
    view = make_view(lab.box_scene(), 24, 18, 4)
    lighting, split = by_luminance(storm, 16), SampleSplit(8, 8)
    plain, rays = shade_distribution(view, storm, lighting, 3, split)
    diffuse = np.zeros((len(view), 3), np.float32)
    beside, same = shade_distribution(view, storm, lighting, 3, split, diffuse=diffuse)
    np.testing.assert_array_equal(beside, plain)
    assert same == rays and (diffuse >= 0.0).all() and diffuse.any()
    # Grey boxes have nothing but what is diffuse, of which shadows only take.
    assert (beside <= diffuse * (1.0 + 1e-5)).all()


def test_beta_is_the_slope_of_each_tile() -> None:
    rng = np.random.default_rng(1)
    tile = np.repeat(np.arange(3), 2 * LEAST_PIXELS)
    diffuse = rng.normal(size=(len(tile), 3))
    slope = np.array([0.0, 0.5, 1.0])
    radiance = slope[tile][:, None] * diffuse + 0.1 * rng.normal(size=diffuse.shape)
    # A regression through the origin over 3 · 128 values: standard error 0.1/√384.
    np.testing.assert_allclose(
        fitted_beta(tile, radiance, diffuse), slope, atol=5.0 * 0.1 / np.sqrt(384.0)
    )


def test_small_tiles_share_one_beta_and_none_is_made_of_nothing() -> None:
    tile = np.concatenate([np.zeros(LEAST_PIXELS, int), [1], [2], [4]])
    diffuse = np.ones((len(tile), 3))
    radiance = np.where(tile == 0, 0.25, np.where(tile == 1, 1.0, 0.4))[:, None] * diffuse
    beta = fitted_beta(tile, radiance, diffuse)
    np.testing.assert_allclose(beta, [0.25, 0.6, 0.6, 0.6, 0.6])
    np.testing.assert_array_equal(fitted_beta(tile, radiance, 0.0 * diffuse), 0.0)
