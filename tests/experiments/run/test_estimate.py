"""The estimate: what is added up, on costs that are made up."""

import math
import re
from dataclasses import replace

import pytest

from experiments.run import estimate as estimates
from experiments.run.budget import Budget
from experiments.run.counts import CostLine
from experiments.run.estimate import (
    Cost,
    Left,
    _by_scene,
    _images,
    _references,
    _spread,
    estimate,
    line_of,
    seconds_by_kind,
)
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.timed import ENOUGH_SECONDS, ROUNDS

LINE = CostLine(0.2, 0.1)
JUDGING, REFERENCE = 3.0, 100.0
REFERENCES = [REFERENCE - 50.0, REFERENCE + 50.0]
IMAGES = 2 * [dict.fromkeys(("median-cut", "mis", "uniform"), Cost(1.0, LINE, 0.5))]
PER_CASE = 5
"""Measurements of three samplers, of which one has three seeds."""


def by_kind(grid, *budgets):
    measurements = replace(grid, budgets=budgets).measurements()
    return seconds_by_kind(Left(measurements, len(grid.environments)), JUDGING, REFERENCES, IMAGES)


def test_references_and_images_by_lights_are_added_up(grid):
    cases = len(grid.environments)
    found = by_kind(grid, Budget(8), Budget(16))
    assert found["references"] == pytest.approx(cases * REFERENCE)
    images = (JUDGING + 1.0 + LINE.seconds(8)) + (JUDGING + 1.0 + LINE.seconds(16))
    assert found["lights"] == pytest.approx(cases * PER_CASE * images)
    assert set(found) == {"references", "lights"}


@pytest.mark.parametrize("costs", [{8: 1.0, 40: 2.0}, {8: 0.01, 40: 2.0}, {8: 2.0, 40: 1.0}])
def test_no_count_takes_less_than_nothing(costs):
    line = line_of(costs)
    assert line.seconds(0) >= 0.0 and line.per_light >= 0.0
    assert line.seconds(40) in costs.values()


def test_lights_are_made_once_for_all_scenes(grid):
    one = by_kind(grid, Budget(8))["lights"]
    two = by_kind(replace(grid, scenes=("three-boxes", "vase")), Budget(8))["lights"]
    assert 2 * one - two == pytest.approx(len(grid.environments) * PER_CASE * 1.0)


def test_rays_take_the_lights_that_trace_them(grid):
    few, many = (by_kind(grid, Budget(rays, "rays"))["rays"] for rays in (4.0, 8.0))
    images = len(grid.environments) * PER_CASE
    # A light traces half a ray: 8 lights more, each rendered at least once.
    assert many - few >= images * 8 * LINE.per_light * (1 - 1e-9)


def test_what_traces_no_rays_has_as_many_lights_as_the_budget_rays(grid):
    one = replace(grid, budgets=(Budget(4.0, "rays"),)).measurements()[0]
    without, with_one = (Cost(0.0, LINE, rays).seconds(one, 1) for rays in (0.0, 1.0))
    assert without == with_one


def test_seconds_take_their_time_and_some_probes(grid):
    images = len(grid.environments) * PER_CASE
    found = by_kind(grid, Budget(4.0, "seconds"))["seconds"] / images
    assert JUDGING + 1.0 + 4.0 < found < JUDGING + 4 * 1.0 + 2 * 4.0
    short = by_kind(grid, Budget(0.3, "seconds"))["seconds"] / images
    # Images of 0.3 s are rendered twice, until half a second is over.
    assert short > JUDGING + 1.0 + ENOUGH_SECONDS
    assert by_kind(grid, Budget(0.3, "seconds"))["seconds"] < images * (JUDGING + 3 + 3 * ROUNDS)


def test_cases_go_through_scenes_and_maps(grid):
    wide = replace(grid, scenes=("vase", "teapot", "birdcage"))
    spread = _spread(_by_scene(wide.measurements()))
    assert {case.scene for case in spread[:3]} == set(wide.scenes)
    assert len(set(spread)) == len(spread) == 3 * len(grid.environments)
    # Any few in a row are of different maps.
    assert len({case.environment for case in spread[:3]}) == 3


def test_only_what_is_left_is_added_up(grid):
    measurements = grid.measurements()
    some = seconds_by_kind(Left(measurements[:2], 0), JUDGING, [], IMAGES)
    assert some == {"references": 0.0, "lights": pytest.approx(2 * (JUDGING + 1.0 + 0.2 + 0.4))}
    assert _spread(_by_scene(measurements[:2])) == [measurements[0].case]
    assert estimate(Left([], 0)) == "nothing is left to be measured"


def test_workers_share_all_but_what_is_timed(grid, monkeypatch):
    budgets = Budget(8), Budget(4.0, "rays"), Budget(30.0, "seconds")
    measurements = replace(grid, budgets=budgets).measurements()
    left = Left(measurements, len(grid.environments))
    monkeypatch.setattr(estimates, "_judging_seconds", lambda scale: JUDGING)
    monkeypatch.setattr(estimates, "_references", lambda left: REFERENCES)
    monkeypatch.setattr(estimates, "_images", lambda left: IMAGES)

    def minutes(workers):
        found = re.findall(r"(\w+) ([\d.]+) minutes", estimate(left, workers).split("(")[1])
        return {kind: float(value) for kind, value in found if kind != "or"}

    one, four = minutes(1), minutes(4)
    assert set(one) == {"references", "lights", "rays", "seconds"} == set(four)
    for kind, value in one.items():
        # Two digits are told.
        assert four[kind] == pytest.approx(value / (1 if kind == "seconds" else 4), rel=0.11)


def test_a_sampler_that_fails_takes_no_time_where_it_does(grid):
    measurements = [one for one in grid.measurements() if one.sampler.label == "mis"]
    left = Left(measurements, 0)
    whole = seconds_by_kind(left, JUDGING, [], IMAGES)
    assert seconds_by_kind(left, JUDGING, [], [IMAGES[0], {}]) == whole
    assert seconds_by_kind(left, JUDGING, [], [{}])["lights"] == 0.0


def test_a_sampler_that_fails_does_not_end_the_estimate(grid, broken_sampler):
    specs = (SamplerSpec("median-cut"), broken_sampler)
    sun = tuple(source for source in grid.environments if source.name == "sun")
    tried = replace(grid, samplers=specs, environments=sun).measurements()
    (costs,) = _images(Left(tried, 0))
    assert set(costs) == {"median-cut"}


@pytest.mark.parametrize(("longest", "looked_at"), [(math.inf, 5), (0.0, 1)])
def test_references_are_looked_at_in_every_case_that_time_allows(
    longest, looked_at, grid, monkeypatch
):
    monkeypatch.setattr(estimates, "LONGEST", longest)
    measurements = grid.measurements()
    found = list(_references(Left(measurements, len(grid.environments))))
    assert len(found) == looked_at and min(found) > 0.0  # one of each scene, or all of its maps
    assert list(_references(Left(measurements, 0))) == []
