"""Budgets of seconds: every sampler of a case at the count that it renders in time.

What is timed is the shading of the image alone. A line a + b·count through two short probes says
where to begin; counts then close in on the budget, and end within 10 % of it, or where one light
more or less is already too much or too little. At the counts found all samplers and seeds are
timed in interleaved rounds, and the medians of these stand in the rows. Nothing else that is timed
runs on the machine meanwhile: a lock sees to that, also between processes.
"""

import fcntl
import os
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from experiments.run.bench import LOAD, Timing, interleaved, load_average
from experiments.run.count_search import CountRange, counts_towards
from experiments.run.measure import Measured, MeasurementTask, finished
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, Shot
from renderer.render import render

TOLERANCE = 0.1
"""A median within this share of the budget is on time."""
SEARCH_ROUNDS, FINAL_ROUNDS, REPEATS, SEARCH_STEPS = 3, 7, 2, 8
PROBE_STEP = 4
"""The second probe takes this many lights more than the smallest count."""
MOST_LIGHTS = 1 << 14
"""No sampler is asked for more in the time."""


@contextmanager
def alone_on_the_machine() -> Iterator[None]:
    """Wait until no other timed measurement runs on this machine, and keep others waiting."""
    path = Path(tempfile.gettempdir()) / f"envlight-timing-{os.getuid()}.lock"
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def measure_timed(tasks: list[MeasurementTask]) -> list[Future]:
    """Measure measurements of one case and one budget of seconds side by side.

    Returns a future for each that holds its row, or the error of its sampler, which then is left
    out of the rounds of the others.
    """
    results = {task.measurement: Future() for task in tasks}  # type: dict[Measurement, Future]
    scene = CaseScene.of(tasks[0].measurement.case)
    with alone_on_the_machine():
        load = load_average()
        for measurement, result in results.items():
            try:
                scene.shoot(measurement, allowed_counts(measurement).least)
            except Exception as error:
                result.set_exception(error)
        measurements = [measurement for measurement, result in results.items() if not result.done()]
        timed = (
            dict(zip(measurements, time_at_budget(scene, measurements), strict=True))
            if measurements
            else {}
        )
    for task in tasks:
        measurement = task.measurement
        if measurement in timed:
            results[measurement].set_result(_row(task, scene, *timed[measurement], load))
    return list(results.values())


def _row(
    task: MeasurementTask, scene: CaseScene, shot: Shot, timing: Timing, load: float
) -> Measured:
    one = task.measurement
    late = timing.median > (1.0 + TOLERANCE) * one.budget.amount
    return finished(
        task,
        scene,
        shot,
        **timing.columns("seconds_render"),
        **{LOAD: load},
        over_budget=late and shot.count == allowed_counts(one).least,
    )


def time_at_budget(scene: CaseScene, measurements: list[Measurement]) -> list[tuple[Shot, Timing]]:
    """Each measurement's image at the count that its sampler needs for the budget, and its timing.

    measurements : of one case and one budget of seconds; hold `alone_on_the_machine` meanwhile

    The count is that of the sampler's first seed.
    """
    first = {measurement.sampler.label: measurement for measurement in reversed(measurements)}
    budget = measurements[0].budget.amount
    starts = _starts(scene, first, budget)
    counts: dict[str, int] = {}
    done: dict[Measurement, tuple[Shot, Timing]] = {}
    searched = dict(first)
    for _ in range(1 + REPEATS):
        counts |= _search(scene, searched, starts, budget)
        again = [
            measurement for measurement in measurements if measurement.sampler.label in searched
        ]
        done |= timed_rounds(
            scene,
            {measurement: counts[measurement.sampler.label] for measurement in again},
            FINAL_ROUNDS,
        )
        medians = {label: done[measurement][1].median for label, measurement in first.items()}
        searched = {
            label: first[label]
            for label, median in medians.items()
            if abs(median - budget) > TOLERANCE * budget
            and counts[label] != allowed_counts(first[label]).clip(counts[label] * budget / median)
        }
        if not searched:
            break
        starts = {label: counts[label] * budget / medians[label] for label in searched}
    return [done[measurement] for measurement in measurements]


def allowed_counts(measurement: Measurement) -> CountRange:
    """What a sampler may be asked for: from its smallest count to the most of any."""
    return CountRange(measurement.sampler.sampler.minimum_count, MOST_LIGHTS)


def _starts(
    scene: CaseScene, measurements: Mapping[str, Measurement], budget: float
) -> dict[str, float]:
    """Where a + b·count meets the budget, by sampler."""
    low = {label: allowed_counts(measurement).least for label, measurement in measurements.items()}
    high = {label: least + PROBE_STEP for label, least in low.items()}
    few = _medians(scene, measurements, low)
    more = _medians(scene, measurements, high)
    starts = {}
    for label in measurements:
        slope = (more[label] - few[label]) / PROBE_STEP
        # Where noise hides what a light costs, the probe with more of them is in proportion.
        slope = slope if slope > 0.0 else more[label] / high[label]
        starts[label] = min(low[label] + (budget - few[label]) / slope, float(MOST_LIGHTS))
    return starts


def _search(
    scene: CaseScene,
    measurements: Mapping[str, Measurement],
    starts: Mapping[str, float],
    budget: float,
) -> dict[str, int]:
    """The count of each sampler whose median is nearest to the budget; all search side by side."""
    searches: dict[str, Generator[int, float, int]] = {
        label: counts_towards(
            budget, allowed_counts(measurement), starts[label], 0.5 * TOLERANCE, SEARCH_STEPS
        )
        for label, measurement in measurements.items()
    }
    trying = {label: next(search) for label, search in searches.items()}
    found: dict[str, int] = {}
    while trying:
        medians = _medians(scene, measurements, trying)
        following = {}
        for label, median in medians.items():
            try:
                following[label] = searches[label].send(median)
            except StopIteration as end:
                found[label] = int(end.value)
        trying = following
    return found


def _medians(
    scene: CaseScene, measurements: Mapping[str, Measurement], counts: Mapping[str, int]
) -> dict[str, float]:
    timed = timed_rounds(
        scene, {measurements[label]: count for label, count in counts.items()}, SEARCH_ROUNDS
    )
    return {label: timed[measurements[label]][1].median for label in counts}


def timed_rounds(
    scene: CaseScene, counts: Mapping[Measurement, int], rounds: int
) -> dict[Measurement, tuple[Shot, Timing]]:
    """Render each at its count in interleaved rounds; lightings are made before the first."""
    shots: dict[Measurement, Shot] = {
        measurement: scene.shoot(measurement, n) for measurement, n in counts.items()
    }

    def task(shot: Shot, seed: int) -> Callable[[], Any]:
        return lambda: render(scene.view, shot.lighting, scene.environment, seed=seed)

    tasks = {
        str(k): task(shot, measurement.seed) for k, (measurement, shot) in enumerate(shots.items())
    }
    timings = interleaved(tasks, rounds, warm_up=0)
    return {
        measurement: (shots[measurement], timings[str(k)]) for k, measurement in enumerate(shots)
    }
