"""Kollig and Keller's lights as a whole."""

import numpy as np

from samplers.environment import EnvironmentMap
from samplers.grids.reduced_map import reduce_map
from samplers.kollig_keller import next_start, relaxed_cells
from samplers.registry import make_sampler
from samplers.sphere import angular_distance


def noise(height=16, power=6.0, seed=0):
    rng = np.random.default_rng(seed)
    return EnvironmentMap.from_array(rng.random((height, 2 * height, 3)) ** power)


def lights_of(environment, count, seed=0, **parameters):
    sampler = make_sampler("kollig-keller", **parameters)
    return sampler.prepare(environment, count, np.random.default_rng(seed))


def test_lights_stand_at_the_centroids_of_the_leaves_nearest_to_them():
    leaves, _ = reduce_map(noise(), 16).leaves()
    label = relaxed_cells(leaves, 12, np.random.default_rng(3))
    weight = leaves.luminous_flux[:, None] * leaves.direction
    centre = np.stack([weight[label == k].sum(axis=0) for k in range(12)])
    centre /= np.linalg.norm(centre, axis=1, keepdims=True)
    apart = angular_distance(leaves.direction[:, None], centre)
    own = apart[np.arange(len(label)), label]
    assert (own <= apart.min(axis=1) + 1e-9).all()


def test_a_light_is_added_where_most_energy_can_be_shared():
    leaves, _ = reduce_map(noise(), 16).leaves()
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
