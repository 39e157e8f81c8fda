"""Directional lights: sums over texels, exact shadows down to grazing angles, interleaved sets.

Smooth normals and the terminator: a facet is dark once the light is below its own plane, although
the interpolated normal may still see it. A smooth object therefore ends its lit side along edges of
facets, where the cosine has not yet quite reached 0; it is less than the sine of the angle between
the two normals there.
"""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.direct import PERTURBATION, interleaved, shade_directional
from renderer.modelling import ground, shade, sphere, square
from renderer.render import render
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Conductor
from renderer.view import CELLS_X, CELLS_Y, View, make_view
from samplers.errors import EnvlightError
from samplers.lighting import DirectionalLights
from samplers.sphere import angular_distance
from tests.renderer import lab

IRRADIANCE = np.array([1.0, 2.0, 3.0])


def elevated(degrees: float, azimuth: float = 0.0) -> tuple[float, float, float]:
    e, a = math.radians(degrees), math.radians(azimuth)
    return math.cos(e) * math.cos(a), math.sin(e), math.cos(e) * math.sin(a)


def shaded(view: View, lights: DirectionalLights) -> NDArray[np.float32]:
    return shade_directional(view, lights.direction[None], lights.irradiance)[0]


@pytest.mark.parametrize("material", ["lambert", "coated", "conductor"])
def test_all_texels_give_the_sum_over_all_texels(material: str) -> None:
    surface = {
        "lambert": lab.GREY,
        "coated": Coated((0.5, 0.3, 0.2), 0.2),
        "conductor": Conductor((0.9, 0.7, 0.5), 0.3),
    }[material]
    view = make_view(lab.ball_scene(surface), 24, 24, 4)
    environment = lab.stormy_map(16)
    expected = lab.unoccluded(view, environment)
    rendered = render(view, lab.texel_lights(environment), environment, sets=1).image
    # Directions and normals are float32: a cosine is off by 2⁻²³, which counts for lights near the
    # horizon by an absolute amount; lobes of α = 0.2 steepen it by 4/α.
    image = view.to_image(expected, np.zeros((len(view.background_pixel), 3)))
    seen = view.coverage == 1.0
    assert seen.sum() > 150
    np.testing.assert_allclose(rendered[seen], image[seen], rtol=5e-6)


def test_rays_are_counted_and_useless_ones_not_traced() -> None:
    view = make_view(lab.ball_scene(), 16, 16, 1)
    lights = lab.sun_lights((1, 1, 1), (-1, 0.2, -3), (0, -1, 0))
    black = DirectionalLights(lights.direction, np.zeros((3, 3)), lights.extent)
    _, rays = shade_directional(view, lights.direction[None], lights.irradiance)
    facing = (view.geometric @ lights.direction.T > 0) & (view.normal @ lights.direction.T > 0)
    assert rays.shadow == facing.sum() and rays.skipped == (~facing).sum() and rays.brdf == 0
    out, rays = shade_directional(view, black.direction[None], black.irradiance)
    assert rays.traced == 0 and not out.any()
    none = DirectionalLights.none()
    assert not shaded(view, none).any()


def test_what_is_skipped_changes_no_bit() -> None:
    """Lights that carry nothing or face away from all, among others: no ray, and the same bits."""
    flat = Scene(
        "flat",
        (Object("ground", shade(square(16.0)), Coated((0.5, 0.3, 0.2), 0.2)),),
        Camera((0.0, 2.0, 6.0), (0.0, 0.0, 0.0), 30.0),
    )
    view = make_view(flat, 40, 30, 4)
    lights = lab.sun_lights((1, 1, 1), (-1, 0.2, -3), (0, 1, 0.3))
    useless = lab.sun_lights((1, -1, 1), (0, -1, 0), (0.3, 1, 0))
    carried = useless.irradiance * [[1.0], [1.0], [0.0]]
    mixed = [
        np.stack(pair, axis=1).reshape(-1, 3)
        for pair in ((lights.direction, useless.direction), (lights.irradiance, carried))
    ]
    plain, rays = shade_directional(view, lights.direction[None], lights.irradiance)
    image, with_useless = shade_directional(view, mixed[0][None], mixed[1])
    np.testing.assert_array_equal(image, plain)
    assert plain.any() and with_useless.traced == rays.traced == 3 * len(view)
    assert with_useless.skipped == 3 * len(view)


@pytest.mark.parametrize("degrees", [0.1, 0.3, 1.0, 5.0, 30.0, 90.0])
def test_a_plane_is_lit_exactly_by_the_sine_of_the_elevation(degrees: float) -> None:
    view = make_view(lab.plane_scene(), 48, 32, 4)
    for azimuth in (0.0, 17.0, 45.0, 133.0, 290.0):
        out = shaded(view, lab.sun_lights(elevated(degrees, azimuth)))
        expected = (
            np.array(lab.GREY.albedo) / math.pi * IRRADIANCE * math.sin(math.radians(degrees))
        )
        # Float32 keeps 2⁻²⁴ of the sine itself, the normal and the result.
        np.testing.assert_allclose(out, np.tile(expected, (len(view), 1)), rtol=4.0 * 2.0**-24)


@pytest.mark.parametrize("steps", [6, 40])
@pytest.mark.parametrize("placed", [(1.0, 0.0), (1.0, 10.0), (1e-3, 0.0), (1e3, 1e4)])
def test_a_tessellated_sphere_has_no_acne(steps: int, placed: tuple[float, float]) -> None:
    """Lit as its normal says wherever its facet sees the light, dark everywhere else.

    Lights along the view's own axes make the terminator cross the picture, and the many facets in
    its band are met at all elevations from 0 up."""
    scale, offset = placed
    ball = shade(lab.convex_ball(scale, steps).moved(offset, offset, offset), 180.0)
    eye = tuple(scale * np.array((1.5, 2.5, 4.0)) + offset)
    scene = Scene("ball", (Object("b", ball, lab.GREY),), Camera(eye, (offset,) * 3, 30.0))
    view = make_view(scene, 64, 64, 1)
    normal, geometric = view.normal.astype(float), view.geometric.astype(float)
    band = 0
    for direction in ((-1.0, 0.3, 0.2), (1.0, -0.6, 0.0), (0.2, 1.0, -1.0), (4.0, -2.0, -0.3)):
        lights = lab.sun_lights(direction)
        light = lights.direction[0]
        cosine, above = normal @ light, geometric @ light
        out = shaded(view, lights)[:, 0] / (lab.GREY.albedo[0] / math.pi)
        # A vertex is off by 2⁻²⁴ of its coordinates, so that neighbours of a facet may rise above
        # its plane by that over its length: closer to grazing, either answer is right.
        rounding = 2.0**-22 * (scale + abs(offset)) / (scale * 1.2 / steps)
        lit = (cosine > 1e-6) & (above > max(1e-6, rounding))
        np.testing.assert_allclose(out[lit], cosine[lit], rtol=1e-6, atol=1e-7)
        dark = (cosine < -1e-6) | (above < -1e-6)
        assert not out[dark].any()
        between = (cosine > 0.0) & (above < 0.0)
        # The terminator's band: as high as the two normals are apart.
        apart = np.linalg.norm(np.cross(normal, geometric), axis=1)
        assert (cosine[between] <= apart[between] + 1e-6).all()
        band += between.sum()
    assert band > 0


def test_light_from_below_a_closed_ground_is_dark() -> None:
    ball = Object("ball", shade(sphere(0.3, 16).moved(0.0, 0.35, 0.0), 180.0), lab.GREY)
    camera = Camera((0.0, 0.6, 3.0), (0.0, 0.3, 0.0), 30.0)
    for surface in (ground(16.0), square(64.0)):
        scene = Scene("below", (ball, Object("ground", shade(surface), lab.GREY)), camera)
        view = make_view(scene, 48, 48, 1)
        below = [elevated(-e, a) for e in (5.0, 30.0, 89.0, 90.0) for a in (0.0, 70.0, 200.0)]
        lights = lab.sun_lights(*below)
        faced = (view.normal @ lights.direction.T > 0.05).any(axis=1)
        assert faced.sum() > 100  # the ball's underside would be lit without the ground
        assert not shaded(view, lights).any()


def box_hit(
    origin: NDArray[np.float64], direction: NDArray[np.float64], low: NDArray, high: NDArray
) -> NDArray[np.bool_]:
    """Whether rays meet an axis-aligned box, by slabs, in float64."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - origin) / direction, (high - origin) / direction
    enter = np.where(np.isnan(a), -np.inf, np.minimum(a, b)).max(axis=1)
    leave = np.where(np.isnan(b), np.inf, np.maximum(a, b)).min(axis=1)
    return (leave >= np.maximum(enter, 0.0)) & (leave > 0.0)


BOXES = (((-1.5, 0.0, -0.5), (-0.5, 1.0, 0.5)), ((0.0, 0.0, -1.03125), (2.0, 1.0, -0.96875)))


@pytest.mark.parametrize("degrees", [0.1, 1.0, 10.0, 40.0])
def test_no_light_leaks_under_a_box_or_a_thin_wall(degrees: float) -> None:
    """The shadow of slabs in float64, up to their very foot; only its rim is left out."""
    view = make_view(lab.box_scene(), 160, 120, 4)
    on_ground = view.material == 0
    surface = view.position[on_ground].astype(float)
    surface[:, 1] = 0.0
    reach = 8.0 * 2.0**-16 + 2.0**-16 * 16.0  # more than points are lifted
    for azimuth in (-100.0, -60.0, 200.0, 10.0):
        direction = np.array(elevated(degrees, azimuth))
        answers = []
        # Along a ray that climbs slowly, a point lifted by `reach` moves a shadow by its cotangent.
        top = 2.0 * reach
        for grown in (top, -top):
            hits = [
                box_hit(
                    surface, direction, np.array(low) - (grown, 0.0, grown), np.array(high) + grown
                )
                for low, high in BOXES
            ]
            answers.append(np.any(hits, axis=0))
        sure = answers[0] == answers[1]
        assert sure.mean() > 0.97
        out = shaded(view, lab.sun_lights(tuple(direction)))[on_ground, 0]
        lit = lab.GREY.albedo[0] / math.pi * math.sin(math.radians(degrees))
        assert not out[sure & answers[0]].any()
        np.testing.assert_allclose(out[sure & ~answers[0]], lit, rtol=1e-6)
        foot = sure & answers[0] & (np.abs(surface[:, 2] + 0.5) < 0.5)
        assert foot.sum() > 100


def differing(a: View, b: View) -> tuple[float, float]:
    """Share of points that see other lights in two views, and the largest change of the others."""
    assert len(a) == len(b)
    worst, changed = 0.0, 0
    lights = [elevated(e, 55.0 * k) for k, e in enumerate((0.5, 3.0, 12.0, 35.0, 60.0, 88.0))]
    for light in lights:
        one, two = (shaded(v, lab.sun_lights(light))[:, 0] for v in (a, b))
        other = (one > 0.0) != (two > 0.0)
        changed += other.sum()
        worst = max(worst, float(np.abs(one - two)[~other].max()))
    return changed / (len(a) * len(lights)), worst


@pytest.mark.parametrize("scale", [1e3, 1e-3])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    a, b = (make_view(lab.box_scene(s), 96, 72, 1) for s in (1.0, scale))
    share, worst = differing(a, b)
    # Coordinates round by 2⁻²⁴ of 16. A shadow's rim crosses about 1 in 50 points, each 0.1 wide,
    # and moves by that times a cotangent of 115 at most: 1e-3 of its points, 2e-5 of all.
    assert share <= 1e-4 and worst < 1e-6
    # Barycentrics are off by 2⁻²⁴ of a side of 16, more where a face is seen under a flat angle.
    np.testing.assert_allclose(b.position / scale, a.position, atol=3e-5)


def test_a_power_of_two_changes_no_bit() -> None:
    a, b = (make_view(lab.box_scene(s), 96, 72, 1) for s in (1.0, 1024.0))
    np.testing.assert_array_equal(b.position, 1024.0 * a.position)
    assert differing(a, b) == (0.0, 0.0)


def test_the_place_in_the_world_does_not_matter() -> None:
    """A hundred scene sizes from the origin, where float32 resolves 1e-4 of a box."""
    a = make_view(lab.box_scene(), 96, 72, 1)
    b = make_view(lab.box_scene(offset=(1600.0, 800.0, -1600.0)), 96, 72, 1)
    share, worst = differing(a, b)
    # Points are lifted by 2⁻²⁰ of 1600, 1.5e-3 of a box, instead of 3e-4, and shadows move by that
    # times the cotangent, 1 at 35° and 10 on average of the six: 0.015 or a seventh of the spacing
    # of points. A rim crosses 1 point in 20 or fewer, so that 1 in 140 may change.
    assert share <= 1.0 / 140.0 and worst < 1e-6


def test_the_first_set_is_the_lights_themselves() -> None:
    lights = lab.texel_lights(lab.stormy_map(4))
    wide = DirectionalLights(lights.direction, lights.irradiance, np.full(len(lights), 0.3))
    for sets in (1, 2, 4, 8):
        moved, sent = interleaved(wide, sets, np.random.default_rng(0))
        assert moved.shape == sent.shape == (sets, len(wide), 3)
        np.testing.assert_array_equal(moved[0], wide.direction)
        assert (sent == wide.irradiance).all()
    for bad in (0, 3, 16):
        with pytest.raises(EnvlightError, match="interleaving"):
            interleaved(wide, bad, np.random.default_rng(0))


@pytest.mark.parametrize("extent", [0.0, 1e-6, 0.05, 1.0, 3.0])
def test_perturbations_fill_a_tenth_of_the_extent(extent: float) -> None:
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(2000, 3))
    direction[:2] = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    lights = DirectionalLights(direction, np.ones((2000, 3)), np.full(2000, extent))
    moved, _ = interleaved(lights, 8, rng)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=2), 1.0, atol=1e-15)
    angle = angular_distance(moved[1:], direction)
    # Unit vectors carry an error of 2⁻⁵³ or so in the angle.
    assert angle.max() <= PERTURBATION * extent + 4e-16
    if extent > 0.0:
        # Uniform in the cap: the cap's fraction inside of an angle is uniform. 14000 draws, 5 σ.
        inside = (np.sin(angle / 2.0) / np.sin(PERTURBATION * extent / 2.0)) ** 2
        assert abs(inside.mean() - 0.5) < 5.0 / math.sqrt(12.0 * 14000.0)
        assert abs(inside.var() - 1.0 / 12.0) < 5.0 * math.sqrt(1.0 / 180.0 / 14000.0)


def assert_sets_share_the_pattern_out(lights: DirectionalLights, sets: int, used: int) -> None:
    """Each cell of the pattern uses its own of the sets, of which `used` are different."""
    view = make_view(lab.plane_scene(), 21, 18, 1)
    directions, irradiance = interleaved(lights, sets, np.random.default_rng(2))
    out, _ = shade_directional(view, directions, irradiance)
    y, x = np.divmod(np.arange(21 * 18), 21)
    number = ((y % CELLS_Y) * CELLS_X + x % CELLS_X) % used
    energy = np.einsum("sn,snc->sc", directions[..., 1], irradiance)
    expected = energy[number] * np.array(lab.GREY.albedo) / math.pi
    np.testing.assert_allclose(view.to_image(out, None).reshape(-1, 3), expected, rtol=1e-6)


@pytest.mark.parametrize("sets", [1, 2, 4, 8])
def test_each_cell_of_the_pattern_uses_its_own_set(sets: int) -> None:
    lights = lab.sun_lights((0.3, 1.0, 0.2), (-1.0, 0.7, 0.1))
    wide = DirectionalLights(lights.direction, lights.irradiance, np.array([0.8, 2.0]))
    assert_sets_share_the_pattern_out(wide, sets, sets)


def test_sets_of_the_samplers_own_come_before_perturbations() -> None:
    """Three sets of one, two and no lights, in turn over the eight cells of the pattern."""
    one, two = lab.sun_lights((0.3, 1.0, 0.2)), lab.sun_lights((-1.0, 0.7, 0.1), (0.0, 1.0, 0.0))
    own = DirectionalLights(
        one.direction, one.irradiance, np.zeros(1), (two, DirectionalLights.none())
    )
    directions, irradiance = interleaved(own, 8, np.random.default_rng(0))
    for lights, ways, sent in zip(own.sets, directions, irradiance, strict=False):
        np.testing.assert_array_equal(sent.sum(axis=0), lights.irradiance.sum(axis=0))
        np.testing.assert_array_equal(ways[: len(lights)], lights.direction)
    assert_sets_share_the_pattern_out(own, 8, 3)
