"""The conformance suite on every registered sampler."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from experiments.questions.readings import every_reading
from experiments.run.sampler_spec import SamplerSpec
from samplers import DirectionalLights, EnvironmentMap, LightSampler, make_sampler, sampler_names
from samplers.conformance import suite
from samplers.conformance.exceptions import EXCEPTIONS
from samplers.conformance.once import Once
from samplers.conformance.stress_maps import SHAPES, STRESS_MAPS
from samplers.conformance.suite import CHECKS, Nonconformance, applies
from samplers.grids.regions import lights_of_regions
from samplers.grids.tabulated import TabulatedDistribution
from tests.samplers.test_fixed_lights import PERTURBED

SMALLER = {"cycles": {"least_width": 256}, "falcor": {"side": 128}}
"""Tables whose size does not follow the map's, made small to be quick."""


def failures(sampler: LightSampler, checks: Iterable[str]) -> dict[str, str]:
    failed = {}
    for check in checks:
        if applies(check, sampler):
            try:
                CHECKS[check](sampler)
            except Nonconformance as failure:
                failed[check] = str(failure)
    return failed


@pytest.mark.parametrize("name", sampler_names())
def test_sampler_conforms_but_for_its_exceptions(name: str) -> None:
    failed = failures(make_sampler(name, **SMALLER.get(name, {})), CHECKS)
    assert failed.keys() == EXCEPTIONS.get(name, {}).keys(), failed


UNFIT: dict[str, set[str]] = {
    "kd-tree[pdf_form=paper-continuous]": {"lighting", "pdf-of-samples"},
    "kd-tree[pdf_form=paper-integer]": {"pdf-integral", "chi-square"},
}
"""Readings that are published, and wrong: `kd_tree/test_kd_tree.py` says how."""


@pytest.mark.parametrize(
    "spec",
    [
        *(
            one.spec
            for one in every_reading()
            if one.sampler not in PERTURBED and one.spec.parameters
        ),
        *(
            SamplerSpec("kd-tree", (("pdf_form", form), ("placement", "angles")))
            for form in ("exact", "walk")
        ),
    ],
    ids=lambda spec: spec.label,
)
def test_every_reading_conforms(spec: SamplerSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a few maps; those of fixed lights have tests of their own."""
    few = {name: STRESS_MAPS[name] for name in ("noise", "odd-height", "contrast-1e3")}
    monkeypatch.setattr(suite, "STRESS_MAPS", few)
    monkeypatch.setattr(suite, "COUNTS", (2, 64))
    sampler = make_sampler(spec.name, **dict(spec.parameters))
    slow = {"determinism", "rotation", "scale-invariance", "surface-mean"}
    failed = failures(sampler, CHECKS.keys() - slow)
    assert failed.keys() == UNFIT.get(spec.label, set()), failed


def test_exceptions_name_samplers_that_exist() -> None:
    assert set(EXCEPTIONS) <= set(sampler_names())


def test_each_sampler_has_results_of_its_own() -> None:
    once, made = Once(), []

    def of(sampler: object, key: str) -> object:
        return once(sampler, key, lambda: made.append(key) or object())

    one, other = [], []  # equal, and without a hash
    first = of(one, "a")
    assert of(one, "a") is first
    assert of(one, "b") is not first
    assert of(other, "a") is not first
    assert made == ["a", "b", "a"]


@dataclass(frozen=True)
class Bands(LightSampler):
    """Rings from pole to pole, each with its light in its middle."""

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        edge = np.unique(np.linspace(0, environment.height, count + 1).astype(int))
        width = np.full(len(edge) - 1, environment.width)
        region = np.stack([edge[:-1], np.zeros_like(width), edge[1:], width], axis=1)
        return lights_of_regions(environment, region)


@pytest.mark.parametrize("shape", ["constant", "ring", "rings"])
def test_lights_in_the_middle_of_rings_are_told(shape, monkeypatch) -> None:
    sampler = Bands()
    CHECKS["energy"](sampler)
    monkeypatch.setattr(suite, "SHAPES", {shape: SHAPES[shape]})
    with pytest.raises(Nonconformance, match=f"{shape}, 16 lights: a plane's irradiance is off"):
        CHECKS["irradiance"](sampler)


def test_tmms_without_a_limit_to_its_regions_is_told() -> None:
    with pytest.raises(Nonconformance, match="constant, 16 lights"):
        CHECKS["irradiance"](make_sampler("tmms", widest=None))


def test_fewer_lights_than_asked_for_are_no_failure_but_a_sentence() -> None:
    said = CHECKS["irradiance"](make_sampler("uniform"))
    assert said == "fewer than asked for: 2 lights of 16 on smallest; 2 lights of 64 on smallest"


COMPENSATED = {
    "mis-compensated": {}, "pbrt-v4": {}, "cycles": {"compensation": True, "least_width": 256},
    "falcor": {"compensation": True, "side": 128}, "luxcore": {"compensation": True},
    "mitsuba-3": {"compensation": True},
}  # fmt: skip


@pytest.mark.parametrize("name", COMPENSATED)
def test_a_compensated_density_takes_a_brdf_sample(name: str) -> None:
    sampler = make_sampler(name, **COMPENSATED[name])
    assert sampler.minimum_count == 2
    CHECKS["surface-mean"](sampler)


def test_samples_other_than_the_tables_are_told() -> None:
    @dataclass(frozen=True, eq=False)
    class Turned(TabulatedDistribution):
        def sample(self, u):
            return super().sample(u[:, ::-1].copy())

    class Mis(type(make_sampler("mis"))):
        def _prepare(self, environment, count, rng):
            return Turned(**vars(super()._prepare(environment, count, rng)))

    with pytest.raises(Nonconformance, match="than its table does"):
        CHECKS["lighting"](dataclass(frozen=True)(Mis)())


def test_a_density_that_leaves_light_out_is_told_at_one_sample() -> None:
    class Alone(type(make_sampler("mis-compensated"))):
        minimum_count: ClassVar[int] = 1

    with pytest.raises(Nonconformance, match="noise, 1 samples"):
        CHECKS["surface-mean"](Alone())
