"""Budgets of seconds: every sampler of a case at the count that it renders in time.

What is timed is the shading of the image alone. A few probes at smaller counts, on the whole view,
give a cost model; the image is rendered at the count where that meets the budget. Where it misses
by more than 10 %, the count is corrected once, as what it took tells the model better. Images that
take less than half a second are rendered in several rounds, all samplers and seeds in turn, and the
median stands in the row; a longer one is rendered once. Nothing else that is timed runs on the
machine meanwhile: a lock sees to that, also between processes.

A budget that is the time of a sampler is that of an image of it, which takes part in the rounds:
what it takes there is what the others beside it are held to, also where the machine's speed drifts.
A probe that varies by more than a tenth is repeated; how far those that gave a count still vary
stands in its row.
"""

import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, median

from experiments.run.bench import LOAD, ON_TIME, Timing, load_average
from experiments.run.budget import ALLOWED
from experiments.run.counts import FEW, CountRange, count_for, probe
from experiments.run.measure import Measured, MeasurementTask, fill_view, finished, guarded
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, Shot, rehearse_lights
from samplers import DirectionalLights, DiscLights, EnvlightError, LayeredLights

ROUNDS, ENOUGH_SECONDS = 7, 0.5
"""An image is rendered so often at most, and not again once that has taken so long."""
PROBE_ROUNDS, PROBE_SECONDS, LEAST_PROBES = 3, 0.2, 2
"""The same of a probe, and how often it is rendered at least."""
MORE_ROUNDS = 4
"""Rounds that a probe has besides where it varies by more than `ON_TIME`."""
COUNT_SPREAD = "count_spread"
"""The column of how far the probes that gave a count vary, as a share: so sure is the count."""
MOST_LIGHTS = 1 << 14
"""No sampler is asked for more in the time."""


@dataclass(frozen=True, eq=False)
class TimedShot:
    """An image, and the time of rendering it.

    corrected : whether its count is not the first that the cost model gave
    allowed : seconds that the budget was, beside it
    spread : largest of the probes that gave the count, as a share of their medians
    """

    shot: Shot
    timing: Timing
    corrected: bool = False
    allowed: float = math.nan
    spread: float = 0.0


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
        try:
            if isinstance(timed, Exception):
                raise timed
            result.set_result(_row(task, scene, timed, load))
        except Exception as error:
            result.set_exception(error)
    return results


def _row(task: MeasurementTask, scene: CaseScene, timed: TimedShot, load: float) -> Measured:
    one, shot = task.measurement, timed.shot
    late = timed.timing.median > (1.0 + ON_TIME) * timed.allowed
    return finished(
        task,
        scene,
        shot,
        **timed.timing.columns("seconds_render"),
        **{LOAD: load, COUNT_SPREAD: timed.spread},
        **({ALLOWED: timed.allowed} if one.budget.like else {}),
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

    measurements : of one case and one budget of time; hold `alone_on_the_machine` meanwhile
    timeout : seconds that preparing and rendering one may take with all probes; 0 for any

    All seeds of a sampler have one count, probed with the first of them. The error of a sampler
    that fails takes the place of its images.
    """
    seeds: dict[str, list[Measurement]] = {}
    for one in measurements:
        seeds.setdefault(one.sampler.label, []).append(one)
    probes = {label: _Probes(scene, members[0]) for label, members in seeds.items()}
    found: dict[Measurement, TimedShot | Exception] = {}
    misses: dict[str, float] = {}
    like = measurements[0].like if measurements[0].budget.like else None
    budget = measurements[0].budget.amount
    if like:
        budget = guarded(timeout, _Probes(scene, like).cost, like.budget.lights)
    todo = list(seeds)
    for corrected in (False, True):
        shots: dict[Measurement, Shot] = {}
        beside: dict[Measurement, Shot] = {}
        if like and todo:
            beside[like] = guarded(timeout, scene.shoot, like, like.budget.lights)
        for label in todo:
            try:
                members = seeds[label]
                allowed = timeout * len(members)
                shots |= guarded(allowed, probes[label].shots, members, budget)
            except Exception as error:
                found |= dict.fromkeys(seeds[label], error)
        failed: dict[str, Exception] = {}
        timings = timed_rounds(scene, shots | beside, timeout=timeout, failed=failed)
        for label, failure in failed.items():
            if label not in seeds:
                raise failure
            found |= dict.fromkeys(seeds[label], failure)
        for one, shot in beside.items():  # before, among and after the others
            after = guarded(timeout, scene.render, one, shot.lighting).seconds
            budget = fmean([timings[one].median, after])
        counts = {one.sampler.label: shot.count for one, shot in shots.items()}
        tried = {label: count for label, count in counts.items() if label not in failed}
        todo = []
        for label, count in tried.items():
            members, its = seeds[label], probes[label]
            taken = median(timings[one].median for one in members)
            miss = abs(taken / budget - 1.0)
            if miss < misses.get(label, math.inf):
                misses[label] = miss
                found |= {
                    one: TimedShot(shots[one], timings[one], corrected, budget, its.spread)
                    for one in members
                }
            its.costs[count] = taken
            if miss > ON_TIME and its.count(budget) != count:
                todo.append(label)
    return {one: found[one] for one in measurements}


@dataclass(eq=False)
class _Probes:
    """What images of a sampler were seen to cost, by count, and how far that varied."""

    scene: CaseScene
    first: Measurement
    costs: dict[int, float] = field(default_factory=dict)
    spread: float = 0.0

    def count(self, seconds: float) -> int:
        """The count that should take so long; a few are tried where nothing is known yet."""
        budget = self.first.budget
        if budget.like == self.first.sampler.label:
            return int(budget.amount)
        allowed = allowed_counts(self.first)
        if not self.costs:
            few = 1  # of samples, which cost the same each
            with suppress(Exception):  # its image fails, too, and says why
                made = rehearse_lights(self.first.sampler)
                if isinstance(made, DirectionalLights | DiscLights | LayeredLights):
                    few = FEW
            self.costs |= probe(self.cost, seconds, allowed, few)
        return count_for(seconds, self.costs, allowed)

    def shots(self, members: list[Measurement], seconds: float) -> dict[Measurement, Shot]:
        """The sampler's seeds at the count that should take so long."""
        count = self.count(seconds)
        return {one: self.scene.shoot(one, count) for one in members}

    def cost(self, count: int) -> float:
        """Seconds of an image of the first seed."""
        fill_view(self.scene, self.first)
        shots = {self.first: self.scene.shoot(self.first, count)}

        def timing(rounds: int, enough: float) -> Timing:
            return timed_rounds(self.scene, shots, rounds, enough, LEAST_PROBES)[self.first]

        found = timing(PROBE_ROUNDS, PROBE_SECONDS)
        if found.spread > ON_TIME:
            found = timing(PROBE_ROUNDS + MORE_ROUNDS, math.inf)
        self.spread = max(self.spread, found.spread)
        return found.median


def timed_rounds(
    scene: CaseScene,
    shots: Mapping[Measurement, Shot],
    rounds: int = ROUNDS,
    enough: float = ENOUGH_SECONDS,
    least: int = 1,
    timeout: float = 0.0,
    failed: dict[str, Exception] | None = None,
) -> dict[Measurement, Timing]:
    """Times of rendering: those of the shots, and of more rounds where these were short.

    rounds, least : at most and at least; enough : seconds of rendering after which an image is left
        out of the others; timeout : of one, 0 for any
    failed : where given, takes the errors of samplers by their labels, and the others go on
    """
    seconds = {one: [shot.rendering.seconds] for one, shot in shots.items()}
    for _ in range(rounds - 1):
        for one, shot in shots.items():
            done = len(seconds[one]) >= least and sum(seconds[one]) >= enough
            if done or (failed and one.sampler.label in failed):
                continue
            try:
                made = guarded(timeout, scene.render, one, shot.lighting)
                seconds[one].append(made.seconds)
            except Exception as error:
                if failed is None:
                    raise
                failed[one.sampler.label] = error
    return {one: Timing.of(values) for one, values in seconds.items()}
