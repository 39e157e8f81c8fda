"""Splitting and merging of regions by importance."""

import numpy as np
import pytest

from samplers.environment import EnvironmentMap
from samplers.grids.reduced_map import reduce_map
from samplers.grids.sphere_grid import linked, touching
from samplers.tmms.region_merging import importance, merge_regions, split_regions, two_means

HEIGHT = 16


def grid_of(seed=0, power=6):
    radiance = np.random.default_rng(seed).random((HEIGHT, 2 * HEIGHT, 1)) ** power
    return reduce_map(EnvironmentMap.from_array(np.repeat(radiance, 3, axis=2)), HEIGHT)


def values(label, grid, useful):
    flux = np.bincount(label, grid.luminous_flux)
    solid_angle = np.bincount(label, grid.solid_angle)
    return np.array([importance(*both, useful) for both in zip(flux, solid_angle, strict=True)])


def assert_connected(label, height):
    pieces = linked(label[:, None].astype(float), 0.0, height)
    assert pieces.max() == label.max()


def test_importance_counts_solid_angle_up_to_a_limit():
    assert importance(3.0, 0.0001, 0.01) == importance(3.0, 0.0001, None) == pytest.approx(0.3)
    assert importance(3.0, 1.0, 0.01) == importance(3.0, 0.01, None)
    assert importance(3.0, 16.0, None) == pytest.approx(6.0)


def test_two_means_separate_two_lumps():
    grid = grid_of()
    cells = np.arange(len(grid.direction))
    weight = np.where(np.abs(grid.direction[:, 0]) > 0.9, 1.0, 0.0)
    side = two_means(cells, grid.direction, weight)
    assert len(np.unique(side[grid.direction[:, 0] > 0.9])) == 1
    assert side[grid.direction[:, 0].argmax()] != side[grid.direction[:, 0].argmin()]


@pytest.mark.parametrize("useful", [None, 0.01])
@pytest.mark.parametrize("count", [1, 3, 16, 200])
def test_no_region_stays_far_above_the_average(count, useful):
    grid = grid_of()
    start = np.zeros(len(grid.solid_angle), np.int64)
    label = split_regions(start, grid, grid.luminous_flux, count, 2.0, useful)
    value = values(label, grid, useful)
    splittable = np.bincount(label) > 1
    assert (value[splittable] <= 2.0 * values(start, grid, useful).sum() / count).all()
    assert len(value) >= count
    assert_connected(label, HEIGHT)


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_merging_leaves_connected_regions(count):
    grid = grid_of()
    label = merge_regions(np.arange(len(grid.solid_angle)), grid, grid.luminous_flux, count, None)
    assert np.array_equal(np.unique(label), np.arange(count))
    assert_connected(label, HEIGHT)


def slowly_merged(label, grid, count, useful):
    """The same rule without a heap: everything anew for each merge."""
    while label.max() + 1 > count:
        flux = np.bincount(label, grid.luminous_flux)
        solid_angle = np.bincount(label, grid.solid_angle)
        least = values(label, grid, useful).argmin()
        beside = {b for pair in touching(label, grid.height) if least in pair for b in pair}
        other = min(
            beside - {least},
            key=lambda n: importance(
                flux[least] + flux[n], solid_angle[least] + solid_angle[n], useful
            ),
        )
        label = np.unique(np.where(label == least, other, label), return_inverse=True)[1]
    return label


@pytest.mark.parametrize(("seed", "useful"), [(0, None), (1, None), (1, 0.01)])
def test_the_least_important_region_joins_its_best_neighbour(seed, useful):
    grid = grid_of(seed)
    start = np.arange(len(grid.solid_angle)) // 4
    for count in (40, 5):
        mine = merge_regions(start, grid, grid.luminous_flux, count, useful)
        wanted = slowly_merged(start, grid, count, useful)
        assert len(np.unique(np.stack([mine, wanted]), axis=1).T) == count  # the same partition


def test_dark_regions_vanish_first():
    grid = grid_of()
    flux = np.where(np.arange(len(grid.solid_angle)) % 3 == 0, grid.luminous_flux, 0.0)
    lit = np.count_nonzero(flux)
    label = merge_regions(np.arange(len(flux)), grid, flux, lit, None)
    assert (np.bincount(label, flux) > 0.0).all()
