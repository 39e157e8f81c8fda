"""The estimate: what is added up, on costs that are made up."""

import math
import re
from dataclasses import replace

import pytest

from experiments.run import estimate as estimates
from experiments.run.budget import Budget
from experiments.run.estimate import Left, _images, _references, estimate
from experiments.run.sampler_spec import SamplerSpec

JUDGING, REFERENCE, LIGHTS, IMAGE = 6.0, 600.0, 1200.0, 60.0


@pytest.fixture
def made_up(monkeypatch):
    monkeypatch.setattr(estimates, "_judging_seconds", lambda scale: JUDGING)
    monkeypatch.setattr(estimates, "_references", lambda left: [REFERENCE / 2, 3 * REFERENCE / 2])
    monkeypatch.setattr(estimates, "_rendered", lambda one: (IMAGE * one.budget.amount, LIGHTS))


def hours(left, workers=1):
    return float(re.fullmatch(r"about ([\d.]+) hours on this machine", estimate(left, workers))[1])


def left_of(grid, *budgets):
    return Left(replace(grid, budgets=budgets).measurements(), len(grid.environments))


def test_references_and_images_are_added_up(grid, made_up):
    left = left_of(grid, Budget(8))
    seconds = len(grid.environments) * REFERENCE
    seconds += len(left.measurements) * (JUDGING + LIGHTS + 8 * IMAGE)
    # Two digits are told.
    assert hours(left) == pytest.approx(seconds / 3600, rel=0.05)
    assert hours(left, 4) == pytest.approx(seconds / 4 / 3600, rel=0.05)


def test_lights_are_made_once_for_all_scenes(grid, made_up):
    two = replace(grid, scenes=("three-boxes", "vase"), budgets=(Budget(1),)).measurements()
    seconds = len(two) * (JUDGING + IMAGE + LIGHTS / 2)
    assert hours(Left(two, 0)) == pytest.approx(seconds / 3600, rel=0.05)


def test_no_workers_share_what_is_timed(grid, made_up):
    left = Left(left_of(grid, Budget(3600.0, "seconds")).measurements, 0)
    assert hours(left, 4) == hours(left)
    least = sum(1.0 + (one.seed == 0) * 0.5 for one in left.measurements)
    assert least < hours(left) < 1.05 * least + len(left.measurements) * JUDGING / 3600


def test_nothing_is_left(grid):
    assert estimate(Left([], 0)) == "nothing is left to be measured"


def test_a_sampler_that_fails_does_not_end_the_estimate(grid, broken_sampler):
    sun = tuple(source for source in grid.environments if source.name == "sun")
    tried = replace(grid, samplers=(broken_sampler,), environments=sun).measurements()
    assert _images(tried, 0.0) == []
    specs = (SamplerSpec("median-cut"), broken_sampler)
    some = _images(replace(grid, samplers=specs, environments=sun).measurements(), 0.0)
    assert some and min(some) > 0.0


@pytest.mark.parametrize(("longest", "looked_at"), [(math.inf, 5), (0.0, 1)])
def test_references_are_looked_at_as_long_as_time_allows(longest, looked_at, grid, monkeypatch):
    monkeypatch.setattr(estimates, "LONGEST", longest)
    measurements = grid.measurements()
    found = list(_references(Left(measurements, len(grid.environments))))
    assert len(found) == looked_at and min(found) > 0.0
    assert list(_references(Left(measurements, 0))) == []
