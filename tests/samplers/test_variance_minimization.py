"""Chosen cuts against brute force over all of them, and what the lights must keep of the map."""

import numpy as np
import pytest

from samplers.sphere import pixel_directions
from samplers.variance_minimization import best_cut, region_variance
from tests.samplers.maps import noisy_map

METRICS = ["planar", "spherical"]


def positions(environment, metric):
    if metric == "spherical":
        return pixel_directions(environment.height)
    rows, columns = np.mgrid[: environment.height, : environment.width]
    return np.stack([columns, rows], axis=2).astype(np.float64)


def brute_variance(environment, metric, top, left, bottom, right):
    flux = environment.flux[top:bottom, left:right].reshape(-1, 1)
    place = positions(environment, metric)[top:bottom, left:right].reshape(len(flux), -1)
    centroid = (flux * place).sum(0) / flux.sum()
    return (flux * (place - centroid) ** 2).sum()


def parts(region, across_rows, cut):
    top, left, bottom, right = region
    if across_rows:
        return (top, left, cut, right), (cut, left, bottom, right)
    return (top, left, bottom, cut), (top, cut, bottom, right)


def tables(environment, metric):
    if metric == "spherical":
        return True, environment.flux_table, environment.moment_table
    return False, environment.flux_table, environment.pixel_moment_table


def rounding(environment, metric):
    # A table entry is a sum of up to 2H² terms, off by 2H² ε of its value at the very worst; the
    # largest entry of the second moments is flux × (H² + H²/4) in pixels, flux × 1 in chords.
    scale = 1.25 * environment.height**2 if metric == "planar" else 1.0
    return 8.0 * environment.height**2 * 2.0**-52 * scale * environment.flux.sum()


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("seed", range(6))
def test_the_cut_is_the_best_of_all(metric, seed):
    environment = noisy_map(9, seed, 1e3)
    rng = np.random.default_rng(seed)
    for _ in range(12):
        top, bottom = np.sort(rng.choice(10, 2, replace=False))
        left, right = np.sort(rng.choice(19, 2, replace=False))
        region = (int(top), int(left), int(bottom), int(right))
        every = [(True, k) for k in range(top + 1, bottom)]
        every += [(False, k) for k in range(left + 1, right)]
        if not every:
            continue
        values = [
            max(brute_variance(environment, metric, *part) for part in parts(region, *cut))
            for cut in every
        ]
        chosen = best_cut(*tables(environment, metric), *region)
        value = values[every.index((bool(chosen[0]), chosen[1]))]
        assert value <= min(values) + rounding(environment, metric)


@pytest.mark.parametrize("metric", METRICS)
def test_the_variance_is_the_second_moment_about_the_centroid(metric):
    environment = noisy_map(8, 1, 1e3)
    for region in [(0, 0, 8, 16), (2, 3, 7, 11), (0, 5, 1, 9), (3, 3, 4, 4)]:
        expected = brute_variance(environment, metric, *region)
        found = region_variance(*tables(environment, metric), *region)
        assert abs(found - expected) <= rounding(environment, metric)
