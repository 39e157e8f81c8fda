"""Median cut against a slow version that sums every region anew."""

import math

import numpy as np
import pytest

from samplers import EnvironmentMap, make_sampler
from samplers.conformance.stress_maps import stress_map
from samplers.sphere import angular_distance, pixel_directions


def lights(environment, count, **parameters):
    sampler = make_sampler("median-cut", **parameters)
    return sampler.prepare(environment, count, np.random.default_rng(0))


def energy(flux, region):
    top, left, bottom, right = region
    return math.fsum(flux[top:bottom, left:right].flat)


def slow_split(flux, region, aspect):
    """Both parts, by trying every cut."""
    top, left, bottom, right = region
    if bottom - top == right - left == 1:
        return None
    latitude = math.pi * (0.5 - 0.5 * (top + bottom) / len(flux))
    scale = math.cos(latitude) if aspect else 1.0
    across = bottom - top > (right - left) * scale
    if (bottom - top if across else right - left) == 1:
        across = not across
    low, high = (top, bottom) if across else (left, right)

    def parts(cut):
        if across:
            return (top, left, cut, right), (cut, left, bottom, right)
        return (top, left, bottom, cut), (top, cut, bottom, right)

    half = 0.5 * energy(flux, region)
    if not half > 0.0:
        return parts((low + high) // 2)
    return parts(min(range(low + 1, high), key=lambda c: abs(energy(flux, parts(c)[0]) - half)))


def slow_regions(flux, count, order, aspect):
    height, width = flux.shape
    regions = [(0, 0, height, width)]
    if order == "rounds":
        for _ in range(int(math.log2(count))):
            regions = [q for r in regions for q in (slow_split(flux, r, aspect) or (r,))]
        return regions
    while len(regions) < count:
        candidates = [r for r in regions if slow_split(flux, r, aspect)]
        if not candidates:
            break
        largest = max(candidates, key=lambda r: energy(flux, r))
        regions.remove(largest)
        regions += slow_split(flux, largest, aspect)
    return regions


def slow_lights(environment, regions):
    solid_angle = environment.row_solid_angle[:, None, None]
    colour = environment.radiance * solid_angle
    moment = environment.luminance[..., None] * solid_angle * pixel_directions(environment.height)
    rows = []
    for top, left, bottom, right in regions:
        box = np.s_[top:bottom, left:right]
        direction = moment[box].sum(axis=(0, 1))
        rows.append([*colour[box].sum(axis=(0, 1)), *(direction / np.linalg.norm(direction))])
    return np.array(rows)


def in_order(rows):
    return rows[np.lexsort(rows[:, ::-1].T)]


@pytest.mark.parametrize("order", ["heap", "rounds"])
@pytest.mark.parametrize("aspect", [True, False])
@pytest.mark.parametrize(("height", "decades"), [(3, 1.0), (8, 4.0), (13, 2.0)])
@pytest.mark.parametrize("count", [1, 6, 16])
def test_lights_are_those_of_the_slow_version(order, aspect, height, decades, count):
    rng = np.random.default_rng(height)
    radiance = 10.0 ** rng.uniform(0.0, decades, (height, 2 * height, 3))
    environment = EnvironmentMap.from_array(radiance)
    flux = environment.luminance * environment.row_solid_angle[:, None]
    wanted = slow_lights(environment, slow_regions(flux, count, order, aspect))
    found = lights(environment, count, order=order, aspect=aspect)
    rows = np.concatenate([found.irradiance, found.direction], axis=1)
    # Sums of at most 338 positive terms, each rounded: 338 ε of the whole map's energy.
    tolerance = 338 * 2.3e-16 * max(environment.total_flux.max() / wanted[:, :3].min(), 1.0)
    np.testing.assert_allclose(in_order(rows), in_order(wanted), rtol=tolerance, atol=tolerance)


def test_the_middle_keeps_the_energy_and_moves_the_light():
    environment = stress_map("noise")
    centroid, middle = lights(environment, 8), lights(environment, 8, position="middle")
    np.testing.assert_array_equal(centroid.irradiance, middle.irradiance)
    assert angular_distance(centroid.direction, middle.direction).max() > 1e-3
