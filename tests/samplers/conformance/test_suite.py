"""The conformance suite on every registered sampler."""

import pytest

from samplers import LightSampler, make_sampler, sampler_names
from samplers.conformance.exceptions import EXCEPTIONS
from samplers.conformance.suite import CHECKS, Nonconformance, applies

SMALLER = {"cycles": {"least_width": 256}, "falcor": {"side": 128}}
"""Tables whose size does not follow the map's, made small to be quick."""


def made(name: str) -> LightSampler:
    return make_sampler(name, **SMALLER.get(name, {}))


CASES = [
    (name, check) for name in sampler_names() for check in CHECKS if applies(check, made(name))
]


@pytest.mark.parametrize(("name", "check"), CASES, ids=[f"{n}-{c}" for n, c in CASES])
def test_sampler_conforms(name: str, check: str) -> None:
    reason = EXCEPTIONS.get(name, {}).get(check)
    if reason is None:
        CHECKS[check](made(name))
        return
    with pytest.raises(Nonconformance):
        CHECKS[check](made(name))
    pytest.xfail(reason)


def test_exceptions_name_what_exists() -> None:
    for name, checks in EXCEPTIONS.items():
        assert name in sampler_names()
        assert set(checks) <= set(CHECKS)
