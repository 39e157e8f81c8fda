"""Tiled k-means against the brute-force method."""

import numpy as np
import pytest

from samplers.decomposition.spherical_kmeans import OUTSIDE, kmeans, nearest_centre, tiles_of


def points(count, seed):
    """Directions in a few lumps, weights over six decades, and tiles of nearby points."""
    rng = np.random.default_rng(seed)
    lump = rng.normal(size=(7, 3))[rng.integers(7, size=count)]
    direction = lump + 0.3 * rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    key = (np.floor((direction + 1.0) * 8.0).astype(np.int64) * [1, 16, 256]).sum(axis=1)
    return direction, 10.0 ** rng.uniform(-3.0, 3.0, count), key


def brute_force(direction, weight, centre, reach=np.inf):
    centre, label = centre.copy(), None
    for _ in range(1000):
        distance = ((direction[:, None] - centre) ** 2).sum(axis=2)
        new = np.where(distance.min(axis=1) <= reach**2, distance.argmin(axis=1), OUTSIDE)
        if label is not None and (new == label).all():
            break
        label = new
        for k in range(len(centre)):
            moment = (weight[label == k, None] * direction[label == k]).sum(axis=0)
            if moment.any():
                centre[k] = moment / np.linalg.norm(moment)
    return centre, label


@pytest.mark.parametrize("clusters", [1, 2, 9, 60])
@pytest.mark.parametrize("reach", [np.inf, 0.4, 0.1, 1e-3])
@pytest.mark.parametrize("seed", [0, 1])
def test_clusters_are_those_of_brute_force(clusters, reach, seed):
    direction, weight, key = points(3000, seed)
    start = direction[np.random.default_rng(seed).choice(3000, clusters, replace=False)]
    tiles = tiles_of(direction, weight, key)
    centre, label = kmeans(direction, weight, tiles, start, reach)
    wanted_centre, wanted_label = brute_force(direction, weight, start, reach)
    assert np.array_equal(label, wanted_label)
    assert (label == OUTSIDE).any() == (reach < 1.0)
    # Sums of 3000 terms in another order: 3000 × 1.1e-16 of the largest term.
    assert np.abs(centre - wanted_centre).max() < 1e-12


@pytest.mark.parametrize("clusters", [1, 5, 200])
def test_nearest_centres_are_those_of_brute_force(clusters):
    direction, weight, key = points(5000, 3)
    centre = points(clusters, 4)[0]
    label = nearest_centre(direction, tiles_of(direction, weight, key), centre)
    assert np.array_equal(label, ((direction[:, None] - centre) ** 2).sum(axis=2).argmin(axis=1))


def test_an_empty_cluster_keeps_its_centre():
    direction, weight, key = points(500, 7)
    direction[:, 0] = np.abs(direction[:, 0]) + 1.0
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    start = np.concatenate([direction[:3], [[-1.0, 0.0, 0.0]]])
    centre, label = kmeans(direction, weight, tiles_of(direction, weight, key), start)
    assert not (label == 3).any()
    assert np.array_equal(centre[3], start[3])
