"""Splitting and merging of regions by importance."""

import math

import numpy as np
import pytest

from samplers.environment import EnvironmentMap
from samplers.grids.reduced_map import reduce_map
from samplers.grids.sphere_grid import linked, touching
from samplers.tmms.region_merging import importance, merge_regions, split_regions, width

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


@pytest.mark.parametrize("useful", [None, 0.01])
@pytest.mark.parametrize("count", [1, 3, 16, 200])
def test_no_region_stays_far_above_the_average(count, useful):
    grid = grid_of()
    start = np.zeros(len(grid.solid_angle), np.int64)
    label = split_regions(start, grid, grid.luminous_flux, count, 2.0, useful, math.inf)
    value = values(label, grid, useful)
    splittable = np.bincount(label) > 1
    assert (value[splittable] <= 2.0 * values(start, grid, useful).sum() / count).all()
    assert len(value) >= count
    assert_connected(label, HEIGHT)


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_merging_leaves_connected_regions(count):
    grid = grid_of()
    label = merge_regions(
        np.arange(len(grid.solid_angle)), grid, grid.luminous_flux, count, None, math.inf
    )
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
        mine = merge_regions(start, grid, grid.luminous_flux, count, useful, math.inf)
        wanted = slowly_merged(start, grid, count, useful)
        assert len(np.unique(np.stack([mine, wanted]), axis=1).T) == count  # the same partition


def test_dark_regions_vanish_first():
    grid = grid_of()
    flux = np.where(np.arange(len(grid.solid_angle)) % 3 == 0, grid.luminous_flux, 0.0)
    lit = np.count_nonzero(flux)
    label = merge_regions(np.arange(len(flux)), grid, flux, lit, None, math.inf)
    assert (np.bincount(label, flux) > 0.0).all()


def widths(label, grid):
    """Of the regions with two cells or more; one cell's is that of its shape, without light."""
    flux = np.bincount(label, grid.luminous_flux)
    moment = np.stack(
        [np.bincount(label, grid.luminous_flux * a) for a in grid.direction.T], axis=1
    )
    solid_angle = np.bincount(label, grid.solid_angle)
    several = np.bincount(label) > 1
    found = [width(*one) for one in zip(flux, moment, solid_angle, strict=True)]
    return np.array(found)[several]


@pytest.mark.parametrize("angle", [0.3, 1.0, 1.5])
def test_a_cap_has_the_width_one_and_a_ring_more(angle):
    grid = reduce_map(EnvironmentMap.from_array(np.ones((256, 512, 3))), 256)
    edge = round(angle * 256 / math.pi) * math.pi / 256
    height = np.arccos(grid.direction[:, 1])
    cap = (height < edge).astype(int)
    # Cells stand for their centres, which shortens a row of n by 1/n² at the most.
    assert widths(cap, grid)[1] == pytest.approx(1.0, abs=1e-3)
    ring = ((height < edge) & (height > 0.9 * edge)).astype(int)
    assert widths(ring, grid)[1] > 4.0


def test_regions_that_are_too_wide_are_split():
    grid = grid_of(power=1)
    ring = np.digitize(grid.direction[:, 1], [0.4, 0.6])
    assert widths(ring, grid).max() > 2.0
    label = split_regions(ring, grid, grid.luminous_flux, 1, 100.0, None, 2.0)
    assert widths(label, grid).max() <= 2.0
    assert_connected(label, HEIGHT)


@pytest.mark.parametrize("power", [0, 1])
def test_merging_makes_no_region_that_is_too_wide(power):
    grid = grid_of(power=power)
    cells = np.arange(len(grid.solid_angle))
    free, kept = (
        merge_regions(cells, grid, grid.luminous_flux, 40, None, widest)
        for widest in (math.inf, 2.0)
    )
    assert len(np.unique(free)) == len(np.unique(kept)) == 40
    assert widths(kept, grid).max() <= 2.0 < widths(free, grid).max()
