"""How long making lights takes, per method, map, map size and number of lights.

Reproduces section 4.5 of Wu, "Efficient environment map rendering based on decomposition", 2025,
and the times that the other papers print. `prepare` is timed on a map whose shared tables exist;
the tables are timed apart, each on its own with what it needs. Methods run in interleaved rounds.
The Q²-tree is also mended after one hundredth of the texels, a square, became brighter. Peak
memory is measured for each method in a process of its own.

Counts: 64 lights; 300 for FHIS and the Q²-tree, as in their papers; the kd-tree cuts the map into
its 6144 cases whatever the count. With --budget, that number for all.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps.sources import EMBEDDED, EnvironmentSource, find_environments
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.budget import Budget
from experiments.run.rendering import SHARED_TABLES
from experiments.run.request import RunRequest
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.study import Group, Job, Row, Study, run_study
from experiments.wu2025.light_generation_memory import peak_of, rehearse
from samplers import EnvironmentMap
from samplers.q2_tree import Q2Tree

NAME = "light-generation-time"
TITLE = "Time to generate lights (Wu 2025, 4.5)"
EMBEDDED_MAPS = ["noon-desert", "room-one-window"]
HEIGHTS = {"quick": (256, 512), "standard": (512, 2048), "paper": (512, 1024, 2048)}
ROUNDS = {"quick": 5, "standard": 11, "paper": 11}
MOST_SECONDS = {"quick": 1.0, "standard": 10.0, "paper": 30.0}
COUNT = 64
COUNTS = {"fhis": 300, "q2-tree": 300}
CHANGED_SHARE = 0.01
BRIGHTER = 4.0
UPDATE = "q2-tree update, 1 % changed"
FORMATS = {
    "environment": "s", "width": "d", "method": "s", "count": "d", "ms": ".2f", "ms_lower": ".2f",
    "ms_upper": ".2f", "rounds": "d", "peak_mib": ".1f", "published": "s",
}  # fmt: skip
PUBLISHED = {
    "ours": "185.7 ms",
    "ours-no-upsampling": "185.7 ms",
    "median-cut": "about 10 ms",
    "variance-minimization": "about 10 ms",
    "tmms": "seconds",
    "fhis": "70 ms at 300, its tables made before",
    "q2-tree": "700 ms a map at 300",
    UPDATE: "410 ms a coherent frame at 300",
    "center-surround": "0.5-1.5 h",
}
"""As printed by the papers, on their machines of 2003 to 2025 and maps of their own."""


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    specs = list(choose_samplers(request.samplers))
    budgets = [Budget.parse(text).lights for text in request.budgets]
    rounds, most = ROUNDS.get(request.scale, 11), MOST_SECONDS.get(request.scale, 10.0)
    groups = [_group(source, specs, budgets, rounds, most) for source in _sources(request)]
    sources = ("experiments.run.bench", "experiments.wu2025.light_generation_memory")
    return run_study(Study(NAME, sources, groups, report), request, dry_run)


def _sources(request: RunRequest) -> list[EnvironmentSource]:
    """Embedded maps at each height of the scale; files as they are."""
    if request.environments != EMBEDDED:
        return find_environments(request.environments, request.maps, 0, request.repair)
    patterns = request.maps or EMBEDDED_MAPS
    heights = HEIGHTS.get(request.scale, HEIGHTS["quick"])
    return [
        source for height in heights for source in find_environments(EMBEDDED, patterns, height)
    ]


def counts_for(spec: SamplerSpec, budgets: list[int]) -> list[int]:
    """Numbers of lights at which a sampler is timed."""
    wanted = budgets or [COUNTS.get(spec.name, COUNT)]
    return [count for count in wanted if count >= spec.sampler.minimum_count]


def _group(
    source: EnvironmentSource, specs: list[SamplerSpec], budgets: list[int], rounds: int,
    most: float,
) -> Group:  # fmt: skip
    identity = source.identity
    jobs = {
        f"table {table}": Job(
            {"environment": source.name, "height": source.height, "method": f"table {table}"},
            {"map": identity, "rounds": rounds},
        )
        for table in SHARED_TABLES
    }
    work: dict[str, tuple[SamplerSpec, int]] = {}
    for spec in specs:
        for count in counts_for(spec, budgets):
            methods = [spec.label, UPDATE] if spec.name == "q2-tree" else [spec.label]
            for method in methods:
                name = f"{method} at {count}"
                columns = {
                    "environment": source.name, "height": source.height, "method": method,
                    "count": count,
                }  # fmt: skip
                depends = {"map": identity, "sampler": spec.identity, "rounds": rounds}
                jobs[name], work[name] = Job(columns, depends), (spec, count)

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return _measure(source.load(), {n: work.get(n) for n in names}, rounds, most)

    label = f"{source.name}, {source.height} rows" if source.height else source.name
    return Group(label, jobs, measure)


def _measure(
    environment: EnvironmentMap, work: dict[str, tuple[SamplerSpec, int] | None], rounds: int,
    most: float,
) -> dict[str, Row]:  # fmt: skip
    tasks: dict[str, Callable[[], Any]] = {}
    for table in SHARED_TABLES:
        getattr(environment, table)
    for name, what in work.items():
        if what is None:
            tasks[name] = _table_task(environment, name.removeprefix("table "))
            continue
        spec, count = what
        rehearse(spec)
        if name.startswith(UPDATE):
            tree = Q2Tree.build(environment, count)
            tasks[name] = partial(_update, tree, brightened(environment))
        else:
            tasks[name] = partial(_prepare, spec, environment, count)
    timings = interleaved(tasks, rounds, 1, most)
    rows: dict[str, Row] = {}
    for name, timing in timings.items():
        rows[name] = {"width": environment.width, **timing.columns()}
        what = work[name]
        if what and not name.startswith(UPDATE):
            rows[name]["peak_mib"] = peak_of(what[0], environment, what[1])
    return rows


def _table_task(environment: EnvironmentMap, table: str) -> Callable[[], Any]:
    """Builds one shared table by its own function, from the tables that it is made of."""
    build = getattr(type(environment), table).fget.__wrapped__
    return lambda: build(environment)


def _prepare(spec: SamplerSpec, environment: EnvironmentMap, count: int) -> None:
    spec.sampler.prepare(environment, count, np.random.default_rng(0))


def _update(tree: Q2Tree, environment: EnvironmentMap) -> None:
    tree.update(environment).lights()


def brightened(environment: EnvironmentMap) -> EnvironmentMap:
    """The map with a square of one hundredth of its texels, on the horizon, four times brighter."""
    height, width = environment.height, environment.width
    side = max(1, round(math.sqrt(CHANGED_SHARE * height * width)))
    top, left = (height - side) // 2, (width - side) // 3
    radiance = environment.radiance.copy()
    radiance[top : top + side, left : left + side] *= np.float32(BRIGHTER)
    changed = EnvironmentMap(radiance, environment.name)
    for table in SHARED_TABLES:
        getattr(changed, table)
    return changed


def report(rows: pd.DataFrame, folder: Path) -> list[Path]:
    """The table, and time against map size."""
    from experiments.report.frames import present
    from experiments.report.line_plot import write_lines

    shown = rows.assign(
        ms=1e3 * rows["seconds"],
        ms_lower=1e3 * rows["seconds_lower"],
        ms_upper=1e3 * rows["seconds_upper"],
        published=rows["method"].map(PUBLISHED),
    )
    shown["count"] = shown["count"].astype("Int64") if "count" in shown else pd.NA
    if "peak_mib" not in shown:
        shown["peak_mib"] = np.nan
    order = ["environment", "width", "ms"]
    shown = shown.sort_values(order, kind="stable").reset_index(drop=True)
    notes = [
        "Medians and quartiles over interleaved rounds; shared tables exist before a method's "
        "clock starts and are timed apart. `peak mib` is what a method needs at its peak beyond "
        "the map and these tables, in a fresh process. The last column is what the papers print, "
        "on other machines and maps. kd-tree: 6144 cases.",
        noise_sentence(rows),
    ]
    files = present(folder, NAME.replace("-", "_"), shown, FORMATS, TITLE, notes)
    for environment, part in shown[~shown["method"].str.startswith("table ")].groupby(
        "environment", sort=False
    ):
        if part["width"].nunique() > 1:
            labelled = part.assign(label=part["method"] + " at " + part["count"].astype(str))
            axes = ("map width in texels", "ms to generate lights")
            stem = f"light_generation_time_{environment}"
            files += write_lines(folder, stem, labelled, "width", "ms", "label", axes)
    return files
