"""What compiles kernels before a run is done once, and fails in silence."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from experiments.run import warm_up as module
from experiments.run.executors import SerialExecutor
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.warm_up import LEAST_SAMPLERS, warm_up
from samplers import LightSampler, register
from samplers.base import REGISTERED

NAMES = ("uniform", "median-cut", "variance-minimization", "mis")


class InThisProcess(SerialExecutor):
    """Notes what it is given."""

    given: ClassVar[list] = []

    def __init__(self, slots, threads): ...

    def submit(self, fn, /, *args, **kwargs):
        function, arguments = args
        self.given += [(function.__name__, argument) for argument in arguments]
        return super().submit(fn, *args, **kwargs)


@pytest.fixture
def given(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "ProcessExecutor", InThisProcess)
    monkeypatch.setattr(module.kernel_cache, "folder", lambda: tmp_path)
    monkeypatch.setattr(module, "core_count", lambda: 2)
    InThisProcess.given.clear()
    return InThisProcess.given


def specs(*names):
    return [SamplerSpec(name) for name in names]


def test_every_sampler_prepares_and_is_rendered(given):
    warm_up(specs(*NAMES), None)
    prepared = [one[1][0].name for one in given if one[0] == "_lights"]
    rendered = [one[1][0].name for one in given if one[0] == "_rendering"]
    assert prepared == list(NAMES)
    assert rendered == list(NAMES)
    assert [one[0] for one in given[:2]] == ["_reference", "_judging"]


def test_it_is_done_once_and_for_new_samplers_alone(given):
    warm_up(specs(*NAMES), None)
    done = len(given)
    warm_up(specs(*reversed(NAMES)), None)
    assert len(given) == done
    others = ("kollig-keller", "structured", "q2-tree", "fhis")
    warm_up(specs(*NAMES, *others), None)
    assert [one[1][0].name for one in given[done:] if one[0] == "_lights"] == list(others)


def test_a_few_samplers_are_not_worth_it(given):
    warm_up(specs(*NAMES[: LEAST_SAMPLERS - 1]), None)
    assert given == []


def test_a_sampler_that_fails_is_left_to_the_run(given):
    @register("broken")
    @dataclass(frozen=True)
    class Broken(LightSampler):
        """Raises."""

        def _prepare(self, environment, count, rng):
            raise ZeroDivisionError("no")

    try:
        warm_up(specs("broken", *NAMES), None)
        assert ("_rendering", (SamplerSpec("mis"), 0.0)) in given
    finally:
        del REGISTERED["broken"]
