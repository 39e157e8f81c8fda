"""Budgets of seconds, on a machine whose times are made up, and stored from a real one."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.progress import Told
from experiments.run import machine, timed
from experiments.run.budget import Budget
from experiments.run.measurement import Measurement
from experiments.run.rendering import Shot, peak_memory_mib
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import IMAGE, Store
from experiments.run.timed import (
    ENOUGH_SECONDS,
    ROUNDS,
    TimedShot,
    alone_on_the_machine,
    time_at_budget,
)
from renderer.render import Rendering
from samplers import EnvlightError
from tests.experiments.stored import run_measurements


class Machine:
    """Renders nothing, and says how long that took.

    cost : seconds of a sampler's image by count; rendered : (sampler, seed, count), all images"""

    def __init__(self, cost):
        self.cost, self.rendered, self.view = cost, [], self

    def render(self, measurement, lights):
        return lights()

    def shoot(self, measurement, count):
        def lights():
            self.rendered.append((measurement.sampler.name, measurement.seed, count))
            return Rendering(None, None, self.cost[measurement.sampler.name](count))

        return Shot(count, lights, 0.0, lights())


@pytest.fixture
def at_budget(grid):
    """Measurements of one case: a sampler without seeds and one with three."""
    case = grid.measurements()[0].case

    def make(seconds: float) -> list[Measurement]:
        members = [("median-cut", 0), ("mis", 0), ("mis", 1), ("mis", 2)]
        return [
            Measurement(case, SamplerSpec(name), Budget(seconds, "seconds"), seed)
            for name, seed in members
        ]

    return make


def test_systems_without_locks_between_processes_are_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with pytest.raises(EnvlightError, match="system that locks files"), alone_on_the_machine():
        pass


def test_where_the_system_tells_no_peak_of_memory_there_is_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "resource", None)
    monkeypatch.setattr(machine, "STATUS", Path("nowhere"))
    assert math.isnan(peak_memory_mib())


def linear(fixed, per_light):
    return lambda count: fixed + per_light * count


def medians(found):
    return [one.timing.median for one in found.values()]


def test_long_images_are_rendered_once_at_their_count(at_budget):
    machine = Machine({"median-cut": linear(0.2, 0.05), "mis": linear(0.1, 0.4)})
    found = time_at_budget(machine, at_budget(4.0))
    assert medians(found) == pytest.approx([4.0] * 4, rel=timed.ON_TIME)
    assert len({one.shot.count for one in list(found.values())[1:]}) == 1  # seeds share it
    for measurement, one in found.items():
        key = measurement.sampler.name, measurement.seed, one.shot.count
        assert machine.rendered.count(key) == one.timing.rounds == 1 and not one.corrected


@pytest.mark.parametrize(("seconds", "rounds"), [(0.03, ROUNDS), (0.12, 5), (0.3, 2)])
def test_short_images_are_rendered_until_they_took_long_enough(at_budget, seconds, rounds):
    cost = linear(0.0, seconds / 100)
    machine = Machine({"median-cut": cost, "mis": cost})
    found = time_at_budget(machine, at_budget(seconds))
    assert {one.timing.rounds for one in found.values()} == {rounds}
    assert rounds == ROUNDS or (rounds - 1) * seconds < ENOUGH_SECONDS <= rounds * seconds
    last = machine.rendered[-4:]  # rounds go through all measurements
    assert len(set(last)) == 4


def test_a_miss_is_corrected_once(at_budget):
    # Lights cost half as much again beyond a number that no probe reaches.
    machine = Machine(
        {"median-cut": lambda n: 0.04 * n + 0.02 * max(0, n - 60), "mis": linear(0.1, 0.4)}
    )
    found = time_at_budget(machine, at_budget(4.0))
    assert [one.corrected for one in found.values()] == [True, False, False, False]
    assert medians(found) == pytest.approx([4.0] * 4, rel=timed.ON_TIME)


def test_a_correction_that_is_worse_is_not_kept(at_budget):
    # By 4 and 12 lights, 24 should take 4 s. They take 4.6, and a few less suddenly 2.4.
    def steps(count):
        return count / 6 if count <= 12 else 2.4 if count < 24 else 4.6

    machine = Machine({"median-cut": steps, "mis": linear(0.1, 0.4)})
    first, *_ = time_at_budget(machine, at_budget(4.0)).values()
    assert (first.shot.count, first.timing.median, first.corrected) == (24, 4.6, False)
    assert ("median-cut", 0, 21) in machine.rendered


def test_a_smallest_count_that_takes_longer_is_kept(at_budget):
    machine = Machine({"median-cut": linear(9.0, 1.0), "mis": linear(0.1, 5.0)})
    first, *_ = time_at_budget(machine, at_budget(4.0)).values()
    assert first.shot.count == 1 and first.timing.median == 10.0
    assert ("mis", 0, 4) not in machine.rendered  # of samples, which would take 20 s


@pytest.mark.parametrize(("failing", "again", "seconds"), [(1, 0, 4), (150, 0, 4), (1, 5, 0.03)])
def test_a_sampler_that_fails_leaves_the_others_alone(at_budget, failing, again, seconds):
    def cost(count):
        times = machine.rendered.count(("median-cut", 0, count))
        if count >= failing and times > again:
            raise (MemoryError if times == again + 1 else RuntimeError)("too many lights")
        return seconds / 200 * count

    machine = Machine({"median-cut": cost, "mis": linear(0.1, 0.4)})
    failed, *others = time_at_budget(machine, at_budget(seconds)).values()
    assert isinstance(failed, MemoryError) and all(isinstance(one, TimedShot) for one in others)


def of_time(at_budget, lights):
    budget = Budget.parse(f"time=median-cut:{lights}")
    return [replace(one, budget=budget) for one in at_budget(1.0)]


def test_a_budget_may_be_the_time_of_a_sampler(at_budget):
    machine = Machine({"median-cut": linear(0.2, 0.1), "mis": linear(0.1, 0.4)})
    first, *others = time_at_budget(machine, of_time(at_budget, 30)).values()
    assert first.shot.count == 30 and first.timing.median == pytest.approx(3.2)
    assert all(one.allowed == pytest.approx(3.2) for one in (first, *others))
    assert medians(dict(enumerate(others))) == pytest.approx([3.2] * 3, rel=timed.ON_TIME)


def test_a_machine_that_slows_down_gives_everyone_more_time(at_budget):
    """The budget is timed again beside the others: they keep their counts and are on time."""

    def slowing(fixed, per_light):
        return lambda count: (fixed + per_light * count) * (2.0 if later else 1.0)

    later: list[bool] = []
    machine = Machine({"median-cut": slowing(0.2, 0.1), "mis": slowing(0.1, 0.4)})
    probe_of, first_shot = machine.shoot, []

    def shoot(measurement, count):
        # From the budget's second image on, taken beside the others, all takes twice as long.
        if measurement.budget == Budget(30):
            first_shot.append(count)
            if len(first_shot) > 1:
                later.append(True)
        return probe_of(measurement, count)

    machine.shoot = shoot
    found = time_at_budget(machine, of_time(at_budget, 30))
    for one in found.values():
        assert one.allowed == pytest.approx(6.4)
        assert one.timing.median == pytest.approx(6.4, rel=2 * timed.ON_TIME)


def test_probes_that_vary_are_repeated_and_the_row_says_how_sure_its_count_is(at_budget):
    calls = iter(range(10_000))

    def noisy(count):
        return 0.1 * count * (1.0, 1.0, 1.5)[next(calls) % 3]

    machine = Machine({"median-cut": linear(0.0, 0.1), "mis": noisy})
    found = time_at_budget(machine, at_budget(4.0))
    steady, *varying = found.values()
    assert steady.spread == 0.0 and all(one.spread > timed.ON_TIME for one in varying)
    small = [count for name, _, count in machine.rendered if name == "mis" and count < 30]
    assert max(map(small.count, small)) >= timed.PROBE_ROUNDS + timed.MORE_ROUNDS


def test_timed_measurements_are_measured_stored_and_go_on(
    tmp_path, grid, measurements_of, monkeypatch
):
    told: list[str] = []
    monkeypatch.setattr(Told, "working_on", lambda self, what: told.append(what))
    measurements = [
        replace(measurement, budget=budget)
        for measurement in measurements_of(("noise",))
        for budget in (Budget(0.002, "seconds"), Budget(4))
    ]
    with Store.writing(tmp_path / "run") as store:
        outcome = run_measurements(store, measurements, images=False)
        assert (outcome.measured, outcome.failures) == (len(measurements), [])
        rows = [
            row for one in store.results(IMAGE) if (row := one.result)["budget"] == "seconds=0.002"
        ]
        assert run_measurements(store, measurements, images=False).measured == 0
    assert told[-1].startswith("timing 1 of 1, ") and told[-1].endswith(", seconds=0.002")
    assert len(rows) == len(measurements) // 2
    for row in rows:
        assert row["seconds_render_lower"] <= row["seconds_render"] <= row["seconds_render_upper"]
        assert 1 <= row["rounds"] <= ROUNDS and row["count_corrected"] in (True, False)
    counts = {(row["sampler"], row["count"]) for row in rows}
    assert len(counts) == 3  # seeds of a sampler share its count
