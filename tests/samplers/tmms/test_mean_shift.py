"""Windowed mean shift against brute force."""

import math

import numpy as np
import pytest

from samplers.tmms.mean_shift import group_sizes, groups_of, mean_of_groups, modes

HEIGHT = 12


def values(seed=0, height=HEIGHT):
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.integers(4, size=(height, 4)), height // 2, axis=1) * 10.0
    return mean_of_groups(steps + rng.uniform(0.0, 2.0, (height, 2 * height)))


def points_of(groups):
    """The groups in use: features (n, 4), weights (n,), and the group of each cell (h, 2h)."""
    cells = 2 * len(groups.size)
    width = cells // groups.size
    feature = np.concatenate([row[:, :n].T for row, n in zip(groups.feature, width, strict=True)])
    first = np.concatenate([[0], np.cumsum(width)[:-1]])
    column = np.arange(cells)
    index = first[:, None] + column // groups.size[:, None]
    return feature, np.repeat(groups.weight, width), index


def brute_force(feature, weight, steps, tolerance):
    result = feature.copy()
    for point in result:
        for _ in range(steps):
            inside = ((feature - point) ** 2).sum(axis=1) <= 1.0
            mean = np.average(feature[inside], axis=0, weights=weight[inside])
            moved = np.linalg.norm(mean - point)
            point[:] = mean
            if moved <= tolerance:
                break
    return result


@pytest.mark.parametrize("height", [1, 2, 3, 12, 24])
@pytest.mark.parametrize("bandwidth", [0.1, 0.4, 0.99, 2.0])
def test_modes_are_those_of_brute_force(height, bandwidth):
    value = values(height=height) if height > 3 else np.arange(2.0 * height**2).reshape(height, -1)
    groups = groups_of(mean_of_groups(value), bandwidth, 6.5)
    feature, weight, index = points_of(groups)
    wanted = brute_force(feature, weight, 100, 1e-3)[index]
    # Sums in another order; a ball's border never falls within rounding of a random value.
    assert np.abs(modes(groups) - wanted).max() < 1e-9


def test_sums_along_rows_are_exact():
    feature = points_of(groups_of(values(5), 0.3, 6.5))[0]
    rng = np.random.default_rng(0)
    for _ in range(20):
        row = rng.permutation(feature)[: 2 * HEIGHT]
        assert all(row[:, i].sum() == math.fsum(row[:, i]) for i in range(4))


def test_groups_are_about_as_wide_as_high():
    for height in (1, 2, 3, 5, 16, 128):
        size = group_sizes(height)
        assert (2 * height % size == 0).all()
        sine = np.sin((np.arange(height) + 0.5) * np.pi / height)
        assert (size * sine <= 1.0 + 1e-12).all()
    assert (group_sizes(128) * np.sin((np.arange(128) + 0.5) * np.pi / 128) > 0.5).all()


def test_weights_are_the_solid_angles_of_groups():
    groups = groups_of(np.zeros((HEIGHT, 2 * HEIGHT)), 0.1, 1.0)
    width = 2 * HEIGHT // groups.size
    assert groups.weight @ width == pytest.approx(4.0 * np.pi, rel=1e-12)
