"""The tables of today's renderers: unbiased beside their own densities, compensated on demand."""

import math

import numpy as np
import pytest

from samplers import EnvironmentMap, make_sampler
from samplers.conformance.stress_maps import stress_map
from samplers.grids.octahedral import direction_to_square, octahedral_means, square_to_direction
from samplers.sphere import pixel_of_direction

SMALL = {
    "cycles": {"least_width": 256},
    "falcor": {"side": 128},
    "luxcore": {},
    "mitsuba-3": {},
    "pbrt-v4": {},
}
"""Each renderer with a table that is quick to make."""
SHIPS_COMPENSATED = {"pbrt-v4"}
UNIFORM = 1.0 / (4.0 * math.pi)


def distribution(name, environment, **parameters):
    sampler = make_sampler(name, **{**SMALL[name], **parameters})
    return sampler.prepare(environment, 16, np.random.default_rng(0))


def numbers(count=1 << 14, seed=3):
    return np.random.default_rng(seed).random((count, 3), np.float32)


def noise(height=24, seed=0):
    rng = np.random.default_rng(seed)
    radiance = np.exp(1.5 * rng.normal(size=(height, 2 * height, 3)))
    radiance[height // 4, 7] *= 300.0
    return EnvironmentMap.from_array(radiance)


@pytest.mark.parametrize("name", SMALL)
def test_compensation_empties_what_is_dim(name):
    environment = noise()
    whole = distribution(name, environment, compensation=False)
    rest = distribution(name, environment, compensation=True)
    shipped = distribution(name, environment)
    direction, _ = distribution("luxcore", stress_map("black")).sample(numbers())
    before, after, default = (d.pdf(direction) for d in (whole, rest, shipped))
    np.testing.assert_array_equal(default, after if name in SHIPS_COMPENSATED else before)
    dim = before < 0.5 * UNIFORM
    assert dim.mean() > 0.2
    assert (after[dim] == 0.0).mean() > 0.6  # a bilinear density has skirts
    assert after[dim].mean() < 0.2 * before[dim].mean()
    sun, _ = whole.sample(numbers(64))
    bright = whole.pdf(sun) > 20.0 * UNIFORM
    assert (rest.pdf(sun)[bright] > whole.pdf(sun)[bright]).all()


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("compensation", [True, False])
def test_a_constant_map_keeps_its_density(name, compensation):
    found = distribution(name, stress_map("constant"), compensation=compensation)
    direction, pdf = found.sample(numbers())
    np.testing.assert_array_equal(found.pdf(direction) > 0.0, True)
    wanted = np.full(len(pdf), UNIFORM)
    if name == "luxcore":  # rows all alike: 1 / (2π² sin θ)
        wanted = 1.0 / (2.0 * math.pi**2 * np.hypot(direction[:, 0], direction[:, 2]))
    row = pixel_of_direction(direction, 16)[0]
    inner = (row > 1) & (row < 14)  # sines at a row's centre or edge differ near the poles
    # Half a row of 11° at the third row from a pole: the sine at its centre is off by up to 28 %,
    # less in finer tables.
    np.testing.assert_allclose(pdf[inner], wanted[inner], rtol=0.3 if name == "mitsuba-3" else 0.05)


@pytest.mark.parametrize("name", SMALL)
def test_what_tables_cost_is_told(name):
    small, large = (distribution(name, noise(height)) for height in (8, 24))
    assert small.nbytes > 0 and small.map_reads > 0
    if "side" in SMALL[name] or "least_width" in SMALL[name]:
        assert (small.nbytes, small.map_reads) == (large.nbytes, large.map_reads)
    else:
        assert large.map_reads == 9 * small.map_reads
        assert large.nbytes > 6 * small.nbytes


def test_the_square_and_the_sphere_are_one_to_one():
    u = np.concatenate([np.random.default_rng(1).random((4000, 2)), [[0.5, 0.5], [0.0, 1.0]]])
    direction = np.empty((len(u), 3))
    for place, out in zip(u, direction, strict=True):
        square_to_direction(place[0], place[1], out)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-11)
    back = np.array([direction_to_square(*way) for way in direction[:-1]])
    # `turns` is good to 1e-11.
    np.testing.assert_allclose(back, u[:-1], atol=1e-9)
    assert direction[-2] == pytest.approx([0.0, 1.0, 0.0])
    assert direction[-1] == pytest.approx([0.0, -1.0, 0.0])


def test_means_over_the_square_are_look_ups_in_the_map():
    environment, side, parts = noise(13), 10, 4
    found = octahedral_means(environment.luminance, side, parts)
    wanted, way = np.zeros((side, side)), np.empty(3)
    for i in range(side * parts):
        for j in range(side * parts):
            square_to_direction((j + 0.5) / (side * parts), (i + 0.5) / (side * parts), way)
            texel = pixel_of_direction(way, 13)
            wanted[i // parts, j // parts] += environment.luminance[texel] / parts**2
    # Places on an edge between two texels may round to either. 26 columns have few such places.
    assert np.isclose(found, wanted, rtol=1e-12).mean() > 0.9
    assert found.mean() == pytest.approx(wanted.mean(), rel=0.02)
