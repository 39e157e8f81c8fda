"""What the tables of today's renderers take: seconds to build, bytes, samples per second.

The samplers are those of `renderers`. A table is built from a map that is there, its shared tables
too, since a map serves many images; samples are drawn, and densities of given directions looked
up, on one thread from the same random numbers. All samplers of a map are timed in interleaved
rounds. Bytes are those of all arrays that a distribution holds.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.sources import EnvironmentSource
from experiments.questions.renderers import EXACT, table_samplers
from experiments.report.parts import Part, Table, Text
from experiments.report.sentences import counted
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.rendering import SHARED_TABLES
from experiments.run.request import RunRequest
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from experiments.run.timed import alone_on_the_machine
from samplers import EnvironmentMap, EnvlightError, LightDistribution
from samplers.threads import for_blocks, set_thread_count, thread_count

MAPS = ["noon-desert", "room-one-window", "overcast-moor"]
HEIGHTS = {"quick": 256, "standard": 1024, "paper": 2048}
SAMPLES = {"quick": 1 << 17, "standard": 1 << 20, "paper": 1 << 20}
ROUNDS = {"quick": 5, "standard": 11, "paper": 11}
BLOCK = 1 << 13
FORMATS = {
    "environment": "s", "width": "d", "sampler": "s", "build_ms": ".1f", "mib": ".2f",
    "million_samples": ".2f", "million_densities": ".2f", "speed": ".2f",
}  # fmt: skip
HEADINGS = {
    "mib": "MiB", "million_samples": "samples, M/s", "million_densities": "densities, M/s",
    "speed": f"samples × {EXACT}",
}  # fmt: skip


@experiment("renderer-tables")
def renderer_tables() -> Study:
    """Build time, bytes and samples per second of the tables of today's renderers."""
    return Study(
        title="What the tables of today's renderers take",
        sections=(costs,),
        groups=groups,
        sources=(__name__,),
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map."""
    own = table_samplers()
    specs = choose_samplers(request.samplers, own) if request.samplers else own
    height = of_scale(HEIGHTS, request.scale)
    samples, rounds = of_scale(SAMPLES, request.scale), of_scale(ROUNDS, request.scale)
    sources = study_environments(request, MAPS, height)
    return [_group(source, specs, samples, rounds) for source in sources]


def _group(
    source: EnvironmentSource, specs: Sequence[SamplerSpec], samples: int, rounds: int
) -> Group:
    by_label = {spec.label: spec for spec in specs}
    depends = {"map": environment_identity(source), "samples": samples, "rounds": rounds}
    jobs = {
        label: Job(
            {"environment": source.name, "sampler": label}, {**depends, "sampler": spec.identity}
        )
        for label, spec in by_label.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        environment = source.load()
        with alone_on_the_machine():
            return _measure(environment, {n: by_label[n] for n in names}, samples, rounds)

    return Group(source.name, jobs, measure)


def _measure(
    environment: EnvironmentMap, specs: dict[str, SamplerSpec], samples: int, rounds: int
) -> dict[str, Row]:
    for table in SHARED_TABLES:
        getattr(environment, table)
    u = np.random.default_rng(0).random((samples, 3), np.float32)
    made = {name: build(spec, environment) for name, spec in specs.items()}
    tasks: dict[str, Callable[[], Any]] = {}
    for name, lighting in made.items():
        tasks[f"{name} build"] = partial(build, specs[name], environment)
        tasks[f"{name} sample"] = partial(_in_blocks, lighting.sample, u)
        directions = lighting.sample(u)[0]
        tasks[f"{name} pdf"] = partial(_in_blocks, lighting.pdf, directions)
    before = thread_count()
    set_thread_count(1)
    try:
        timings = interleaved(tasks, rounds)
    finally:
        set_thread_count(before)
    return {
        name: {
            "width": environment.width,
            "bytes": held_bytes(lighting),
            "samples": samples,
            "seconds_build": timings[f"{name} build"].median,
            "seconds_pdf": timings[f"{name} pdf"].median,
            **timings[f"{name} sample"].columns("seconds_sample"),
        }
        for name, lighting in made.items()
    }


def build(spec: SamplerSpec, environment: EnvironmentMap) -> LightDistribution:
    """The distribution of a map; EnvlightError for a sampler of another kind."""
    lighting = spec.sampler.prepare(environment, 2, np.random.default_rng(0))
    if not isinstance(lighting, LightDistribution):
        raise EnvlightError(
            f"renderer-tables: {spec.label} gives lights, not a distribution; choose others"
        )
    return lighting


def _in_blocks(function: Callable[[NDArray], Any], numbers: NDArray[np.float32]) -> None:
    def block(start: int, stop: int) -> None:
        function(numbers[start:stop])

    for_blocks(block, len(numbers), BLOCK)


def held_bytes(held: Any) -> int:
    """Bytes of all arrays in a dataclass and the dataclasses within it, each counted once."""
    return sum(array.nbytes for array in _arrays(held, set()))


def _arrays(held: Any, seen: set[int]) -> Iterator[NDArray]:
    if id(held) in seen:
        return
    seen.add(id(held))
    if isinstance(held, np.ndarray):
        yield held
    elif is_dataclass(held):
        for field in fields(held):
            yield from _arrays(getattr(held, field.name), seen)


def with_rates(rows: pd.DataFrame) -> pd.DataFrame:
    """Rates, and the speed of sampling over that of the exact table on the same map."""
    rates = rows.assign(
        build_ms=1e3 * rows["seconds_build"],
        mib=rows["bytes"] / 2**20,
        million_samples=rows["samples"] / rows["seconds_sample"] / 1e6,
        million_densities=rows["samples"] / rows["seconds_pdf"] / 1e6,
    )
    exact = rates[rates["sampler"] == EXACT].set_index("environment")["million_samples"]
    return rates.assign(speed=rates["million_samples"] / rates["environment"].map(exact))


def findings(run: Run) -> list[str]:
    """How many samples a second each draws, over the exact table's."""
    speed = with_rates(run.rows).groupby("sampler", sort=False)["speed"]
    told = ", ".join(
        f"{name} {low:.2f} to {high:.2f}"
        for (name, low), high in zip(speed.min().items(), speed.max(), strict=True)
        if name != EXACT
    )
    maps = counted(run.rows["environment"].nunique(), "map")
    return [f"Samples a second over those of {EXACT}, on {maps}: {told}."]


def costs(run: Run) -> Iterator[Part]:
    """The table."""
    yield Table("renderer_tables", with_rates(run.rows), FORMATS, HEADINGS)
    yield Text(
        "One thread. Building starts from the map with its luminance and flux, which all samplers "
        "share. Samples come with their densities; `densities` are those of given directions, as "
        "BRDF samples need them."
    )
    yield Text(noise_sentence(run.rows))
