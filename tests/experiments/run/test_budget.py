"""Budgets: how they are written, and which numbers of lights meet them."""

from dataclasses import replace
from math import inf

import pytest

from experiments.run import rendering
from experiments.run.budget import MOST_LIGHTS, Budget, opening_budget, sorted_budgets
from experiments.run.counts import TOLERANCE, CountRange, count_for_rays, nearest_count
from experiments.run.measure import MeasurementTask, ReferenceTask, measure, measure_reference
from experiments.run.measurement import Grid, Measurement
from experiments.run.sampler_spec import SamplerSpec
from samplers import EnvlightError, sampler_names

GIVEN = {
    "16": Budget(16), "lights=16": Budget(16), "1": Budget(1), "rays=8": Budget(8, "rays"),
    "rays=2.5": Budget(2.5, "rays"), "seconds=0.1": Budget(0.1, "seconds"),
    "rays=median-cut:8": Budget(8, "rays", "median-cut", Budget(8)),
    "time=ours[upsampling=4]:8": Budget(8, "time", "ours[upsampling=4]", Budget(8)),
    "lights=ours@rays=4": Budget(4, "lights", "ours", Budget(4, "rays")),
    "lights=ours@rays=median-cut:8": Budget(
        8, "lights", "ours", Budget(8, "rays", "median-cut", Budget(8))
    ),
}  # fmt: skip


@pytest.mark.parametrize("text", GIVEN)
def test_budgets_are_parsed(text):
    assert Budget.parse(text) == GIVEN[text]
    assert Budget.parse(str(Budget.parse(text))) == GIVEN[text]


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        *((text, "write lights= and a whole number") for text in ("", "0", "-3", "1.5", "x")),
        *((f"lights={text}", "from 1 to") for text in ("", "0", MOST_LIGHTS + 1, "9" * 5000)),
        *((f"rays={text}", "write rays= and a number") for text in ("0", "-1", "nan", "inf", "x")),
        *((f"seconds={text}", "write seconds= and") for text in ("0", "nan", "1e9", "")),
        ("hours=4", "write lights=K, rays=R or rays=SAMPLER:K, seconds=T, time=SAMPLER:K"),
        ("time=4", "write time=SAMPLER:K"),
        ("seconds=mis:4", "write seconds= and a number"),
        ("time=median-cut:0", "budget '0': write lights= and a whole number"),
        ("time=median-cut:x", "budget 'x'"),
        ("lights=ours:8", "write rays=R or rays=SAMPLER:K behind the sampler"),
        ("time=ours@rays=8", "write lights=K behind the sampler"),
    ],
)
def test_impossible_budgets_are_named(text, answer):
    with pytest.raises(EnvlightError, match=answer):
        Budget.parse(text)


def test_what_takes_numbers_of_lights_refuses_others():
    with pytest.raises(EnvlightError, match="budget 'rays=8': only numbers of lights"):
        _ = Budget.parse("rays=8").lights


def test_budgets_are_sorted_by_kind_and_size():
    texts = [
        "time=mis:16", "rays=mis:4", "seconds=0.5", "rays=8", "lights=16", "seconds=0.05",
        "time=mis:8", "lights=8", "rays=10",
    ]  # fmt: skip
    assert sorted_budgets(texts) == [
        "lights=8", "lights=16", "rays=8", "rays=10", "rays=mis:4", "seconds=0.05", "seconds=0.5",
        "time=mis:8", "time=mis:16",
    ]  # fmt: skip


@pytest.mark.parametrize("start", [1, 7, 400])
@pytest.mark.parametrize("target", [0.0, 3.4, 3.6, 90.0, inf])
def test_the_search_finds_the_nearest_count(start, target):
    allowed = CountRange(2, 100)
    costs = {count: 0.7 * count + 0.1 * (count % 3) for count in range(2, 101)}
    best = min(costs, key=lambda count: (abs(costs[count] - min(target, 1e9)), count))
    assert nearest_count(costs.__getitem__, min(target, 1e9), allowed, start) == best


def test_a_cost_that_stops_growing_ends_the_search_at_the_smallest_such_count():
    asked = []

    def cost(count):
        asked.append(count)
        return min(count, 5.0)

    found = nearest_count(cost, 20.0, CountRange(1, 1280), 20.0)
    assert cost(found) == 5.0
    assert found == asked[0] and len(asked) < 10


def test_the_whole_view_corrects_the_small_one():
    # The small view sees a tenth more rays than there are: 30 rays are at count 30, not 27.
    assert count_for_rays(30.0, CountRange(1, 999), lambda n: 1.1 * n, float) == 30


@pytest.fixture
def task_for(grid: Grid, tmp_path):
    """The task of a sampler at a budget on the noisy map."""
    case = next(c.case for c in grid.measurements() if c.case.environment.name == "other")
    case = replace(case, scale=replace(case.scale, width=64, height=48))
    row = measure_reference(ReferenceTask(case, str(tmp_path)))

    def make(name: str, budget: Budget, seed: int = 0) -> MeasurementTask:
        measurement = Measurement(case, SamplerSpec(name), budget, seed)
        return MeasurementTask(measurement, str(tmp_path), row["noise_floor"], False, ())

    return make


@pytest.mark.parametrize("name", sampler_names())
def test_rays_are_met_as_well_as_whole_numbers_of_lights_can(task_for, name):
    task = task_for(name, Budget(12.0, "rays"))
    row = measure(task).image
    assert row["rays"] == (row["rays_shadow"] + row["rays_brdf"]) / row["rays_primary"]
    if abs(row["rays"] - 12.0) <= TOLERANCE * 12.0:
        return
    scene = rendering.CaseScene.of(task.measurement.case)
    least = task.measurement.sampler.sampler.minimum_count
    if row["over_budget"]:
        assert row["count"] == least and row["rays"] > 12.0
        return
    # Otherwise a light more or less (as few change anything) is no better, or nothing helps at all.
    step = 1 if row["rays"] < 12.0 else -1
    for count in (row["count"] + step, row["count"] + 2 * step):
        if count >= least:
            other = scene.shoot(task.measurement, count).rays
            assert abs(other - 12.0) >= abs(row["rays"] - 12.0) - TOLERANCE * 12.0


def test_a_budget_is_what_a_sampler_spends_in_the_case(task_for):
    like = measure(task_for("median-cut", Budget(8))).image
    rays = Budget.parse("rays=median-cut:8")
    own = measure(task_for("median-cut", rays)).image
    assert own["count"] == 8 and own["rays"] == own["allowed"] == like["rays"]
    ours = measure(task_for("ours", rays)).image
    assert ours["allowed"] == like["rays"] and ours["budget"] == "rays=median-cut:8"
    absolute = measure(task_for("ours", Budget(like["rays"], "rays"))).image
    assert (ours["count"], ours["rays"]) == (absolute["count"], absolute["rays"])
    shared = Budget.parse("lights=ours@rays=median-cut:8")
    row = measure(task_for("ours-no-upsampling", shared)).image
    assert row["count"] == row["allowed"] == ours["count"] and row["rays"] > ours["rays"]


def test_what_a_budget_is_like_determines_the_image(task_for):
    keys = {
        task_for("mis", Budget.parse(text)).measurement.key
        for text in ("rays=median-cut:8", "rays=median-cut:9", "rays=mis:8")
    }
    assert len(keys) == 3


def test_what_cannot_be_met_is_marked(task_for):
    row = measure(task_for("q2-tree", Budget(0.5, "rays"))).image
    assert row["over_budget"] and row["count"] == 12 and row["rays"] > 0.5
    assert not measure(task_for("uniform", Budget(5.0, "rays"))).image["over_budget"]


def test_only_timed_measurements_depend_on_the_machine(measurements_of, monkeypatch):
    measurement = measurements_of(("noise",))[0]
    programs = {str(b): replace(measurement, budget=b).identity["program"] for b in GIVEN.values()}
    machine = {name: "machine" in program.value for name, program in programs.items()}
    assert machine == {str(b): b.timed for b in GIVEN.values()}


def test_a_report_opens_with_the_budget_of_most_rows():
    assert opening_budget(["lights=12", "rays=4", "rays=4"]) == "rays=4"
    assert opening_budget(["rays=4", "rays=4", "lights=16"]) == "lights=16"
