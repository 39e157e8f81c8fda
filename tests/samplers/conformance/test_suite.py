"""The conformance suite on every registered sampler."""

import pytest

from samplers import make_sampler, sampler_names
from samplers.conformance.exceptions import EXCEPTIONS
from samplers.conformance.once import Once
from samplers.conformance.suite import CHECKS, Nonconformance, applies

SMALLER = {"cycles": {"least_width": 256}, "falcor": {"side": 128}}
"""Tables whose size does not follow the map's, made small to be quick."""


@pytest.mark.parametrize("name", sampler_names())
def test_sampler_conforms_but_for_its_exceptions(name: str) -> None:
    sampler = make_sampler(name, **SMALLER.get(name, {}))
    failed = {}
    for check in CHECKS:
        if applies(check, sampler):
            try:
                CHECKS[check](sampler)
            except Nonconformance as failure:
                failed[check] = str(failure)
    assert failed.keys() == EXCEPTIONS.get(name, {}).keys(), failed


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
