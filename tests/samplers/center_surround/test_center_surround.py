"""Centre-surround decomposition: energy, the lights it finds, and when it stops."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from samplers import make_sampler
from samplers.center_surround import disc_flux, disc_pixels
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.lighting import DiscLights
from samplers.sphere import (
    angular_distance,
    direction_from_uv,
    pixel_directions,
    row_solid_angle,
)
from samplers.threads import set_thread_count, thread_count


def decompose(environment: EnvironmentMap, count: int = 1000, **parameters) -> DiscLights:
    lighting = make_sampler("center-surround", **parameters).prepare(
        environment, count, np.random.default_rng(0)
    )
    assert isinstance(lighting, DiscLights)
    return lighting


def disc_map(height: int, discs: list[tuple[float, float, float, float]]) -> EnvironmentMap:
    """Discs (u, v, radius in degrees, radiance) on a dim textured background."""
    rng = np.random.default_rng(height)
    radiance = (0.01 + 0.01 * rng.random((height, 2 * height, 3))).astype(np.float32)
    for u, v, radius, level in discs:
        distance = angular_distance(pixel_directions(height), direction_from_uv(u, v))
        radiance[distance < math.radians(radius)] += np.float32(level)
    return EnvironmentMap(radiance)


ROOM = [(0.1, 0.3, 6.0, 20.0), (0.99, 0.4, 3.0, 30.0), (0.6, 0.05, 8.0, 5.0)]


@pytest.mark.parametrize("height", [16, 200])
@pytest.mark.parametrize("surface", ["sphere", "plane"])
def test_lights_and_ambient_hold_the_flux(height, surface):
    environment = disc_map(height, ROOM)
    lighting = decompose(environment, surface=surface)
    assert len(lighting) >= 1
    total = lighting.irradiance.sum(axis=0) + lighting.ambient.total_flux
    # Float64 sums of 10⁵ terms.
    assert np.allclose(total, environment.total_flux, rtol=1e-11, atol=0.0)


@pytest.mark.parametrize("height", [128, 200, 256])
def test_each_disc_becomes_one_light_around_it(height):
    lighting = decompose(disc_map(height, ROOM))
    assert len(lighting) == len(ROOM)
    for u, v, radius, _ in ROOM:
        distance = angular_distance(lighting.direction, direction_from_uv(u, v))
        nearest = int(distance.argmin())
        # A place is known to a pixel of the search grid (1.4°) and a size to a step of the bank
        # (1.6° in the inner radius); the paper notes that lights come out a little too large.
        assert math.degrees(distance[nearest]) < 2.0
        assert radius - 1.6 < math.degrees(lighting.half_angle[nearest]) < radius + 3.2


def test_lights_take_what_lies_in_their_disc_and_leave_it_black():
    environment = disc_map(128, [ROOM[0]])
    lighting = decompose(environment)
    inside = (
        angular_distance(pixel_directions(128), lighting.direction[0]) <= lighting.half_angle[0]
    )
    assert np.array_equal(~inside, lighting.ambient.radiance.any(axis=2))
    expected = (environment.radiance * environment.row_solid_angle[:, None, None])[inside]
    assert np.allclose(lighting.irradiance[0], expected.sum(axis=0, dtype=np.float64), rtol=1e-6)


def test_the_strongest_response_comes_first():
    lighting = decompose(disc_map(128, ROOM))
    distance = angular_distance(lighting.direction[0], direction_from_uv(0.1, 0.3))
    assert math.degrees(distance) < 2.0


@pytest.mark.parametrize("level", [0.0, 1.0])
@pytest.mark.parametrize("height", [1, 2, 5, 64])
def test_constant_and_black_maps_have_no_lights(height, level):
    environment = EnvironmentMap(np.full((height, 2 * height, 3), level, np.float32))
    lighting = decompose(environment)
    assert len(lighting) == 0
    assert lighting.ambient is environment


def test_a_light_below_the_threshold_stays_ambient():
    def found(share: float) -> int:
        return len(decompose(disc_map(128, [ROOM[0], (0.6, 0.5, 6.0, 20.0 * share)])))

    # The background within the disc adds less than a thousandth of the first light.
    assert (found(0.015), found(0.025)) == (1, 2)


def test_the_budget_is_an_upper_bound():
    environment = disc_map(128, ROOM)
    all_lights = decompose(environment)
    two = decompose(environment, 2)
    assert len(two) == 2
    assert np.array_equal(two.direction, all_lights.direction[:2])


@pytest.mark.parametrize("shift", [1, 2, 31])
def test_rolling_the_map_rolls_the_lights(shift):
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[7, [0, 31]] = 1.0
    radiance[3, 12] = 5.0
    before = decompose(EnvironmentMap(radiance))
    after = decompose(EnvironmentMap(np.roll(radiance, shift, axis=1)))
    angle = 2.0 * math.pi * shift / 32
    x, y, z = before.direction.T
    turned = np.stack(
        [x * math.cos(angle) - z * math.sin(angle), y, z * math.cos(angle) + x * math.sin(angle)],
        axis=1,
    )
    assert np.allclose(after.direction, turned, atol=1e-14)
    assert np.array_equal(after.half_angle, before.half_angle)


def test_threads_do_not_change_the_lights():
    before, results = thread_count(), []
    try:
        for threads in (1, 3):
            set_thread_count(threads)
            results.append(decompose(disc_map(128, ROOM)))
    finally:
        set_thread_count(before)
    for name in ("direction", "irradiance", "half_angle"):
        assert np.array_equal(*(getattr(result, name) for result in results))


@pytest.mark.parametrize("half_angle", [1.7, 16.9, 60.0])
@pytest.mark.parametrize("v", [0.004, 0.3, 0.97])
def test_disc_pixels_are_those_within_the_angle(v, half_angle):
    height, u = 64, 0.002
    disc = disc_pixels(height, u, v, math.radians(half_angle))
    mask = np.zeros((height, 2 * height), np.bool_)
    for k, row in enumerate(disc.row):
        mask[row, disc.columns(k, 2 * height)] = True
    distance = angular_distance(pixel_directions(height), direction_from_uv(u, v))
    assert np.array_equal(mask, distance <= math.radians(half_angle))
    flux = disc_flux(np.ones((height, 128, 3), np.float32), row_solid_angle(height, 128), disc)
    assert np.allclose(flux, (row_solid_angle(height, 128)[:, None] * mask).sum(), rtol=1e-12)


@pytest.mark.skipif("ENVLIGHT_DATA" not in os.environ, reason="ENVLIGHT_DATA names no data folder")
def test_a_room_with_windows_has_a_few_lights_with_much_of_its_light():
    path = Path(os.environ["ENVLIGHT_DATA"]) / "environments" / "entrance_hall.exr"
    environment = EnvironmentMap.from_file(path)
    lighting = decompose(environment)
    # The paper's four maps have 4 to 17 lights.
    assert 2 <= len(lighting) <= 25
    share = (lighting.irradiance.sum(axis=0) @ LUMINANCE_WEIGHTS) / environment.luminous_flux
    assert 0.2 < share < 0.9
