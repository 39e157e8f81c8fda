"""LightGen: clusters that are k-means' own, counts, energy, edges."""

import numpy as np

from samplers.grids.reduced_map import reduce_map
from samplers.lightgen import clusters
from tests.samplers.maps import noisy_map


def means_and_distortion(leaves, label):
    weight = leaves.luminous_flux
    total = np.bincount(label, weight)
    mean = (
        np.stack([np.bincount(label, weight * x) for x in leaves.direction.T], 1) / total[:, None]
    )
    return mean, float((weight * ((leaves.direction - mean[label]) ** 2).sum(axis=1)).sum())


def test_clusters_are_a_fixed_point_of_k_means():
    leaves, _ = reduce_map(noisy_map(16, sun=1e3), 16).leaves()
    label = clusters(leaves.direction, leaves.luminous_flux, 12, "random", 5, 0)
    mean, _ = means_and_distortion(leaves, label)
    apart = ((leaves.direction[:, None] - mean) ** 2).sum(axis=2)
    own = apart[np.arange(len(label)), label]
    # Squared distances of order 1, each a sum of rounded terms.
    assert (own <= apart.min(axis=1) + 1e-12).all()


def test_more_searches_are_no_worse():
    """The best of several: on average over seeds, and by more than one search varies."""
    leaves, _ = reduce_map(noisy_map(16, sun=1e3), 16).leaves()

    def distortion(searches: int) -> float:
        labels = [
            clusters(leaves.direction, leaves.luminous_flux, 12, "random", searches, seed)
            for seed in range(6)
        ]
        return float(np.mean([means_and_distortion(leaves, label)[1] for label in labels]))

    assert distortion(8) < distortion(1)
