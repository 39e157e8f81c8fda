"""What does my renderer's table cost me? The tables of today's renderers at equal work.

pbrt-v4, Mitsuba 3, Cycles, Falcor and LuxCore draw directions towards a map by a table each, all
beside BRDF sampling; they differ in its size, in what weighs a texel, and in whether what BRDF
sampling covers is taken off. Each renders as it ships and with compensation the other way, beside
the exact table of `mis` and `mis-compensated`: at equal numbers of samples, of rays and, but at
scale quick, of seconds.

`renderer-tables` tells what the tables take: seconds to build, bytes of all arrays, samples a
second, on one thread and in interleaved rounds.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.ergun2012.throughput import in_blocks, on_threads
from experiments.maps.sources import EnvironmentSource
from experiments.questions.comparison import Comparison, compare, comparisons
from experiments.report.parts import Heading, Part, Table, Text, counted
from experiments.report.sections.ranks import ranked
from experiments.report.style import label_of
from experiments.run.bench import interleaved, noise_sentence, over_baseline
from experiments.run.budget import Budget
from experiments.run.case import environment_identity
from experiments.run.experiment import GridExperiment, Group, Row, RunRequest, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.measure import make_tables
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import QUICK, Scale, of_scale
from experiments.run.study import study_environments
from experiments.run.timed import alone_on_the_machine
from experiments.wu2025.published import seconds_budget
from metrics.registry import NEAR, ranked_metrics
from samplers import EnvironmentMap, EnvlightError, LightDistribution, sampler_class, sampler_names

EXACT = "mis"
"""What every table is compared with."""
RENDERERS = ("pbrt-v4", "mitsuba-3", "cycles", "falcor", "luxcore")
SWITCH = "compensation"
EQUAL_SAMPLES, RAYS = (8, 32), 16
COST_FORMATS = {"sampler": "s", "error": ".4f", "ratio": "s", "wins": "s"}


@experiment("renderers")
def renderers() -> GridExperiment:
    """What the tables of today's renderers cost in error, at equal samples, rays and time."""
    return GridExperiment(
        title="Tables of today's renderers",
        sections=(beside_exact, with_and_without, ranked()),
        samplers=table_samplers,
        budgets=equal_work,
        quick_scenes=2,
        quick_maps=1,
    )


def equal_work(scale: Scale) -> tuple[Budget, ...]:
    """Samples and rays, and the paper's seconds per pixel where there is time for them."""
    free = (*map(Budget, EQUAL_SAMPLES), Budget(RAYS, "rays"))
    return free if scale.name == QUICK else (*free, *seconds_budget(scale))


def table_samplers() -> tuple[SamplerSpec, ...]:
    """The exact tables, then each renderer's as it ships and with compensation the other way."""
    known = sampler_names()
    exact = [name for name in (EXACT, "mis-compensated") if name in known]
    found = [SamplerSpec(name) for name in exact]
    for name in (name for name in RENDERERS if name in known):
        ships = next(f.default for f in fields(sampler_class(name)) if f.name == SWITCH)
        found += [SamplerSpec(name), SamplerSpec(name, ((SWITCH, not ships),))]
    return tuple(found)


def beside_exact(run: Run) -> Iterator[Part]:
    """Errors and their ratios to those of the exact table, at each budget."""
    if EXACT not in run.samplers:
        return
    yield Heading(f"Beside the exact table of {label_of(EXACT)}")
    if any(Budget.parse(budget).timed for budget in run.budgets):
        yield Text(
            "Equal seconds are those of this project's code, which draws, looks up and traces "
            f"samples of the kind of table of {label_of(EXACT)} in one pass, and those of the "
            "others in several: they tell of this code first. `renderer-tables` tells how fast "
            "each table is alone."
        )
    for budget in run.budgets:
        for metric in reversed(ranked_metrics()):
            rows = run.at(budget)
            there = set(rows["sampler"]) if metric.name in rows else set()
            lines = [
                _beside_line(compare(rows, EXACT, label, metric), budget)
                for label in run.samplers
                if EXACT in there and label in there - {EXACT}
            ]
            if lines:
                headings = {"error": metric.label, "ratio": f"× {label_of(EXACT)}"}
                caption = f"{metric.label} at {budget}."
                best = {"error": metric.better}
                table = pd.DataFrame(lines)
                yield Table("beside_exact", table, COST_FORMATS, headings, best, caption)
    yield Text(
        "Errors are means over maps; ratios are geometric means over maps with the 95 % interval "
        "of a bootstrap over them; `wins` counts maps with less error than that of the exact "
        f"table. An error within {NEAR:g}× of what the references' own noise gives counts as "
        f"{NEAR:g}× that in ratios and wins."
    )


def _beside_line(one: Comparison, budget: str) -> Row:
    over = one.overall
    return {
        "budget": budget, "metric": one.metric.name, "sampler": one.reading,
        "error": one.error.get(budget, float("nan")), "ratio": over.text, "times": over.ratio,
        "low": over.low, "high": over.high, "wins": f"{over.wins} of {over.maps}",
    }  # fmt: skip


def with_and_without(run: Run) -> Iterator[Part]:
    """What compensation changes, renderer by renderer, over all budgets."""
    lines = [
        {
            "metric": metric.label, "equal": one.equal, "sampler": one.reading,
            "ratio": one.overall.text, "wins": f"{one.overall.wins} of {one.overall.maps}",
        }
        for metric in reversed(ranked_metrics())
        if metric.name in run.rows
        for one in comparisons(run.rows, metric)
    ]  # fmt: skip
    if lines:
        headings = {"equal": "at equal", "ratio": "× as it ships"}
        yield Heading("Compensation the other way, over all budgets")
        yield Table("compensation", pd.DataFrame(lines), dict.fromkeys(lines[0], "s"), headings)


MAPS = ["noon-desert", "room-one-window", "overcast-moor"]
HEIGHTS = {"quick": 256, "standard": 1024, "paper": 2048}
SAMPLES = {"quick": 1 << 17, "standard": 1 << 20, "paper": 1 << 20}
ROUNDS = {"quick": 5, "standard": 11, "paper": 11}
FORMATS = {
    "environment": "s", "width": "d", "sampler": "s", "build_ms": ".1f", "mib": ".2f",
    "million_samples": ".2f", "million_densities": ".2f", "speed": ".2f",
}  # fmt: skip
HEADINGS = {
    "mib": "MiB", "million_samples": "samples, M/s", "million_densities": "densities, M/s",
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
    depends = {"map": environment_identity(source), "samples": samples, "rounds": rounds}
    asked = (({"sampler": spec.label}, {"sampler": spec.identity}, spec) for spec in specs)

    def measure(specs: list[SamplerSpec]) -> Iterator[Row]:
        with alone_on_the_machine():
            yield from on_threads(1, _measured, source.load(), specs, samples, rounds)

    return Group(source.name, asked, measure, {"environment": source.name}, depends)


def _measured(
    environment: EnvironmentMap, specs: list[SamplerSpec], samples: int, rounds: int
) -> list[Row]:
    make_tables(environment)
    u = np.random.default_rng(0).random((samples, 3), np.float32)
    made = {spec.label: build(spec, environment) for spec in specs}
    tasks: dict[str, Callable[[], Any]] = {
        f"{spec.label} build": partial(build, spec, environment) for spec in specs
    }
    for name, lighting in made.items():
        tasks[f"{name} sample"] = partial(in_blocks, lighting.sample, u)
        tasks[f"{name} pdf"] = partial(in_blocks, lighting.pdf, lighting.sample(u)[0])
    timings = interleaved(tasks, rounds)
    return [
        {
            "width": environment.width,
            "bytes": held_bytes(lighting),
            "samples": samples,
            "seconds_build": timings[f"{name} build"].median,
            "seconds_pdf": timings[f"{name} pdf"].median,
            **timings[f"{name} sample"].columns("seconds_sample"),
        }
        for name, lighting in made.items()
    ]


def build(spec: SamplerSpec, environment: EnvironmentMap) -> LightDistribution:
    """The distribution of a map; EnvlightError for a sampler of another kind."""
    lighting = spec.sampler.prepare(environment, 2, np.random.default_rng(0))
    if not isinstance(lighting, LightDistribution):
        raise EnvlightError(
            f"renderer-tables: {spec.label} gives lights, not a distribution; choose others"
        )
    return lighting


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
    speed = over_baseline(rates, "million_samples", "sampler", EXACT, ["environment"])
    return rates.assign(speed=speed)


def findings(run: Run) -> list[str]:
    """How many samples a second each draws, over the exact table's."""
    speed = with_rates(run.rows).groupby("sampler", sort=False)["speed"]
    told = ", ".join(
        f"{label_of(str(name))} {low:.2f} to {high:.2f}"
        for (name, low), high in zip(speed.min().items(), speed.max(), strict=True)
        if name != EXACT
    )
    maps = counted(run.rows["environment"].nunique(), "map")
    return [f"Samples a second over those of {label_of(EXACT)}, on {maps}: {told}."]


def costs(run: Run) -> Iterator[Part]:
    """The table."""
    headings = HEADINGS | {"speed": f"samples × {label_of(EXACT)}"}
    yield Table("renderer_tables", with_rates(run.rows), FORMATS, headings)
    yield Text(
        "One thread. Building starts from the map with its luminance and flux, which all samplers "
        "share. Samples come with their densities; `densities` are those of given directions, as "
        "BRDF samples need them."
    )
    yield Text(noise_sentence(run.rows))
