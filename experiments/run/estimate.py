"""How long what is left of a grid will take, by kind of budget: an estimate from a few images.

In some of its cases images are rendered by some of the samplers at two counts, on views as large as
those of the grid, though not larger than 640 columns: of fewer sub-pixels each takes longer, as
those that share a packet lie farther apart. References differ far more from map to map than images,
as the samples that a noise takes do, and their time grows with the number of sub-pixels: they are
rendered on views of 80 columns. Cases go through all scenes, and through maps that lie far apart in
the list, and samplers in turn, until about a second is used up; a sampler that was not reached
is taken to cost what others do. Compiling and the report are not looked at: it is an estimate.
"""

import math
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import cycle
from statistics import fmean

import numpy as np

from experiments.run.budget import TIMED, Budget
from experiments.run.case import Case
from experiments.run.counts import CostLine, count_for, probe, range_for_rays
from experiments.run.judging import scores
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, rehearse_reference
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from experiments.run.timed import (
    ENOUGH_SECONDS,
    PROBE_ROUNDS,
    PROBE_SECONDS,
    ROUNDS,
    allowed_counts,
)
from metrics.registry import metrics
from metrics.truth import Truth
from renderer.reference import render_reference

WIDTH, REFERENCE_WIDTH = 640, 80
"""Columns of views at most, of images and of references."""
LONGEST = 0.4
"""Seconds after which no further case or sampler is begun: of images, and again of references."""
LEAST_SAMPLERS = 3
"""So many are looked at in any case."""
FEW, MORE = 4, 12
"""Lights, and how many more a second image has."""
RAYS_RENDERED, RAYS_PREPARED = 1.3, 3.5
"""Images of the whole view, and numbers of lights, that the search for a budget of rays takes."""
MACHINES = (8, 32)
REFERENCES = "references"
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
MOST_CASES = 256
"""Are drawn at most, of which some are the same."""


@dataclass(frozen=True)
class Left:
    """What is still to be made.

    measurements : in their order; references : how many of their cases have none
    """

    measurements: list[Measurement]
    references: int


@dataclass(frozen=True)
class Cost:
    """What a sampler takes in a case of the grid.

    lights : seconds to prepare them; image : seconds to render, by the number of lights
    rays : of a sub-pixel, by light
    """

    lights: float
    image: CostLine
    rays: float

    def seconds(self, one: Measurement, scenes: int, like: "Cost | None" = None) -> float:
        """To prepare and render a measurement.

        scenes : that share the lights of a map; like : of the sampler whose cost the budget is
        """
        budget = one.budget
        if budget.kind == "lights":
            count = budget.amount / like.rays if like else budget.lights
            return self.lights / scenes + self.image.seconds(count)
        amount = budget.amount
        if budget.kind == "rays":
            amount = like.rays * amount if like else amount
            allowed = range_for_rays(amount, one.sampler.sampler.minimum_count)
            # Of counts that trace no ray none is nearer to the budget than the first that is tried.
            count = allowed.clip(amount / self.rays if self.rays > 0.0 else amount)
            return RAYS_PREPARED * self.lights + RAYS_RENDERED * self.image.seconds(count)
        amount = like.image.seconds(amount) if like else amount
        probes = probe(self.image.seconds, amount, allowed_counts(one))
        image = self.image.seconds(count_for(amount, probes, allowed_counts(one)))
        seconds = self.lights + _in_rounds(image, ROUNDS, ENOUGH_SECONDS)
        if one.seed == 0:
            for probed in probes.values():
                seconds += self.lights + _in_rounds(probed, PROBE_ROUNDS, PROBE_SECONDS)
        return seconds


def estimate(left: Left, workers: int = 1) -> str:
    """One sentence: the time on this machine by kind of budget, and in all on several like it.

    workers : how many measurements are worked on at once, each as fast as alone; what is timed
        is in one process
    """
    if not left.measurements:
        return "nothing is left to be measured"
    judging = _judging_seconds(left.measurements[0].case.scale)
    alone = seconds_by_kind(left, judging, list(_references(left)), list(_images(left)))
    seconds = {kind: of / (1 if kind in TIMED else workers) for kind, of in alone.items()}
    whole, timed = sum(seconds.values()), sum(seconds.get(kind, 0.0) for kind in TIMED)
    parts = ", ".join(f"{kind} {_in_words(value)}" for kind, value in seconds.items())
    others = [f"{_in_words((whole - timed) / count + timed)} on {count}" for count in MACHINES]
    return f"about {_in_words(whole)} on this machine ({parts}), {' or '.join(others)} like it"


def seconds_by_kind(
    left: Left, judging: float, references: list[float], images: list[dict[str, Cost]]
) -> dict[str, float]:
    """What references take, and measurements by the kind of their budget.

    judging : seconds to judge an image; references : seconds of some of those that are left;
    images : what samplers take, in some of the cases
    """
    scenes = len({one.case.scene for one in left.measurements})
    seconds = {REFERENCES: left.references * fmean(references) if left.references else 0.0}

    known: dict[tuple[str, Budget, bool], float] = {}
    for one in left.measurements:
        alike = one.sampler.label, one.budget, one.seed == 0
        if alike not in known:
            found = _seconds(one, scenes, images)
            known[alike] = judging + fmean(found) if found else 0.0
        kind = one.budget.kind
        seconds[kind] = seconds.get(kind, 0.0) + known[alike]
    return seconds


def _seconds(one: Measurement, scenes: int, images: list[dict[str, Cost]]) -> list[float]:
    """What an image takes by each case that tells of its sampler; or else what others do there."""
    label, like = one.sampler.label, one.budget.like
    told = [costs for costs in images if not like or like in costs]
    own = [costs[label].seconds(one, scenes, costs.get(like)) for costs in told if label in costs]
    return own or [
        cost.seconds(one, scenes, costs.get(like)) for costs in told for cost in costs.values()
    ]


def _images(left: Left) -> Iterator[dict[str, Cost]]:
    """What samplers take in some of the cases: those whose spending is a budget in each, and then
    others in turn, in each of the cases where the last one stopped."""
    yardsticks = dict.fromkeys(one.like.sampler for one in left.measurements if one.budget.like)
    samplers = deque(dict.fromkeys(one.sampler for one in left.measurements))
    started = time.perf_counter()
    for case in _some(left):
        costs: dict[str, Cost] = {}
        for number in range(len(samplers)):
            if number >= LEAST_SAMPLERS and time.perf_counter() - started > LONGEST:
                break
            for spec in (samplers[0], *yardsticks):
                if spec.label not in costs:
                    with suppress(Exception):  # its measurements fail, too, and the run says why
                        costs[spec.label] = _cost(*_reduced(case, WIDTH), spec)
            samplers.rotate(-1)
        yield costs


def _references(left: Left) -> Iterator[float]:
    """Seconds of a reference, from one of a smaller view, in some of the cases."""
    if not left.references:
        return
    rehearse_reference()
    for case in _some(left):
        small, larger = _reduced(case, REFERENCE_WIDTH)
        at, goal = CaseScene.of(small), case.scale
        # The first makes what is kept of the map, whose time does not grow with the view.
        once, found = (
            render_reference(at.view, at.environment, goal.noise_target, most).seconds
            for most in (0, goal.max_samples)
        )
        yield once + larger * found


def _some(left: Left) -> Iterator[Case]:
    """A case, and as many more as are looked at within some time."""
    started = time.perf_counter()
    for k, case in enumerate(_spread(_by_scene(left.measurements))):
        if k and time.perf_counter() - started > LONGEST:
            return
        yield case


def _reduced(case: Case, most: int) -> tuple[Case, float]:
    """The case with `most` columns, unless it has fewer; how many times as many pixels it has."""
    scale = case.scale
    width = min(scale.width, most)
    height = max(1, round(scale.height * width / scale.width))
    pixels = scale.width * scale.height / (width * height)
    return replace(case, scale=replace(scale, width=width, height=height)), pixels


def _by_scene(measurements: Iterable[Measurement]) -> list[list[Case]]:
    """The cases of each scene, in their order."""
    found: dict[str, list[Case]] = {}
    for case in dict.fromkeys(one.case for one in measurements):
        found.setdefault(case.scene, []).append(case)
    return list(found.values())


def _spread(by_scene: list[list[Case]]) -> list[Case]:
    """Cases of the scenes in turn, under maps that lie far apart in the list."""
    chosen = (
        cases[int(GOLDEN * k % 1.0 * len(cases))]
        for k, cases in zip(range(MOST_CASES), cycle(by_scene), strict=False)
    )
    return list(dict.fromkeys(chosen))


def _cost(case: Case, larger: float, sampler: SamplerSpec) -> Cost:
    """From a case with a view that has `larger` times fewer pixels than the grid's."""
    one = Measurement(case, sampler, Budget(1), 0)
    scene, few = CaseScene.of(case), max(FEW, sampler.sampler.minimum_count)
    scene.shoot(one, few)  # fills what is kept with the view
    shots = [scene.shoot(one, count) for count in (few, few + MORE)]
    costs = {shot.count: larger * shot.rendering.seconds for shot in shots}
    lights = max(shot.seconds_lights for shot in shots)
    return Cost(lights, line_of(costs), shots[-1].rays / (few + MORE))


def line_of(costs: dict[int, float]) -> CostLine:
    """Through seconds by count; where noise has no lights take less than nothing, in proportion."""
    line, most = CostLine.near(max(costs.values()), costs), max(costs)
    return line if line.fixed >= 0.0 else CostLine.near(0.0, {most: costs[most]})


def _judging_seconds(scale: Scale) -> float:
    """To judge an image by all metrics, once the reference's own tables are there."""
    shape = (2, scale.height, scale.width, 3)
    image, reference = np.random.default_rng(0).random(shape, np.float32)
    truth, names = Truth(reference, 1.0, 0.1, (image, reference)), [one.name for one in metrics()]
    scores(image, truth, names)
    started = time.perf_counter()
    scores(image, truth, names)
    return time.perf_counter() - started


def _in_rounds(seconds: float, most: int, enough: float) -> float:
    """What the rounds take of an image that takes so long."""
    rounds = math.ceil(enough / seconds) if seconds > 0.0 else most
    return seconds * min(rounds, most)


def _in_words(seconds: float) -> str:
    return f"{seconds / 3600.0:.2g} hours" if seconds >= 3600.0 else f"{seconds / 60.0:.2g} minutes"
