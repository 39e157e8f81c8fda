"""The forest of quads: which are split, what the lights keep, and mending against building."""

import math

import numpy as np
import pytest

from samplers import EnvironmentMap, EnvlightError, make_sampler
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.grids.healpix_grid import nested_index
from samplers.grids.quad_map import QuadMap
from samplers.q2_tree import Q2Tree
from samplers.q2_tree.forest import children
from samplers.sphere import angular_distance, pixel_direction
from tests.samplers.maps import healpix_cells, noisy_map

RNG = np.random.default_rng(0)
SUN = 1e4


def importance(source, quads):
    luminance = source.sums(np.array(quads)) @ LUMINANCE_WEIGHTS
    return luminance * (np.pi / 3.0 / 4.0 ** np.array([q[0] for q in quads])) ** 0.25


def test_leaves_are_found_by_brute_force_greed():
    environment = noisy_map(48, sun=SUN)
    source = QuadMap.of(environment)
    leaves = [(0, face, 0, 0) for face in range(12)]
    for _ in range(29):
        open_leaves = [q for q in leaves if q[0] < source.deepest_level]
        best = open_leaves[int(importance(source, open_leaves).argmax())]
        leaves.remove(best)
        leaves += children(best)
    assert set(Q2Tree.build(environment, 12 + 3 * 29).leaves) == set(leaves)


@pytest.mark.parametrize("position", ["jitter", "centre"])
def test_lights_stand_in_the_middle_half_of_their_quads(position):
    tree = Q2Tree.build(noisy_map(48, sun=SUN), 300)
    direction = tree.lights(position).direction
    for (level, face, i, j), place in zip(tree.leaves, direction, strict=True):
        side = 4 << level
        cell = nested_index(face, 4 * i, 4 * j, side)
        inside = [cell + nested_index(0, a, b, 4) for a in (1, 2) for b in (1, 2)]
        assert healpix_cells(place[None], side)[0] in inside


def test_a_small_sun_is_found_at_the_energy_centroid():
    radiance = np.full((128, 256, 3), 1e-7, np.float32)
    radiance[40, 77] = 1e5
    tree = Q2Tree.build(EnvironmentMap.from_array(radiance), 100)
    lights = tree.lights("centroid")
    brightest = lights.direction[lights.irradiance[:, 1].argmax()]
    # A row of this map is met at two parallels, a quarter of it above and below its middle, and
    # the leaf may hold one of them only.
    assert angular_distance(brightest, pixel_direction(40, 77, 128)) < 0.26 * math.pi / 128


def test_a_quarter_turn_of_the_map_turns_the_lights():
    environment = noisy_map(48, sun=SUN)
    turned = EnvironmentMap.from_array(np.roll(environment.radiance, 24, axis=1))
    a, b = (make_sampler("q2-tree").prepare(e, 150, RNG) for e in (environment, turned))
    # φ grows by a quarter turn: (sin φ, −cos φ) becomes (cos φ, sin φ).
    expected = np.stack([-a.direction[:, 2], a.direction[:, 1], a.direction[:, 0]], axis=1)
    distance = angular_distance(expected[:, None], b.direction[None])
    assert distance.min(axis=1).max() < 1e-12
    np.testing.assert_allclose(
        b.irradiance[distance.argmin(axis=1)], a.irradiance, rtol=1e-10, atol=1e-12
    )


@pytest.mark.parametrize("count", [12, 60, 300])
def test_mending_ends_at_the_tree_built_from_scratch(count):
    rng = np.random.default_rng(count)
    radiance = noisy_map(40, sun=SUN).radiance.copy()
    tree = Q2Tree.build(EnvironmentMap.from_array(radiance.copy()), count)
    moved = 0
    for _ in range(6):
        row, column = rng.integers(30), rng.integers(60)
        radiance[row : row + 8, column : column + 12] *= np.float32(np.exp(2.0 * rng.normal()))
        environment = EnvironmentMap.from_array(radiance.copy())
        mended, built = tree.update(environment), Q2Tree.build(environment, count)
        assert mended.leaves == built.leaves
        assert mended.split == built.split
        np.testing.assert_array_equal(mended.flux, built.flux)
        moved += len(set(tree.leaves) - set(mended.leaves))
        tree = mended
    assert moved > 0 or count == 12


@pytest.mark.parametrize("seed", range(4))
def test_mending_ends_there_at_any_contrast(seed):
    """Dark quads beside a sun of 10⁹, whose integrals are little more than rounding of its own."""
    trees = []
    for frame in range(4):
        radiance = 10.0 ** np.random.default_rng(seed).uniform(-9.0, 0.0, (24, 48, 3))
        radiance[5 + frame, 3 * seed] = 1e9
        environment = EnvironmentMap.from_array(radiance)
        built = Q2Tree.build(environment, 240)
        trees.append(trees[-1].update(environment) if trees else built)
        assert trees[-1].leaves == built.leaves
        np.testing.assert_array_equal(trees[-1].flux, built.flux)


def test_mending_reads_hardly_more_than_the_leaves(monkeypatch):
    tree, read = Q2Tree.build(noisy_map(40, 1, SUN), 300), []
    source, sums = QuadMap.of(noisy_map(40, 1, SUN)), QuadMap.sums
    monkeypatch.setattr(
        QuadMap, "sums", lambda self, quad: (read.append(len(quad)), sums(self, quad))[1]
    )
    assert tree.mended(source).leaves == tree.leaves
    # The last split quad is read to learn that it precedes every leaf.
    assert sum(read) <= 300 + 1
    read.clear()
    Q2Tree.grown(source, 300)
    assert sum(read) == 12 + 4 * 96


def test_mending_survives_the_dark():
    lit, black = (
        noisy_map(20, sun=SUN),
        EnvironmentMap.from_array(np.zeros((20, 40, 3), np.float32)),
    )
    tree = Q2Tree.build(lit, 99)
    dark = tree.update(black)
    assert len(dark.leaves) == 12
    assert len(dark.lights()) == 0
    assert dark.update(lit).leaves == tree.leaves


def test_ties_are_broken_the_same_way_by_both():
    ones = EnvironmentMap.from_array(np.ones((32, 64, 3), np.float32))
    tree = Q2Tree.build(noisy_map(32, sun=SUN), 123)
    assert tree.update(ones).leaves == Q2Tree.build(ones, 123).leaves


def test_tolerance_keeps_more_quads_and_all_energy():
    before, after = noisy_map(40, 1, SUN), noisy_map(40, 2, SUN)
    tree = Q2Tree.build(before, 300)
    kept = []
    for tolerance in (0.0, 0.3, 0.9, 1.0):
        mended = tree.update(after, tolerance)
        np.testing.assert_allclose(mended.flux.sum(0), after.total_flux, rtol=1e-10)
        assert len(mended.leaves) == 300
        kept.append(len(set(mended.leaves) & set(tree.leaves)))
    assert kept == sorted(kept)
    assert kept[0] < kept[-1] == 300


@pytest.mark.parametrize("height", [1, 2, 5])
def test_small_maps_are_split_below_their_texels(height):
    rng = np.random.default_rng(height)
    radiance = rng.random((height, 2 * height, 3), np.float32)
    lights = make_sampler("q2-tree").prepare(EnvironmentMap.from_array(radiance), 4096, RNG)
    assert len(lights) == 4095


def test_wrong_parameters_are_errors():
    tree = Q2Tree.build(noisy_map(8, sun=SUN), 12)
    with pytest.raises(EnvlightError, match="tolerance"):
        tree.update(noisy_map(8, sun=SUN), tolerance=-1.0)
    with pytest.raises(EnvlightError, match="rows"):
        tree.update(noisy_map(9, sun=SUN))
