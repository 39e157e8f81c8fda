"""Lightings refuse what no renderer could use, and do not change afterwards."""

import numpy as np
import pytest

from samplers import DirectionalLights, DiscLights, EnvironmentMap, EnvlightError, LayeredLights

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
        (lambda: DirectionalLights(UP, ONE + 1j, [0.0]), "irradiance is complex"),
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


def test_further_sets_have_none_of_their_own():
    one, none = DirectionalLights(UP, ONE, [0.2]), DirectionalLights.none()
    pair = DirectionalLights(UP, ONE, [0.2], (none,))
    assert one.sets == (one,) and pair.sets == (pair, none)
    with pytest.raises(EnvlightError, match="further set"):
        DirectionalLights(UP, ONE, [0.2], (one, pair))
