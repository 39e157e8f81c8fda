"""EnvIndirects: leaves, the cut, and how evenly it spreads lights."""

import numpy as np
import pytest

from samplers.decomposition.illumination_cut import CutRule, cut, env_indirects
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.light_leaves import light_leaves
from samplers.sphere import angular_distance, pixel_directions
from tests.samplers.maps import healpix_cells

ORIGINAL = CutRule(1.0, 0.0, 0.0)


def room(seed=0, height=64):
    """A smooth gradient with one patch of strong contrast."""
    rng = np.random.default_rng(seed)
    direction = pixel_directions(height)
    radiance = 1.0 + 0.5 * direction + rng.uniform(0.0, 0.05, (height, 2 * height, 3))
    patch = direction @ [0.6, 0.0, 0.8] > 0.93
    radiance[patch] *= rng.choice([0.2, 2.5], (patch.sum(), 1))
    return EnvironmentMap.from_array(radiance)


def unmasked(environment):
    return np.zeros(environment.radiance.shape[:2], np.bool_)


def largest_gap(lights):
    """Angle in radians from any direction to the nearest light, at most."""
    direction = pixel_directions(32).reshape(-1, 3)
    return angular_distance(direction[:, None], lights.direction).min(axis=1).max()


@pytest.mark.parametrize("side", [1, 8, 32])
def test_leaves_are_sums_over_healpix_cells(side):
    environment = room()
    masked = np.random.default_rng(1).random((64, 128)) < 0.3
    leaves = light_leaves(environment, masked, side)
    cell = healpix_cells(pixel_directions(64)[~masked], side)
    solid_angle = np.repeat(environment.row_solid_angle[:, None], 128, axis=1)[~masked]
    flux = environment.radiance[~masked].astype(float) * solid_angle[:, None]
    wanted = np.stack([np.bincount(cell, c) for c in (solid_angle, *flux.T)], axis=1)
    wanted = wanted[wanted[:, 0] > 0.0]
    got = np.column_stack([leaves.solid_angle, leaves.flux])
    assert len(got) == len(wanted)
    # The two number cells differently, so compare them sorted; sums of up to 500 pixels.
    assert np.sort(got, axis=0) == pytest.approx(np.sort(wanted, axis=0), rel=1e-12)
    moment = (flux @ [0.2126, 0.7152, 0.0722])[:, None] * pixel_directions(64)[~masked]
    assert leaves.moment.sum(axis=0) == pytest.approx(moment.sum(axis=0), rel=1e-10)


def test_cells_without_energy_are_left_out():
    radiance = np.zeros((32, 64, 3))
    radiance[16:] = 1.0
    leaves = light_leaves(EnvironmentMap.from_array(radiance), np.zeros((32, 64), bool), 8)
    assert (leaves.direction[:, 1] < 0.0).all()
    assert leaves.solid_angle.sum() == pytest.approx(2.0 * np.pi)


@pytest.mark.parametrize(("count", "share"), [(8, 0.9), (16, 0.8), (32, 0.8)])
def test_the_modified_cut_spreads_lights_more_evenly(count, share):
    """The original puts most lights into the patch of contrast and leaves wide gaps.

    Of 8 points on a sphere even the best leave 0.84 rad, three quarters of the original's gap."""
    environment = room()
    modified = env_indirects(environment, unmasked(environment), count, CutRule())
    original = env_indirects(environment, unmasked(environment), count, ORIGINAL)
    assert largest_gap(modified) < share * largest_gap(original)
    spread = [lights.irradiance.max() / lights.irradiance.mean() for lights in (modified, original)]
    assert spread[0] < 0.6 * spread[1]


@pytest.mark.parametrize("rows", [16, 32])
def test_lights_stay_where_they_are_when_rounding_changes(rows):
    # Each leaf is one pixel here, so that leaves of a row and of mirrored columns are tied.
    radiance = np.random.default_rng(7).uniform(0.5, 1.0, (rows, 2 * rows, 3)).astype(np.float32)
    brighter = (radiance * np.float64(1000.0 / 3.0)).astype(np.float32)
    none = np.zeros(radiance.shape[:2], np.bool_)
    before, after = (
        env_indirects(EnvironmentMap(r), none, 48, CutRule()) for r in (radiance, brighter)
    )
    # Radiance rounds by 6·10⁻⁸, a centroid by no more than that of the radius of its cluster.
    assert angular_distance(before.direction, after.direction).max() < 1e-7


def objective(leaves, label, node, mean):
    """V, D and E of a node, straight from their definitions; D is the mean angle or the largest."""
    member = label == node
    weight, energy = leaves.solid_angle[member], leaves.luminous_flux[member]
    value = energy / weight
    variance = np.sum(weight * (value - energy.sum() / weight.sum()) ** 2)
    axis = (weight[:, None] * leaves.direction[member]).sum(axis=0)
    angle = angular_distance(leaves.direction[member], axis)
    extent = np.average(angle, weights=weight) if mean else angle.max()
    return variance, extent, energy.sum()


@pytest.mark.parametrize(
    "rule", [CutRule(), ORIGINAL, CutRule(1.0, 0.0, 3.0), CutRule(light_extent="mean")], ids=str
)
def test_the_node_of_largest_objective_is_replaced(rule):
    environment = room(seed=2)
    leaves = light_leaves(environment, unmasked(environment), 16)
    weights = [rule.variance_weight, rule.extent_weight, rule.energy_weight]
    for count in range(2, 20):
        label, finer = cut(leaves, count, rule), cut(leaves, count + 1, rule)
        terms = np.array(
            [objective(leaves, label, node, rule.light_extent == "mean") for node in range(count)]
        )
        best = ((terms / terms.max(axis=0)) @ weights).argmax()
        replaced = [n for n in range(count) if len(np.unique(finer[label == n])) == 2]
        assert replaced == [best]


@pytest.mark.parametrize("weight", [-1.0, np.inf, np.nan])
def test_impossible_weights_are_refused(weight):
    with pytest.raises(EnvlightError, match="weights"):
        CutRule(extent_weight=weight)
