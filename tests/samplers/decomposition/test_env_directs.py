"""EnvDirects: draws by importance with masked neighbourhoods, k-means, exclusion."""

import math

import numpy as np
import pytest

from samplers.decomposition.emissive_pixels import gather
from samplers.decomposition.env_directs import draw, masking_radius
from samplers.decomposition.env_directs import env_directs as directs_of
from samplers.environment import EnvironmentMap
from samplers.sphere import angular_distance, pixel_direction, pixel_directions

HEIGHT = 64
LAMPS = np.array([[0.6, 0.7, 0.3], [-0.5, 0.1, 0.8], [0.1, 0.99, 0.0], [0.01, -0.4, -0.9]])
LAMPS /= np.linalg.norm(LAMPS, axis=1, keepdims=True)
LAMP_RADIUS = 0.12


def lamps(seed=0):
    """Four textured discs, one over a pole and one over the seam, on a dim background."""
    rng = np.random.default_rng(seed)
    radiance = rng.uniform(0.0, 0.2, (HEIGHT, 2 * HEIGHT, 3))
    angle = angular_distance(pixel_directions(HEIGHT)[:, :, None], LAMPS)
    emissive = (angle < LAMP_RADIUS).any(axis=2)
    radiance[emissive] = rng.uniform(20.0, 100.0, (emissive.sum(), 3))
    return EnvironmentMap.from_array(radiance), emissive


def env_directs(environment, emissive, count, radius, generator, **steps):
    """`directs_of` with all the steps that are not named."""
    steps = {"masking": True, "refine": True, "exclusion": "converged", **steps}
    return directs_of(environment, emissive, count, radius, generator, **steps)


def rng(seed=0):
    return np.random.default_rng(seed)


def flux_under(environment, mask):
    weighted = environment.radiance.astype(float) * environment.row_solid_angle[:, None, None]
    return weighted[mask].sum(axis=0)


def test_radius_of_the_neighbourhood():
    # s·4π/K of the paper read as an angle: K = 16 gives 6.75°.
    assert math.degrees(masking_radius(16, "radians")) == pytest.approx(6.75)
    # Read as a solid angle: a cap of that area, cos θ = 1 − 2s/K.
    assert math.cos(masking_radius(16, "solid_angle")) == pytest.approx(1.0 - 2.0 * 0.15 / 16)


def test_draws_follow_luminous_flux():
    environment, emissive = lamps()
    pixels = gather(environment, emissive)
    draws = 200_000
    drawn = draw(pixels, draws, 0.0, False, rng())
    share = pixels.luminous_flux / pixels.luminous_flux.sum()
    hits = np.bincount(drawn, minlength=len(share))
    # Chi-square over n pixels: mean n − 1, standard deviation √(2n); five of them.
    chi_square = np.sum((hits - draws * share) ** 2 / (draws * share))
    assert abs(chi_square - (len(share) - 1)) < 5.0 * math.sqrt(2.0 * len(share))


@pytest.mark.parametrize("radius", [0.03, 0.1, 0.5])
def test_masked_draws_keep_apart(radius):
    environment, emissive = lamps()
    pixels = gather(environment, emissive)
    direction = pixels.direction[draw(pixels, 300, radius, True, rng())]
    apart = angular_distance(direction[:, None], direction) + 10.0 * np.eye(len(direction))
    assert apart.min() > radius
    # Drawing ended because nothing was left: every emissive pixel is masked by some draw.
    assert len(direction) < 300
    nearest = angular_distance(pixels.direction[:, None], direction).min(axis=1)
    assert nearest.max() <= radius * (1.0 + 1e-9)


@pytest.mark.parametrize("exclusion", ["each-round", "none"])
@pytest.mark.parametrize("seed", range(3))
def test_the_best_of_several_searches_is_no_worse_than_the_first(seed, exclusion):
    environment, emissive = lamps()
    pixels = gather(environment, emissive)
    error = []
    for searches in (1, 5):
        direction = env_directs(
            environment, emissive, 12, 0.1, rng(seed), exclusion=exclusion, searches=searches
        ).lights.direction
        nearest = angular_distance(pixels.direction[:, None], direction).min(axis=1)
        chord = 2.0 * np.sin(0.5 * nearest)
        reach = 2.0 * math.sin(0.1) if exclusion == "each-round" else math.inf
        error.append(pixels.luminous_flux @ np.minimum(chord, reach) ** 2)
    # Lights are the centroids of what ended in their clusters, whose errors they lower at most.
    assert error[1] <= error[0] * (1.0 + 1e-9)


def test_one_light_per_lamp_is_its_centroid():
    environment, emissive = lamps()
    # The neighbourhood covers a lamp, so that the four draws fall into four lamps.
    found = env_directs(environment, emissive, 4, 0.3, rng())
    assert np.array_equal(found.kept, emissive)
    order = angular_distance(LAMPS[:, None], found.lights.direction).argmin(axis=1)
    weight = environment.flux[..., None] * pixel_directions(HEIGHT)
    angle = angular_distance(pixel_directions(HEIGHT)[:, :, None], LAMPS)
    for k, light in enumerate(order):
        moment = weight[angle[:, :, k] < LAMP_RADIUS].sum(axis=0)
        centroid = moment / np.linalg.norm(moment)
        assert angular_distance(found.lights.direction[light], centroid) < 1e-12


@pytest.mark.parametrize(
    ("light_extent", "radii"), [("mean", 2.0 / 3.0), ("largest", 1.0), ("full", 2.0)]
)
def test_extent_is_an_angle_of_a_disc(light_extent, radii):
    environment, emissive = lamps()
    lights = env_directs(environment, emissive, 4, 0.3, rng(), light_extent=light_extent).lights
    # A disc's mean distance from its middle is ⅔ of its radius. Pixels of 0.05 rad make the edge
    # uncertain by half a pixel, and the textured light's centroid is off by a fraction of one.
    assert np.abs(lights.extent - LAMP_RADIUS * radii).max() < 0.025 * max(radii, 1.0)


def test_draws_alone_share_the_flux_alike():
    environment, emissive = lamps()
    found = env_directs(environment, emissive, 25, 0.1, rng(), masking=False, refine=False)
    assert len(found.lights) == 25
    assert np.array_equal(found.kept, emissive)
    share = flux_under(environment, emissive) / 25
    # 25 equal shares of a sum over some hundred pixels in another order.
    np.testing.assert_allclose(found.lights.irradiance, np.tile(share, (25, 1)), rtol=1e-12)
    place = pixel_directions(HEIGHT)[emissive]
    apart = angular_distance(found.lights.direction[:, None], place).min(axis=1)
    assert apart.max() < 1e-12


def test_masked_draws_stand_for_the_pixels_nearest_to_them():
    environment, emissive = lamps()
    found = env_directs(environment, emissive, 25, 0.05, rng(), refine=False)
    assert np.array_equal(found.kept, emissive)
    place = pixel_directions(HEIGHT)[emissive]
    distance = angular_distance(place[:, None], found.lights.direction)
    assert distance.min(axis=0).max() < 1e-12
    flux = (
        environment.radiance[emissive] * environment.row_solid_angle[np.nonzero(emissive)[0], None]
    )
    # Pixels in the middle between two draws of their row may go to either.
    near = distance <= distance.min(axis=1, keepdims=True) + 1e-9
    for k, irradiance in enumerate(found.lights.irradiance):
        alone = flux[near[:, k] & (near.sum(axis=1) == 1)].sum(axis=0)
        assert (irradiance >= alone * (1.0 - 1e-12)).all()
        assert (irradiance <= flux[near[:, k]].sum(axis=0) * (1.0 + 1e-12)).all()
    assert (near.sum(axis=1) == 1).mean() > 0.9


@pytest.mark.parametrize("exclusion", ["converged", "each-round"])
def test_pixels_far_from_every_light_are_given_back(exclusion):
    environment, emissive = lamps()
    found = env_directs(environment, emissive, 2, 0.1, rng(), exclusion=exclusion)
    # Two lights cannot reach four lamps; what is farther than 2 · 0.1 from their centres goes.
    assert 0 < found.kept.sum() < emissive.sum()
    distance = angular_distance(pixel_directions(HEIGHT)[found.kept][:, None],
                                found.lights.direction).min(axis=1)  # fmt: skip
    assert distance.max() < 2.0 * 0.2
    everything = env_directs(environment, emissive, 2, 0.1, rng(), exclusion="none")
    assert np.array_equal(everything.kept, emissive)


def test_pixels_out_of_reach_do_not_pull_where_each_round_excludes_them():
    environment, emissive = lamps()
    found = env_directs(environment, emissive, 2, 0.1, rng(), exclusion="each-round")
    direction, weight = pixel_directions(HEIGHT)[found.kept], environment.flux[found.kept]
    distance = angular_distance(direction[:, None], found.lights.direction)
    assert distance.min(axis=1).max() <= 0.2 * (1.0 + 1e-9)  # chords by another library
    for k, light in enumerate(found.lights.direction):
        member = distance.argmin(axis=1) == k
        moment = weight[member] @ direction[member]
        # A fixed point: the centroid of what is within reach of it.
        assert angular_distance(moment / np.linalg.norm(moment), light) < 1e-12
    inside = angular_distance(pixel_directions(HEIGHT)[emissive][:, None], found.lights.direction)
    assert (inside.min(axis=1) <= 0.2).sum() == found.kept.sum()


def test_a_ring_keeps_what_is_near_one_of_its_pixels():
    """The centroid of a ring is farther from all its pixels than Ω."""
    angle = angular_distance(pixel_directions(HEIGHT), np.array([1.0, 0.0, 0.0]))
    ring = np.abs(angle - 0.5) < 0.04
    environment = EnvironmentMap.from_array(np.repeat(np.where(ring, 9.0, 0.1)[..., None], 3, 2))
    found = env_directs(environment, ring, 1, 0.05, rng())
    kept = pixel_directions(HEIGHT)[found.kept]
    assert 1 <= len(kept) < ring.sum() / 4
    assert (ring & found.kept).sum() == len(kept)
    # All are within 2 Ω of the pixel that the centre moved to, so within 4 Ω of each other.
    assert angular_distance(kept[:, None], kept).max() <= 0.2 * (1.0 + 1e-9)


def test_opposite_pixels_leave_a_light_on_one_of_them():
    radiance = np.zeros((16, 32, 3))
    radiance[7, 3], radiance[8, 19] = 1.0, 2.0
    environment = EnvironmentMap.from_array(radiance)
    lit = radiance.any(axis=2)
    light = env_directs(environment, lit, 1, 0.1, rng(), exclusion="none").lights
    assert len(light) == 1
    assert angular_distance(light.direction[0], pixel_direction(8, 19, 16)) < 1e-12
