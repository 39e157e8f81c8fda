"""Kollig and Keller's lights, and relaxation with bounds against the plain method."""

import numpy as np
import pytest

from samplers.environment import EnvironmentMap
from samplers.grids.reduced_map import reduce_map
from samplers.kollig_keller import next_start, relaxed_cells
from samplers.kollig_keller.relaxation import Relaxation
from samplers.registry import make_sampler
from samplers.sphere import angular_distance, normalized
from tests.samplers.maps import noisy_map


def lights_of(environment, count, seed=0, **parameters):
    sampler = make_sampler("kollig-keller", **parameters)
    return sampler.prepare(environment, count, np.random.default_rng(seed))


def test_lights_stand_at_the_centroids_of_the_leaves_nearest_to_them():
    leaves, _ = reduce_map(noisy_map(16, sun=1e3), 16).leaves()
    label = relaxed_cells(leaves, 12, np.random.default_rng(3))
    weight = leaves.luminous_flux[:, None] * leaves.direction
    centre = np.stack([weight[label == k].sum(axis=0) for k in range(12)])
    centre /= np.linalg.norm(centre, axis=1, keepdims=True)
    apart = angular_distance(leaves.direction[:, None], centre)
    own = apart[np.arange(len(label)), label]
    assert (own <= apart.min(axis=1) + 1e-9).all()


def test_a_light_is_added_where_most_energy_can_be_shared():
    leaves, _ = reduce_map(noisy_map(16, sun=1e3), 16).leaves()
    label = np.arange(len(leaves)) // 100
    alone = int(np.argmax(leaves.luminous_flux))
    label[alone] = label.max() + 1  # most energy of all, if the rest were dim, but one leaf
    energy = np.bincount(label, leaves.luminous_flux)[:-1]
    brightest = next_start(leaves, label, None)
    members = np.flatnonzero(label == energy.argmax())
    radiance = leaves.luminous_flux / leaves.solid_angle
    assert brightest == members[radiance[members].argmax()]
    drawn = [next_start(leaves, label, np.random.default_rng(k)) for k in range(400)]
    assert set(drawn) <= set(members.tolist())
    share = leaves.luminous_flux[members] / leaves.luminous_flux[members].sum()
    found = np.mean(np.array(drawn) == members[share.argmax()])
    # 400 draws of a share p: five standard deviations.
    assert abs(found - share.max()) < 5.0 * np.sqrt(share.max() / 400)
    assert next_start(leaves, np.arange(len(leaves)), None) is None


def test_energies_are_alike_on_a_constant_map():
    lights = lights_of(EnvironmentMap(np.ones((32, 64, 3), np.float32)), 32)
    energy = lights.irradiance[:, 0] / lights.irradiance[:, 0].mean()
    # Cells of relaxed points differ by less than a factor of two from their mean.
    assert energy.min() > 0.5 and energy.max() < 2.0


def points(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    direction = normalized(rng.normal(size=(count, 3)), [0.0, 1.0, 0.0])
    return direction, rng.random(count) ** 4 + 1e-6


def nearest(direction: np.ndarray, centre: np.ndarray) -> np.ndarray:
    return ((direction[:, None] - centre) ** 2).sum(axis=2).argmin(axis=1)


def plain_step(direction, weight, centre):
    """Centroids of the nearest points, then the nearest centres again."""
    label = nearest(direction, centre)
    moment = np.stack([np.bincount(label, weight * x, len(centre)) for x in direction.T], axis=1)
    length = np.linalg.norm(moment, axis=1, keepdims=True)
    return np.where(length > 0.0, moment / np.where(length > 0.0, length, 1.0), centre)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_steps_are_those_of_the_plain_method(seed):
    direction, weight = points(800, seed)
    cells, centre = Relaxation(direction, weight, 40), np.empty((0, 3))
    for k in range(40):
        cells.add(direction[k])
        centre = np.concatenate([centre, direction[[k]]])
        np.testing.assert_array_equal(cells.label, nearest(direction, centre))
        for _ in range(3):
            cells.relax(0.0, 1)
            centre = plain_step(direction, weight, centre)
            # Sums of 800 terms in another order.
            np.testing.assert_allclose(cells.centre, centre, atol=1e-13)
            np.testing.assert_array_equal(cells.label, nearest(direction, centre))
            centre = cells.centre.copy()


def test_a_tolerance_ends_early():
    direction, weight = points(800)
    ends = []
    for tolerance in (0.0, 0.2):
        cells = Relaxation(direction, weight, 8)
        for k in range(8):
            cells.add(direction[k])
        cells.relax(tolerance, 200)
        once = cells.centre.copy()
        cells.relax(0.0, 1)
        ends.append(np.abs(cells.centre - once).max())
    assert ends[0] < 1e-14 < ends[1]
