"""Measuring how long making lights takes, and how much memory.

`prepare` is timed on a map whose shared tables exist; the tables are timed apart, each on its own
with what it needs. All tasks of a map run in interleaved rounds. The Q²-tree is also mended after
one hundredth of the texels, a square, became brighter.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from experiments.maps.sources import EMBEDDED, EnvironmentSource, find_environments
from experiments.run.bench import interleaved
from experiments.run.budget import Budget
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Job, Row
from experiments.run.preparation_peak import make_tables, peak_of, rehearse
from experiments.run.rendering import SHARED_TABLES
from experiments.run.request import RunRequest
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import QUICK, of_scale
from samplers import EnvironmentMap
from samplers.q2_tree import Q2Tree

EMBEDDED_MAPS = ["noon-desert", "room-one-window"]
HEIGHTS = {QUICK: (256, 512), "standard": (512, 2048, 4096), "paper": (512, 1024, 2048, 4096)}
"""Rows of the maps, by scale; files have their own and those of these that are larger."""
MOST_MADE = 1024
"""A map of more rows than this is one of so many, enlarged: making it would take minutes."""
ROUNDS = {QUICK: 5, "standard": 11, "paper": 11}
MOST_SECONDS = {QUICK: 1.0, "standard": 10.0, "paper": 30.0}
COUNT = 64
COUNTS = {"fhis": 300, "q2-tree": 300}
CHANGED_SHARE = 0.01
BRIGHTER = 4.0
TABLE = "table "
UPDATE = "q2-tree update, 1 % changed"


@dataclass(frozen=True)
class SizedMap:
    """A map, each of whose texels is repeated `enlarged` × `enlarged` times."""

    source: EnvironmentSource
    enlarged: int = 1

    def load(self) -> EnvironmentMap:
        """The map; of the same radiance in every direction, and hence the same energy."""
        environment = self.source.load()
        if self.enlarged == 1:
            return environment
        radiance = environment.radiance.repeat(self.enlarged, 0).repeat(self.enlarged, 1)
        return EnvironmentMap(radiance, environment.name)


@dataclass(frozen=True)
class Work:
    """What is timed: a sampler's lights at a count, or a shared table where there is no sampler."""

    method: str
    spec: SamplerSpec | None = None
    count: int | None = None


def groups(request: RunRequest) -> list[Group]:
    """A group per map and size."""
    specs = choose_samplers(request.samplers)
    budgets = [Budget.parse(text).lights for text in request.budgets]
    work = [Work(f"{TABLE}{table}") for table in SHARED_TABLES]
    for spec in specs:
        methods = [spec.label, UPDATE] if spec.name == "q2-tree" else [spec.label]
        work += [Work(m, spec, count) for count in counts_for(spec, budgets) for m in methods]
    return [_group(sized, work, request.scale) for sized in sized_maps(request)]


def sized_maps(request: RunRequest) -> list[SizedMap]:
    """Embedded maps at the heights of the scale, files at their own and enlarged to these."""
    heights = of_scale(HEIGHTS, request.scale)
    if request.environments == EMBEDDED:
        patterns = request.maps or EMBEDDED_MAPS
        return [
            SizedMap(source, max(1, height // MOST_MADE))
            for height in heights
            for source in find_environments(EMBEDDED, patterns, min(height, MOST_MADE))
        ]
    found = []
    for source in find_environments(request.environments, request.maps, 0, request.repair):
        found.append(SizedMap(source))
        if request.scale != QUICK:
            own = source.load().height
            factors = dict.fromkeys(round(height / own) for height in heights)
            found += [SizedMap(source, factor) for factor in factors if factor > 1]
    return found


def counts_for(spec: SamplerSpec, budgets: list[int]) -> list[int]:
    """Numbers of lights at which a sampler is timed."""
    wanted = budgets or [COUNTS.get(spec.name, COUNT)]
    return [count for count in wanted if count >= spec.sampler.minimum_count]


def _group(sized: SizedMap, work: list[Work], scale: str) -> Group:
    source, rounds = sized.source, of_scale(ROUNDS, scale)
    by_name = {one.method if one.spec is None else f"{one.method} at {one.count}": one
               for one in work}  # fmt: skip
    depends = {"map": environment_identity(source), "rounds": rounds}
    jobs = {
        name: Job(
            {"environment": source.name, "enlarged": sized.enlarged, "method": one.method,
             **({"count": one.count} if one.spec else {})},
            {**depends, **({"sampler": one.spec.identity} if one.spec else {})},
        )
        for name, one in by_name.items()
    }  # fmt: skip

    def measure(names: Sequence[str]) -> dict[str, Row]:
        wanted = {name: by_name[name] for name in names}
        return _measure(sized.load(), wanted, rounds, of_scale(MOST_SECONDS, scale))

    size = f", {source.height * sized.enlarged} rows" if source.height else ""
    return Group(f"{source.name}{size or f' × {sized.enlarged}'}", jobs, measure)


def _measure(
    environment: EnvironmentMap, work: dict[str, Work], rounds: int, most: float
) -> dict[str, Row]:
    make_tables(environment)
    tasks = {name: _task(environment, one) for name, one in work.items()}
    timings = interleaved(tasks, rounds, 1, most)
    rows: dict[str, Row] = {}
    for name, timing in timings.items():
        rows[name] = {"width": environment.width, **timing.columns()}
        one = work[name]
        if one.spec and one.count and one.method != UPDATE:
            rows[name]["peak_mib"] = peak_of(one.spec, environment, one.count)
    return rows


def _task(environment: EnvironmentMap, work: Work) -> Callable[[], Any]:
    if work.spec is None or work.count is None:
        return table_task(environment, work.method.removeprefix(TABLE))
    rehearse(work.spec)
    if work.method == UPDATE:
        tree, changed = Q2Tree.build(environment, work.count), brightened(environment)
        return lambda: tree.update(changed).lights()
    return partial(_prepare, work.spec, environment, work.count)


def table_task(environment: EnvironmentMap, table: str) -> Callable[[], Any]:
    """Builds one shared table by its own function, from the tables that it is made of."""
    build = getattr(type(environment), table).fget.__wrapped__
    return lambda: build(environment)


def _prepare(spec: SamplerSpec, environment: EnvironmentMap, count: int) -> None:
    spec.sampler.prepare(environment, count, np.random.default_rng(0))


def brightened(environment: EnvironmentMap) -> EnvironmentMap:
    """The map with a square of one hundredth of its texels, on the horizon, four times brighter."""
    height, width = environment.height, environment.width
    side = max(1, round(math.sqrt(CHANGED_SHARE * height * width)))
    top, left = (height - side) // 2, (width - side) // 3
    radiance = environment.radiance.copy()
    radiance[top : top + side, left : left + side] *= np.float32(BRIGHTER)
    changed = EnvironmentMap(radiance, environment.name)
    make_tables(changed)
    return changed
