"""Lightings refuse what no renderer could use, and do not change afterwards."""

from dataclasses import fields

import numpy as np
import pytest

from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    EnvlightError,
    LayeredLights,
    LightDistribution,
    make_sampler,
    sampler_class,
    sampler_names,
)
from samplers.conformance.stress_maps import stress_map
from samplers.conformance.suite import parts_of
from samplers.lighting import LIGHT_EXTENT

UP = np.array([[0.0, 1.0, 0.0]])
ONE = np.ones((1, 3))
MAP = EnvironmentMap.from_array(np.ones((2, 4, 3)))


def disc(**changes):
    values = {"direction": UP, "irradiance": ONE, "half_angle": [0.1], "ambient": MAP}
    return DiscLights(**(values | changes))


@pytest.mark.parametrize(
    ("lights", "sentence"),
    [
        (
            lambda: DirectionalLights(UP[0], ONE, [0.0]),
            r"direction has shape \(3,\), wanted \(n, 3\)",
        ),
        (lambda: DirectionalLights(UP, np.ones((1, 4)), [0.0]), "irradiance has shape"),
        (
            lambda: DirectionalLights(UP, np.ones((2, 3)), [0.0]),
            "1 directions, 2 irradiances and 1",
        ),
        (lambda: DirectionalLights(2.0 * UP, ONE, [0.0]), "not of unit length"),
        (lambda: DirectionalLights(UP, -ONE, [0.0]), "negative irradiance"),
        (lambda: DirectionalLights(UP, ONE * np.nan, [0.0]), "irradiance holds NaN or infinity"),
        (lambda: DirectionalLights(UP, ONE, [np.inf]), "extent holds NaN or infinity"),
        (lambda: DirectionalLights(UP, ONE, [-0.1]), "negative extent"),
        (lambda: disc(half_angle=[0.0]), "half_angle lies outside"),
        (lambda: disc(half_angle=[1.6]), "half_angle lies outside"),
        (lambda: disc(rays_per_light=0), "rays_per_light"),
        (
            lambda: LayeredLights(DirectionalLights.none(), DirectionalLights.none(), 0),
            "use 1 or more",
        ),
    ],
)
def test_unusable_lights_are_named(lights, sentence):
    with pytest.raises(EnvlightError, match=f"lighting: .*{sentence}"):
        lights()


def test_lights_are_read_only_float64():
    lights = DirectionalLights(UP.astype(np.float32), ONE.astype(np.float32), [0.0])
    for array in (lights.direction, lights.irradiance, lights.extent):
        assert array.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_lights_do_not_freeze_or_follow_their_maker():
    irradiance = ONE.copy()
    lights = DirectionalLights(UP, irradiance, np.zeros(1))
    irradiance[:] = 7.0
    np.testing.assert_array_equal(lights.irradiance, ONE)


def test_no_light_is_a_set_of_none():
    assert len(DirectionalLights.none()) == 0


def test_further_sets_have_none_of_their_own():
    one, none = DirectionalLights(UP, ONE, [0.2]), DirectionalLights.none()
    pair = DirectionalLights(UP, ONE, [0.2], (none,))
    assert one.sets == (one,) and pair.sets == (pair, none)
    with pytest.raises(EnvlightError, match="further set"):
        DirectionalLights(UP, ONE, [0.2], (one, pair))


PERTURBED = [
    name
    for name in sampler_names()
    if "light_extent" in {field.name for field in fields(sampler_class(name))}
]


def test_all_sets_of_lights_are_perturbed_by_one_rule():
    fixed = [
        name
        for name in sampler_names()
        if isinstance(
            make_sampler(name).prepare(stress_map("noise"), 16, np.random.default_rng(0)),
            DirectionalLights | LayeredLights,
        )
    ]
    assert fixed == PERTURBED
    assert {make_sampler(name).light_extent for name in PERTURBED} == {LIGHT_EXTENT}


@pytest.mark.parametrize("name", PERTURBED)
def test_a_full_extent_is_twice_the_largest_and_a_mean_is_less(name):
    extent = {}
    # Another measure of a node gives "ours" another cut; with one light of a kind there is none.
    count = 2 if name.startswith("ours") else 16
    for which in ("mean", "largest", "full"):
        sampler = make_sampler(name, light_extent=which)
        lighting = sampler.prepare(stress_map("noise"), count, np.random.default_rng(0))
        extent[which] = np.concatenate([part for _, _, part in parts_of(lighting)])
    np.testing.assert_array_equal(extent["full"], 2.0 * extent["largest"])
    assert (extent["mean"] <= extent["largest"]).all()
    assert (extent["mean"] < extent["largest"]).any()


def test_distributions_and_sets_are_told_apart():
    rng = np.random.default_rng(0)
    assert isinstance(make_sampler("mis").prepare(MAP, 4, rng), LightDistribution)
    assert not isinstance(DirectionalLights.none(), LightDistribution)
