"""How long what is left of a grid will take: an estimate from a few images.

In some of the cases images are rendered of some measurements of each kind of budget, on views as
large as those of the grid, though not larger than 640 columns: of fewer sub-pixels each takes
longer, as those that share a packet lie farther apart. References differ far more from map to map
than images, as the samples that a noise takes do, and their time grows with the number of
sub-pixels: they are rendered on views of 80 columns. Cases go through scenes and maps that lie far
apart, measurements through samplers, until half a second is used up; all others are taken to cost
the mean. Compiling and the report are not looked at: it is an estimate.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from statistics import fmean
from typing import TypeVar

import numpy as np

from experiments.run.case import Case
from experiments.run.judging import scores
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, rehearse_reference, shoot
from experiments.run.scale import Scale
from experiments.run.timed import ENOUGH_SECONDS, FEW, PROBE_ROUNDS, PROBE_SECONDS, ROUNDS
from metrics.registry import metrics
from metrics.truth import Truth
from renderer.reference import render_reference

WIDTH, REFERENCE_WIDTH = 640, 80
"""Columns of views at most, of images and of references."""
LONGEST = 0.25
"""Seconds after which no further image or case is begun: of images, and again of references."""
LEAST = 3
"""So many images are rendered of any kind of budget."""
RAYS_PREPARED = 3.5
"""Numbers of lights that the search for a budget of rays prepares."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
One = TypeVar("One")


@dataclass(frozen=True)
class Left:
    """What is still to be made.

    measurements : in their order; references : how many of their cases have none
    """

    measurements: list[Measurement]
    references: int


def estimate(left: Left, workers: int = 1) -> str:
    """The time on this machine, in words.

    workers : how many measurements are worked on at once, each as fast as alone; what is timed
        is in one process
    """
    if not left.measurements:
        return "nothing is left to be measured"
    judging = _judging_seconds(left.measurements[0].case.scale)
    shared, timed = left.references * fmean(list(_references(left)) or [0.0]), 0.0
    kinds: dict[str, list[Measurement]] = {}
    for one in left.measurements:
        kinds.setdefault(one.budget.kind, []).append(one)
    for some in kinds.values():
        seconds = len(some) * (judging + fmean(_images(some, LONGEST / len(kinds)) or [0.0]))
        if some[0].budget.timed:
            timed += seconds
        else:
            shared += seconds
    return f"about {_in_words(shared / workers + timed)} on this machine"


def _spread(items: Sequence[One]) -> Iterator[One]:
    """The first, and others that lie far apart, over and over."""
    return (items[int(GOLDEN * k % 1.0 * len(items))] for k in count())


def _images(measurements: Sequence[Measurement], longest: float) -> list[float]:
    """Seconds of some measurements of one kind of budget, without judging."""
    scenes = len({one.case.scene for one in measurements})
    cases: dict[Case, list[Measurement]] = {}
    for one in measurements:
        cases.setdefault(one.case, []).append(one)
    found: list[float] = []
    started, tried = time.perf_counter(), 0
    for members in _spread(list(cases.values())):
        for one, _ in zip(_spread(members), range(LEAST), strict=False):
            tried += 1
            with suppress(Exception):  # its measurement fails, too, and the run says why
                found.append(_seconds(one, scenes))
        if tried >= len(measurements) or time.perf_counter() - started > longest:
            return found
    return found


def _seconds(one: Measurement, scenes: int) -> float:
    """To prepare and render a measurement. scenes : that share the lights of a map"""
    small, larger = _reduced(one.case, WIDTH)
    one = replace(one, case=small)
    budget = one.budget
    if budget.timed:
        least = max(FEW, one.sampler.sampler.minimum_count)
        lights = CaseScene.of(small).shoot(one, least).seconds_lights
        image = larger * _rendered(one.like)[0] if budget.like else budget.amount
        seconds = lights + _in_rounds(image, ROUNDS, ENOUGH_SECONDS)
        if one.seed == 0:
            seconds += 2.0 * lights + _in_rounds(0.5 * image, PROBE_ROUNDS, PROBE_SECONDS)
        return seconds
    image, lights = _rendered(one)
    return larger * image + lights * (RAYS_PREPARED if budget.kind == "rays" else 1.0 / scenes)


def _rendered(one: Measurement) -> tuple[float, float]:
    """Seconds of a measurement that is not timed, and of its lights."""
    shoot(one)  # fills what is kept with the view, and makes the lights
    started = time.perf_counter()
    _, shot = shoot(one)
    return time.perf_counter() - started, shot.seconds_lights


def _references(left: Left) -> Iterator[float]:
    """Seconds of a reference, from one of a smaller view, in some of the cases."""
    cases = list(dict.fromkeys(one.case for one in left.measurements))
    if not left.references:
        return
    rehearse_reference()
    started = time.perf_counter()
    for case, _ in zip(_spread(cases), cases, strict=False):
        small, larger = _reduced(case, REFERENCE_WIDTH)
        at, goal = CaseScene.of(small), case.scale
        # The first makes what is kept of the map, whose time does not grow with the view.
        once, found = (
            render_reference(at.view, at.environment, goal.noise_target, most).seconds
            for most in (0, goal.max_samples)
        )
        yield once + larger * found
        if time.perf_counter() - started > LONGEST:
            return


def _reduced(case: Case, most: int) -> tuple[Case, float]:
    """The case with `most` columns, unless it has fewer; how many times as many pixels it has."""
    scale = case.scale
    width = min(scale.width, most)
    height = max(1, round(scale.height * width / scale.width))
    pixels = scale.width * scale.height / (width * height)
    return replace(case, scale=replace(scale, width=width, height=height)), pixels


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
