"""Disc lights against closed forms of caps and half-hidden caps; the ambient map against sums."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.area import shade_discs
from renderer.irradiance import irradiance_map
from renderer.modelling import box, shade, square
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Conductor, Ward
from renderer.view import make_view
from samplers.environment import EnvironmentMap
from samplers.lighting import DiscLights
from samplers.sphere import pixel_directions, row_solid_angle
from tests.renderer import lab

BLACK_MAP = EnvironmentMap.from_array(np.zeros((4, 8, 3)))


def disc(
    direction: tuple[float, float, float], degrees: float, rays: int = 64, radiance: float = 1.0
) -> DiscLights:
    """One cap of the given radiance and half angle."""
    unit = np.array([direction]) / np.linalg.norm(direction)
    alpha = math.radians(degrees)
    irradiance = radiance * 4.0 * math.pi * math.sin(alpha / 2.0) ** 2
    return DiscLights(
        unit, np.full((1, 3), irradiance), np.array([alpha]), BLACK_MAP, rays_per_light=rays
    )


def plane_irradiance(lights: DiscLights, mode: str = "area") -> NDArray:
    """π L/ρ of every pixel of an unoccluded plane, whose four sub-pixels share their samples."""
    view = make_view(lab.plane_scene(lab.WHITE), 8, 8, 4)
    out, _ = shade_discs(view, lights, 1, mode)  # type: ignore[arg-type]
    return out[:, 0].astype(float).reshape(-1, 4).mean(axis=1) * math.pi


@pytest.mark.parametrize("mode", ["area", "centre"])
@pytest.mark.parametrize("zenith", [0.0, 40.0, 80.0])
def test_a_small_cap_is_a_directional_light(zenith: float, mode: str) -> None:
    angle = math.radians(zenith)
    lights = disc((math.sin(angle), math.cos(angle), 0.0), 0.25)
    expected = lights.irradiance[0, 0] * math.cos(angle)
    # Over the cap the cosine varies by α tan θ, 0.025 at 80°; a sixteenth of it is left over 256
    # samples even if they were random, and α²/2 is lost.
    rtol = 0.0044 * math.tan(angle) / 16.0 + 2e-5
    np.testing.assert_allclose(plane_irradiance(lights, mode), expected, rtol=rtol)


@pytest.mark.parametrize(
    ("zenith", "alpha"), [(0.0, 30.0), (0.0, 90.0), (50.0, 35.0), (30.0, 60.0)]
)
def test_a_cap_above_the_horizon_gives_pi_sine_squared_cosine(zenith: float, alpha: float) -> None:
    angle = math.radians(zenith)
    lights = disc((math.sin(angle), math.cos(angle), 0.0), alpha, rays=256)
    cosine = lights.direction[0, 1]
    expected = math.pi * math.sin(math.radians(alpha)) ** 2 * cosine
    got = plane_irradiance(lights)
    # 1024 random samples of a cosine that varies by half of itself would err by 1/64 in a pixel
    # and by 1/512 in the mean of 64; stratified ones stay well within.
    np.testing.assert_allclose(got.mean(), expected, rtol=1.0 / 512.0)
    np.testing.assert_allclose(got, expected, rtol=1.0 / 64.0)
    centre = plane_irradiance(lights, "centre")
    if zenith + alpha < 90.0:
        # All from the centre: E cos θ, which is more than the cap gives by 2/(1 + cos α).
        np.testing.assert_allclose(centre, lights.irradiance[0, 0] * cosine, rtol=1e-5)


@pytest.mark.parametrize("mode", ["area", "centre"])
def test_a_cap_half_below_the_horizon_gives_what_is_above(mode: str) -> None:
    """A cap centred at the horizon: ∫ cos over its upper half is α − sin α cos α (per radiance)."""
    alpha = math.radians(40.0)
    lights = disc((1.0, 1e-9, 0.0), 40.0, rays=256)
    got = plane_irradiance(lights, mode).mean()
    if mode == "area":
        np.testing.assert_allclose(got, alpha - math.sin(alpha) * math.cos(alpha), rtol=2e-3)
    else:  # seen at its centre it has no height
        assert got < 1e-6
    assert plane_irradiance(disc((1.0, -2.0, 0.0), 20.0), mode).max() == 0.0


@pytest.mark.parametrize("mode", ["area", "centre"])
def test_a_wall_through_the_centre_blocks_half(mode: str) -> None:
    """A long wall whose upper edge, seen from a line on the ground, halves a cap at 45°."""
    wall = box((64.0, 4.0, 0.5)).moved(0.0, 2.0, -4.25)  # its edge is 4 up and 4 behind z = 0
    objects = (
        Object("ground", shade(square(32.0)), lab.WHITE),
        Object("wall", shade(wall), lab.WHITE),
    )
    camera = Camera((0.0, 3.0, 6.0), (0.0, 0.0, 0.0), 1e-3)  # sees the line z = 0 alone
    view = make_view(Scene("wall", objects, camera), 4, 4, 4)
    assert np.abs(view.position[:, 2]).max() < 1e-2
    alpha = math.radians(10.0)
    lights = disc((0.0, 1.0, -1.0), 10.0, rays=1024)
    out, _ = shade_discs(view, lights, 0, mode)  # type: ignore[arg-type]
    got = out.mean() * math.pi
    if mode == "centre":
        expected = 0.5 * lights.irradiance[0, 0] * math.sqrt(0.5)
    else:
        # The upper half-cap: ∫ of the direction is (π/2) sin²α along the axis and
        # α − sin α cos α across, both projected on the ground's normal at 45°.
        across = alpha - math.sin(alpha) * math.cos(alpha)
        expected = math.sqrt(0.5) * (0.5 * math.pi * math.sin(alpha) ** 2 + across)
    # 16 · 1024 stratified samples of a half: 1/(2 √16384) at worst; the wall's edge is seen from
    # up to 1e-2 aside, 1e-3 of 0.35 rad.
    np.testing.assert_allclose(got, expected, rtol=0.01)


def test_irradiance_maps_agree_with_brute_force() -> None:
    maps = [lab.stormy_map(h, sun=40.0) for h in (1, 37, 256)]
    maps.append(EnvironmentMap.from_array(np.ones((1, 2, 3))))
    normal = pixel_directions(32)
    for environment in maps:
        fine = lab.finer(environment, -(-256 // environment.height))
        flux = fine.radiance * row_solid_angle(fine.height, fine.width)[:, None, None]
        towards = pixel_directions(fine.height).reshape(-1, 3)
        picked = normal[::5, ::13].reshape(-1, 3)
        expected = np.maximum(picked @ towards.T, 0.0) @ flux.reshape(-1, 3)
        got = irradiance_map(environment)[::5, ::13].reshape(-1, 3)
        # Blocks of π/64 stand for their middle: (π/64)²/24 where the cosine is smooth, and a
        # noisy block on the horizon, one of 128, may count an eighth of its side too much.
        np.testing.assert_allclose(got, expected, rtol=3e-3)


def test_ambient_light_agrees_with_the_sum_over_texels() -> None:
    smooth = np.exp(2.0 * pixel_directions(16) @ [[0.3, -0.2, 0.1], [1.0, 0.4, 0.0], [0, 1, 0.5]])
    environment = EnvironmentMap.from_array(smooth)
    lights = DiscLights(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), environment)
    surfaces = {
        lab.GREY: 0.01,  # bilinear in a map of 5.6° texels: (0.098)²/8 of the curvature
        Coated((0.5, 0.3, 0.2), 0.3): 0.02,
        Conductor((0.9, 0.7, 0.5), 0.3): 0.02,
        Ward((0.2, 0.2, 0.1), (0.4, 0.3, 0.2), 0.3, 0.3): 0.03,
    }
    for surface, rtol in surfaces.items():
        view = make_view(lab.plane_scene(surface), 8, 8, 4)
        truth = lab.unoccluded(view, lab.finer(environment, 4)).mean(axis=0)
        out, _ = shade_discs(view, lights, 3)
        # 256 points of 32 samples each of a weight that varies by about its mean: 0.011.
        np.testing.assert_allclose(out.mean(axis=0), truth, rtol=rtol)


def test_ambient_light_on_what_is_diffuse_has_no_noise() -> None:
    """Even beside glossy surfaces and under a texel of 10⁹: other samples change no bit."""
    radiance = np.ones((16, 32, 3))
    radiance[3, 5] = 1e9
    lights = DiscLights(
        np.empty((0, 3)), np.empty((0, 3)), np.empty(0), EnvironmentMap.from_array(radiance)
    )
    objects = (
        Object("ground", shade(square(8.0)), lab.GREY),
        Object(
            "box", shade(box((1.0, 1.0, 1.0)).moved(0.0, 0.5, 0.0)), Coated((0.5, 0.3, 0.2), 0.3)
        ),
    )
    view = make_view(Scene("two", objects, Camera((0.0, 3.0, 5.0), (0.0, 0.0, 0.0), 40.0)), 24, 24)
    diffuse = view.material == 0
    first, second = (shade_discs(view, lights, seed)[0] for seed in (0, 1))
    assert 0 < diffuse.sum() < len(view)
    np.testing.assert_array_equal(first[diffuse], second[diffuse])
    assert (first[~diffuse] != second[~diffuse]).any()
