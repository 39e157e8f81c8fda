"""Budgets of seconds: every sampler of a case at the count that it renders in time.

What is timed is the shading of the image alone. A few probes at smaller counts, on the whole view,
give a cost model; the image is rendered at the count where that meets the budget. Where it misses
by more than 10 %, the count is corrected once, as what it took tells the model better. Images that
take less than half a second are rendered in several rounds, all samplers and seeds in turn, and the
median stands in the row; a longer one is rendered once. Nothing else that is timed runs on the
machine meanwhile: a lock sees to that, also between processes.
"""

import math
import os
import statistics
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from experiments.run.bench import LOAD, ON_TIME, Timing, load_average
from experiments.run.cost_model import FEW, count_for, probe
from experiments.run.count_search import CountRange
from experiments.run.guard import guarded
from experiments.run.measure import Measured, MeasurementTask, finished
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, Shot
from samplers import EnvlightError

ROUNDS, ENOUGH_SECONDS = 7, 0.5
"""An image is rendered so often at most, and not again once that has taken so long."""
PROBE_ROUNDS, PROBE_SECONDS = 3, 0.2
"""The same of a probe."""
MOST_LIGHTS = 1 << 14
"""No sampler is asked for more in the time."""


@dataclass(frozen=True, eq=False)
class TimedShot:
    """An image, and the time of rendering it.

    corrected : whether its count is not the first that the cost model gave
    """

    shot: Shot
    timing: Timing
    corrected: bool = False


@contextmanager
def alone_on_the_machine() -> Iterator[None]:
    """Wait until no other timed measurement runs on this machine, and keep others waiting.

    Raises EnvlightError on systems without such locks (Windows).
    """
    try:
        import fcntl
    except ImportError:
        raise EnvlightError(
            "budgets of seconds need a system that locks files between processes, such as Linux; "
            "give --budget lights=K or rays=R here"
        ) from None
    path = Path(tempfile.gettempdir()) / f"envlight-timing-{os.getuid()}.lock"
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def measure_timed(tasks: list[MeasurementTask]) -> list[Future]:
    """Measure measurements of one case and one budget of seconds side by side.

    Returns a future for each that holds its row, or the error of its sampler, which then is left
    out of the rounds of the others.
    """
    results: list[Future] = [Future() for _ in tasks]
    scene = CaseScene.of(tasks[0].measurement.case)
    with alone_on_the_machine():
        load = load_average()
        found = time_at_budget(scene, [task.measurement for task in tasks], tasks[0].timeout)
    for task, result in zip(tasks, results, strict=True):
        timed = found[task.measurement]
        if isinstance(timed, Exception):
            result.set_exception(timed)
        else:
            result.set_result(_row(task, scene, timed, load))
    return results


def _row(task: MeasurementTask, scene: CaseScene, timed: TimedShot, load: float) -> Measured:
    one, shot = task.measurement, timed.shot
    late = timed.timing.median > (1.0 + ON_TIME) * one.budget.amount
    return finished(
        task,
        scene,
        shot,
        **timed.timing.columns("seconds_render"),
        **{LOAD: load},
        count_corrected=timed.corrected,
        over_budget=late and shot.count == allowed_counts(one).least,
    )


def allowed_counts(measurement: Measurement) -> CountRange:
    """What a sampler may be asked for: from its smallest count to the most of any."""
    return CountRange(measurement.sampler.sampler.minimum_count, MOST_LIGHTS)


def time_at_budget(
    scene: CaseScene, measurements: list[Measurement], timeout: float = 0.0
) -> dict[Measurement, TimedShot | Exception]:
    """Each measurement's image at the count that its sampler needs for the budget, and its timing.

    measurements : of one case and one budget of seconds; hold `alone_on_the_machine` meanwhile
    timeout : seconds that preparing and rendering one may take with all probes; 0 for any

    All seeds of a sampler have one count, probed with the first of them. The error of a sampler
    that fails takes the place of its images.
    """
    budget = measurements[0].budget.amount
    seeds: dict[str, list[Measurement]] = {}
    for one in measurements:
        seeds.setdefault(one.sampler.label, []).append(one)
    costs: dict[str, dict[int, float]] = {label: {} for label in seeds}
    found: dict[Measurement, TimedShot | Exception] = {}
    misses: dict[str, float] = {}
    todo = list(seeds)
    for corrected in (False, True):
        shots: dict[Measurement, Shot] = {}
        for label in todo:
            try:
                members = seeds[label]
                allowed = timeout * len(members)
                shots |= guarded(allowed, _shots, scene, members, costs[label])
            except Exception as error:
                found |= dict.fromkeys(seeds[label], error)
        timings = timed_rounds(scene, shots)
        tried = {one.sampler.label: shot.count for one, shot in shots.items()}
        todo = []
        for label, count in tried.items():
            members = seeds[label]
            taken = statistics.median(timings[one].median for one in members)
            miss = abs(taken - budget)
            if miss < misses.get(label, math.inf):
                misses[label] = miss
                found |= {one: TimedShot(shots[one], timings[one], corrected) for one in members}
            costs[label][count] = taken
            better = count_for(budget, costs[label], allowed_counts(members[0]))
            if miss > ON_TIME * budget and better != count:
                todo.append(label)
    return {one: found[one] for one in measurements}


def _shots(
    scene: CaseScene, members: list[Measurement], costs: dict[int, float]
) -> dict[Measurement, Shot]:
    """A sampler's seeds at the count that `costs` tell, which are probed where there are none."""
    first, allowed = members[0], allowed_counts(members[0])

    def cost(count: int) -> float:
        shots = {first: scene.shoot(first, count)}
        return timed_rounds(scene, shots, PROBE_ROUNDS, PROBE_SECONDS)[first].median

    if not costs:
        scene.shoot(first, allowed.clip(FEW))  # fills what is kept with the view
        costs |= probe(cost, first.budget.amount, allowed)
    count = count_for(first.budget.amount, costs, allowed)
    return {one: scene.shoot(one, count) for one in members}


def timed_rounds(
    scene: CaseScene,
    shots: Mapping[Measurement, Shot],
    rounds: int = ROUNDS,
    enough: float = ENOUGH_SECONDS,
) -> dict[Measurement, Timing]:
    """Times of rendering: those of the shots, and of more rounds where these were short.

    rounds : at most; enough : seconds of rendering after which an image is left out of the others
    """
    seconds = {one: [shot.rendering.seconds] for one, shot in shots.items()}
    for _ in range(rounds - 1):
        for one, shot in shots.items():
            if sum(seconds[one]) < enough:
                seconds[one].append(scene.render(one, shot.lighting).seconds)
    return {one: Timing.of(values) for one, values in seconds.items()}
