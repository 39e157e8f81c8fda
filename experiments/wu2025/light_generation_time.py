"""How long making lights takes, per method, map, map size and number of lights.

Reproduces section 4.5 of Wu 2025 and the times that the other papers print. A row is a method on a
map of a size, or a table that methods share: the median of interleaved rounds, and the peak memory
in a process of its own. The Q²-tree is also mended after one hundredth of the texels, a square,
became brighter.

Counts: 64 lights; 300 for FHIS and the Q²-tree, as in their papers; the kd-tree cuts the map into
its 6144 cases whatever the count. With --budget, that number for all. Scales standard and paper
have maps up to 8192×4096, enlarged from smaller ones.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps.sources import EMBEDDED, EnvironmentSource, find_environments
from experiments.report.figures import line_plot
from experiments.report.parts import Items, Part, Plot, Table
from experiments.report.style import label_of
from experiments.report.tables import with_milliseconds
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import environment_identity
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    answer,
    experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.measure import make_tables, peak_of
from experiments.run.rendering import SHARED_TABLES, rehearse_lights
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import QUICK, of_scale
from experiments.wu2025.published import LIGHT_GENERATION, LIGHT_GENERATION_MS
from samplers import EnvironmentMap
from samplers.q2_tree import Q2Tree

OURS, FASTER, SLOWER = "ours", ("median-cut", "variance-minimization"), "tmms"
FORMATS = {
    "environment": "s", "width": "d", "enlarged": "d", "method": "s", "count": ".0f", "ms": ".2f",
    "ms_lower": ".2f", "ms_upper": ".2f", "rounds": "d", "peak_mib": ".1f", "published": "s",
}  # fmt: skip
CAPTION = (
    "Medians and quartiles over interleaved rounds; shared tables exist before a method's clock "
    "starts and are timed apart. `peak mib` is what a method needs at its peak beyond the map and "
    "these tables, in a fresh process. The last column is what the papers print, on machines of "
    "2003 to 2025 and other maps. kd-tree: 6144 cases."
)


@experiment("light-generation-time")
def light_generation_time() -> Study:
    """How long making lights takes, per method and map size, and its peak memory."""
    return Study(
        title="Time to generate lights (Wu 2025, 4.5)",
        sections=(times, plots),
        groups=groups,
        sources=(__name__,),
        figures=(PaperFigure("§4.5", "time to generate lights", slower_and_faster),),
    )


def slower_and_faster(run: Run) -> tuple[str, str]:
    """On how many maps and sizes each rival is faster or slower than ours, as in the paper."""
    found = with_milliseconds(run.rows).pivot_table(
        index=["environment", "width"], columns="method", values="ms"
    )
    found = found.dropna(subset=[OURS])
    told, holds, of = "", 0, 0
    for name in (one for one in (*FASTER, SLOWER) if one in found):
        ratio = (found[name] / found[OURS]).dropna()
        less = int((ratio < 1.0).sum())
        holds, of = holds + (less if name in FASTER else len(ratio) - less), of + len(ratio)
        told += (
            f"; {label_of(name)} {ratio.min():.2f} to {ratio.max():.2f} times as long, "
            f"less on {less}"
        )
    return (
        f"{answer(holds, of)}: {holds} of {of} comparisons alike",
        f"In the paper {label_of(OURS)} takes {LIGHT_GENERATION_MS[OURS]} ms; here "
        f"{found[OURS].min():.1f} to {found[OURS].max():.1f} ms on {len(found)} maps and sizes"
        f"{told}.",
    )


def times(run: Run) -> Iterator[Part]:
    """All rows, fastest first on each map."""
    rows = with_milliseconds(run.rows)
    rows = rows.assign(published=rows["method"].map(LIGHT_GENERATION))
    rows = rows.sort_values(["environment", "width", "ms"], kind="stable", ignore_index=True)
    said = enlarged_sentence(rows), noise_sentence(run.rows)
    yield Items(tuple(filter(None, said)))
    yield Table("light_generation_time", rows, FORMATS, caption=CAPTION)


def enlarged_sentence(rows: pd.DataFrame) -> str:
    """Which maps were enlarged, and how; empty where none was."""
    large = rows[rows["enlarged"] > 1][["environment", "width", "enlarged"]].drop_duplicates()
    listed = [
        f"{environment} to {width}×{width // 2} by {factor}×{factor}"
        for environment, width, factor in large.itertuples(index=False, name=None)
    ]
    return f"Enlarged maps, whose texels are repeated: {', '.join(listed)}." if listed else ""


def plots(run: Run) -> Iterator[Part]:
    """Time and memory against map size, where a map has several."""
    methods = run.rows[~run.rows["method"].str.startswith(TABLE)]
    kinds = {
        "": ("ms", "ms to generate lights", "Time to generate lights against map size"),
        "_memory": ("peak_mib", "peak memory in MiB", "Peak memory against map size"),
    }
    for environment, part in methods.groupby("environment", sort=False):
        if part["width"].nunique() < 2:
            continue
        label = part["method"] + " at " + part["count"].map("{:.0f}".format)
        shown = part.assign(label=label, ms=1e3 * part["seconds"])
        for suffix, (column, axis, caption) in kinds.items():
            drawn = shown[shown[column] > 0.0]
            axes = ("map width in texels", axis)
            draw = partial(line_plot, drawn, "width", column, "label", axes)
            yield Plot(
                f"light_generation_time_{environment}{suffix}", draw, f"{caption}, {environment}."
            )


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
    own = {"environment": source.name, "enlarged": sized.enlarged}
    depends = {"map": environment_identity(source), "rounds": rounds}
    asked = (
        (
            {"method": one.method, **({"count": one.count} if one.spec else {})},
            {"sampler": one.spec.identity} if one.spec else {},
            one,
        )
        for one in work
    )

    def measure(wanted: list[Work]) -> Iterator[Row]:
        environment = sized.load()
        make_tables(environment)
        tasks = {str(k): _task(environment, one) for k, one in enumerate(wanted)}
        timings = interleaved(tasks, rounds, 1, of_scale(MOST_SECONDS, scale))
        for one, timing in zip(wanted, timings.values(), strict=True):
            row = {"width": environment.width, **timing.columns()}
            if one.spec and one.count and one.method != UPDATE:
                row["peak_mib"] = peak_of(one.spec, environment, one.count)
            yield row

    size = f", {source.height * sized.enlarged} rows" if source.height else ""
    label = f"{source.name}{size or f' × {sized.enlarged}'}"
    return Group(label, asked, measure, own, depends)


def _task(environment: EnvironmentMap, work: Work) -> Callable[[], Any]:
    if work.spec is None or work.count is None:
        return table_task(environment, work.method.removeprefix(TABLE))
    rehearse_lights(work.spec)
    if work.method == UPDATE:
        tree, changed = Q2Tree.build(environment, work.count), brightened(environment)
        return lambda: tree.update(changed).lights()
    sampler, count = work.spec.sampler, work.count
    return lambda: sampler.prepare(environment, count, np.random.default_rng(0))


def table_task(environment: EnvironmentMap, table: str) -> Callable[[], Any]:
    """Builds one shared table by its own function, from the tables that it is made of."""
    build = getattr(type(environment), table).fget.__wrapped__
    return lambda: build(environment)


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
