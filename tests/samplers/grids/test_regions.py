"""Rectangles of a map: their sums, middles and angles, and how splitting proceeds."""

import math

import numpy as np
import pytest

from samplers import EnvironmentMap
from samplers.grids.regions import (
    largest_angle_to,
    lights_of_regions,
    mean_angle_to,
    region_middle,
    region_sums,
    split_until,
)
from samplers.sphere import angular_distance, direction_from_uv, pixel_directions

EPSILON = float(np.finfo(np.float64).eps)


def sunny(height, sun=1e5):
    rng = np.random.default_rng(height)
    radiance = rng.uniform(0.1, 1.0, (height, 2 * height, 3)).astype(np.float32)
    radiance[height // 3, height // 2] *= sun
    return EnvironmentMap.from_array(radiance)


def random_regions(height, count=100):
    rng = np.random.default_rng(2)
    top, left = rng.integers(0, height, count), rng.integers(0, 2 * height, count)
    bottom, right = rng.integers(top + 1, height + 1), rng.integers(left + 1, 2 * height + 1)
    return np.stack([top, left, bottom, right], axis=1)


@pytest.mark.parametrize("height", [1, 2, 15, 16, 17, 50])
def test_sums_agree_with_exact_ones(height):
    environment = sunny(height)
    regions = random_regions(height)
    solid_angle = environment.row_solid_angle[:, None, None]
    flux = environment.luminance.astype(np.float64)[..., None] * solid_angle
    terms = [environment.radiance * solid_angle, flux * pixel_directions(height)]
    for found, term in zip(region_sums(environment, regions), terms, strict=True):
        # At most W + H additions of rounded products of three factors lie behind any sum, and
        # what a difference of running sums leaves is off by their size, the sun's included.
        bound = (3 * height + 16) * EPSILON * np.abs(term).sum(axis=(0, 1))
        for (top, left, bottom, right), values in zip(regions, found, strict=True):
            box = term[top:bottom, left:right]
            exact = [math.fsum(box[..., k].flat) for k in range(3)]
            assert (np.abs(values - exact) <= bound).all()


def test_middles_halve_the_solid_angle():
    height = 32
    regions = random_regions(height)
    middle = region_middle(regions, height)
    np.testing.assert_allclose(np.linalg.norm(middle, axis=1), 1.0, atol=4 * EPSILON)
    step = math.pi / height
    top, bottom = np.cos(regions[:, 0] * step), np.cos(regions[:, 2] * step)
    np.testing.assert_allclose(middle[:, 1], 0.5 * (top + bottom), atol=2 * EPSILON)
    phi = np.arctan2(middle[:, 0], -middle[:, 2]) % (2 * math.pi)
    inside = np.abs(middle[:, 1]) < 1 - 1e-9
    wanted = 0.5 * (regions[:, 1] + regions[:, 3]) * step
    np.testing.assert_allclose(phi[inside], wanted[inside] % (2 * math.pi), atol=1e-12)


def test_mean_angles_are_right_to_about_a_percent():
    height, parts = 64, (np.arange(300) + 0.5) / 300
    regions = random_regions(height, 30)
    direction = region_middle(regions, height)
    found = mean_angle_to(regions, height, direction)
    for (top, left, bottom, right), towards, angle in zip(regions, direction, found, strict=True):
        first, last = np.cos(np.array([top, bottom]) * math.pi / height)
        v = np.arccos(first + parts * (last - first)) / math.pi
        u = (left + parts * (right - left)) / (2 * height)
        points = direction_from_uv(u[None, :], v[:, None])
        # The integrand has a kink at the direction itself, where 8 Gauss points a side are off by
        # about the square of their spacing, 1 / 8².
        assert angle == pytest.approx(angular_distance(points, towards).mean(), rel=1 / 64)


def test_largest_angles_are_those_of_a_fine_search():
    height, parts = 64, np.linspace(0.0, 1.0, 300)
    regions = np.concatenate([random_regions(height, 60), [[0, 0, 64, 128], [0, 0, 64, 100]]])
    rng = np.random.default_rng(0)
    inside, anywhere = region_middle(regions, height), rng.normal(size=(len(regions), 3))
    anywhere /= np.linalg.norm(anywhere, axis=1, keepdims=True)
    for direction in (inside, anywhere):
        found = largest_angle_to(regions, height, direction)
        for (top, left, bottom, right), towards, angle in zip(
            regions, direction, found, strict=True
        ):
            v = (top + parts * (bottom - top)) / height
            u = (left + parts * (right - left)) / (2 * height)
            points = direction_from_uv(u[None, :], v[:, None])
            searched = angular_distance(points, towards).max()
            # The search ends within half a step of the farthest point, on either axis.
            step = math.pi / height * max(bottom - top, right - left) / 299
            # An arc cosine near −1 keeps half of the digits.
            assert searched - 1e-7 <= angle <= searched + step


def test_regions_without_energy_give_no_light():
    radiance = np.zeros((4, 8, 3), np.float32)
    radiance[0, :4] = 1.0
    environment = EnvironmentMap.from_array(radiance)
    regions = np.array([[0, 0, 2, 4], [0, 4, 2, 8], [2, 0, 4, 8]])
    lights = lights_of_regions(environment, regions)
    assert len(lights) == 1
    np.testing.assert_allclose(lights.irradiance[0], environment.total_flux, rtol=8 * EPSILON)


def test_lights_stand_at_the_energy_centroid_or_where_they_are_told():
    environment = sunny(16)
    regions = np.array([[0, 0, 16, 16], [0, 16, 16, 32]])
    _, moment = region_sums(environment, regions)
    centroid = moment / np.linalg.norm(moment, axis=1, keepdims=True)
    lights = lights_of_regions(environment, regions)
    np.testing.assert_allclose(lights.direction, centroid, atol=4 * EPSILON)
    told = region_middle(regions, 16)
    np.testing.assert_array_equal(lights_of_regions(environment, regions, told).direction, told)


def halve(region):
    top, left, bottom, right = region
    if right - left < 2:
        return None
    middle = (left + right) // 2
    return (top, left, bottom, middle), (top, middle, bottom, right)


def width(region):
    return float(region[3] - region[1])


@pytest.mark.parametrize("count", [1, 2, 3, 7, 16, 100])
def test_splitting_meets_the_count_as_far_as_it_can(count):
    root = (0, 0, 1, 16)
    by_heap = split_until(count, root, halve, width, rounds=False)
    assert len(by_heap) == min(count, 16)
    in_rounds = split_until(count, root, halve, width, rounds=True)
    assert len(in_rounds) == min(2 ** int(math.log2(count)), 16)
    for regions in (by_heap, in_rounds):
        covered = sorted(column for _, left, _, right in regions for column in range(left, right))
        assert covered == list(range(16))


def test_the_older_of_two_equals_is_split_first():
    regions = split_until(3, (0, 0, 1, 16), halve, width, rounds=False)
    assert sorted(regions) == [(0, 0, 1, 4), (0, 4, 1, 8), (0, 8, 1, 16)]
