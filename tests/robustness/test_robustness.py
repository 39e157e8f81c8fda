"""The campaigns see what they look for, and a short one of each sees nothing."""

import ctypes
import os
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from samplers import EnvlightError, sampler_names
from tests.robustness import damaged_files, strange_maps
from tests.robustness.guarded import CRASH, FINE, HANG, MEMORY, REFUSED, TRACEBACK, Guard
from tests.robustness.mutation import mutate
from tests.robustness.sample_files import write_samples
from tests.robustness.strange_maps import MapRecipe, check
from tests.robustness.tally import FAULTS, NAN, NotFinite, Tally

SLOW = {"center-surround", "tmms", "ours"}
"""Samplers that take most of the time; the campaign has them, the quick test has not."""


def behave(how):
    match how:
        case "refuse":
            raise EnvlightError("no such map")
        case "raise":
            raise KeyError("none")
        case "exit":
            os._exit(3)
        case "crash":
            ctypes.string_at(0)
        case "hang":
            time.sleep(60.0)
        case "nan":
            raise NotFinite("one value")
        case "demand":
            np.zeros(1 << 33, np.uint8)
    return how


@pytest.fixture(scope="module")
def guard():
    with Guard(behave, seconds=2.0) as guard:
        yield guard


@pytest.mark.parametrize(
    ("how", "kind", "text"),
    [
        ("well", FINE, "well"),
        ("refuse", REFUSED, "no such map"),
        ("raise", TRACEBACK, "KeyError: 'none'"),
        ("exit", CRASH, "status 3"),
        ("crash", CRASH, "status -11"),
        ("hang", HANG, "within 2 s"),
        ("demand", TRACEBACK, "MemoryError"),
    ],
)
def test_every_end_of_a_call_is_told_apart(guard, how, kind, text):
    verdict = guard.call(how)
    assert verdict.kind == kind
    assert text in verdict.text
    assert guard.call("again").kind == FINE


def test_memory_beyond_the_limit_is_a_fault(monkeypatch):
    monkeypatch.setattr("tests.robustness.guarded.MOST_BYTES", 1 << 20)
    with Guard(behave) as guard:
        assert guard.call("well").kind == MEMORY


def test_a_result_with_nan_is_a_fault_of_its_own(guard):
    tally = Tally()
    assert tally.add(0, "exr", "a.exr", guard.call("nan")) == NAN
    assert tally.add(1, "hdr", "b.hdr", guard.call("well")) == FINE
    table = tally.table().set_index("group")
    assert table.loc["all", ["tried", FINE, NAN]].tolist() == [2, 1, 1]
    assert tally.faults == [(0, "exr", "a.exr", "nan: NotFinite: one value")]


def test_whole_samples_are_read_and_damage_is_the_same_for_a_seed(tmp_path):
    samples = write_samples(tmp_path)
    for sample in samples:
        if sample.stem in ("parts", "deep"):
            with pytest.raises(EnvlightError):
                damaged_files.read(str(sample))
        else:
            assert damaged_files.read(str(sample))
    once, again, other = (list(damaged_files.damaged(samples, 30, seed)) for seed in (0, 0, 1))
    assert once == again
    assert once != other
    assert all(content != sample.read_bytes() for sample, content in once[:3])


def test_any_bytes_can_be_damaged():
    for seed in range(300):
        assert isinstance(mutate(b"", b"", np.random.default_rng(seed)), bytes)


def test_damaged_files_are_read_or_refused(tmp_path):
    tally = damaged_files.run_campaign(tmp_path, 400, seed=7)
    table = tally.table().set_index("group").loc["all"]
    assert tally.faults == []
    assert table["tried"] == 400
    assert min(table[FINE], table[REFUSED]) > 10
    assert not table[list(FAULTS)].any()


@pytest.fixture(scope="module")
def maps_guard():
    with Guard(check, strange_maps.SECONDS) as guard:
        yield guard


@settings(
    max_examples=60, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
@given(
    recipe=st.builds(
        MapRecipe,
        st.sampled_from(strange_maps.PATTERNS),
        st.sampled_from(strange_maps.HOLES),
        st.sampled_from(strange_maps.SPIKES),
        st.sampled_from(strange_maps.CHANNELS),
        st.integers(1, strange_maps.MOST_ROWS),
        st.floats(*strange_maps.LEVELS),
        st.floats(*strange_maps.DECADES),
        st.floats(*strange_maps.SPIKE_DECADES),
        st.integers(0, 1 << 31),
    ),
    sampler=st.sampled_from([name for name in sampler_names() if name not in SLOW]),
    count=st.integers(1, 128),
)
def test_strange_maps_are_rendered_without_nan(maps_guard, recipe, sampler, count):
    verdict = maps_guard.call((recipe, sampler, count))
    assert verdict.kind == FINE, verdict.text
