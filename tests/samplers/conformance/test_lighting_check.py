"""A sampler that breaks its promises is caught by the conformance suite and by each run."""

from dataclasses import dataclass

import numpy as np
import pytest

from samplers import DirectionalLights, EnvlightError, LightSampler, make_sampler, sampler_names
from samplers.conformance.lighting_check import check_lighting
from samplers.conformance.stress_maps import STRESS_MAPS, stress_map
from samplers.lighting import LayeredLights
from tests.samplers.conformance.test_suite import SMALLER

FOUR_PI = 4.0 * np.pi


def prepared(sampler, environment, count):
    return sampler.prepare(environment, max(count, sampler.minimum_count), np.random.default_rng(0))


@pytest.mark.parametrize("name", sampler_names())
def test_what_the_samplers_return_passes(name):
    sampler = make_sampler(name, **SMALLER.get(name, {}))
    for map_name in STRESS_MAPS:
        environment = stress_map(map_name)
        count = max(16, sampler.minimum_count)
        check_lighting(prepared(sampler, environment, count), environment, count)


def lights(direction=(0.0, 1.0, 0.0), irradiance=(1.0, 1.0, 1.0), number=1):
    return DirectionalLights([direction] * number, [irradiance] * number, [0.0] * number)


@dataclass(frozen=True)
class Uniform:
    """The uniform density, and ways to get it wrong."""

    count: int = 4
    fault: str = ""

    def sample(self, u):
        z = 1.0 - 2.0 * u[:, 0]
        r, phi = np.sqrt(np.maximum(0.0, 1.0 - z * z)), 2.0 * np.pi * u[:, 1]
        direction = np.stack([r * np.cos(phi), z, r * np.sin(phi)], axis=1)
        pdf = np.full(len(u), 1.0 / FOUR_PI, np.float32)
        match self.fault:
            case "flat":
                return direction.reshape(-1), pdf
            case "column":
                return direction, pdf[:, None]
            case "alone":
                return direction
            case "nan direction":
                direction[7] = np.nan
            case "no length":
                direction[7] = 0.0
            case "nan density":
                pdf[7] = np.nan
            case "no density":
                pdf[7] = 0.0
            case "disagree" | "scaled":
                pdf *= 2.0
        return direction.astype(np.float32), pdf

    def pdf(self, direction):
        values = np.full(len(direction), 1.0 / FOUR_PI, np.float32)
        match self.fault:
            case "scaled":
                values *= 2.0
            case "half a sphere":
                values[direction[:, 1] < 0.0] = 0.0
            case "negative":
                values[direction[:, 1] < -0.9] = -1.0
            case "nan":
                values[direction[:, 1] < -0.9] = np.nan
            case "scalar":
                return values[0]
        return values


FAULTS = {
    "raises": (lambda count: 1 / 0, "division by zero"),
    "nothing": (lambda count: None, "returned NoneType; wanted"),
    "array": (lambda count: np.zeros((4, 3)), "returned ndarray; wanted"),
    "too many": (lambda count: lights(number=count + 1), "lights or samples for a budget of"),
    "half a sample": (lambda count: Uniform(2.5), "2.5 lights or samples for a budget of"),
    "below zero": (lambda count: Uniform(-3), "-3 lights or samples for a budget of"),
    "layer": (lambda count: LayeredLights(lights(), None), "a layer is not DirectionalLights"),
    "flat": (None, "directions of sample() have shape"),
    "column": (None, "densities of sample() have shape"),
    "alone": (None, "must return directions and densities"),
    "nan direction": (None, "not of unit length"),
    "no length": (None, "not of unit length"),
    "nan density": (None, "not a positive number"),
    "no density": (None, "not a positive number"),
    "disagree": (None, "disagrees with the densities"),
    "scaled": (None, "integrates to 2 instead of 1"),
    "half a sphere": (None, "disagrees with the densities"),
    "negative": (None, "pdf()"),
    "nan": (None, "pdf()"),
    "scalar": (None, "densities of pdf() have shape ()"),
}  # fmt: skip


@dataclass(frozen=True)
class Faulty(LightSampler):
    """A sampler with one fault."""

    fault: str = ""

    def _prepare(self, environment, count, rng):
        make, _ = FAULTS[self.fault]
        return make(count) if make else Uniform(count, self.fault)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_caught_when_a_lighting_is_measured(fault):
    environment = stress_map("noise")
    with pytest.raises((EnvlightError, ZeroDivisionError)) as caught:
        check_lighting(prepared(Faulty(fault), environment, 16), environment, 16)
    assert FAULTS[fault][1] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_right_passes_and_the_budget_counts():
    environment = stress_map("noise")
    check_lighting(Uniform(4), environment, 4)
    with pytest.raises(EnvlightError, match="4 lights or samples for a budget of 3"):
        check_lighting(Uniform(4), environment, 3)
