"""What a run of very many measurements costs beside measuring.

`python -m tests.robustness.many_rows [COUNT] [store serial processes dask]` tells it.

Measurements of a real grid do nothing: a worker gives back a row as large as others are. What is
told: how long it takes to list what is left, to store rows, to have them done by an executor, and
to write the run's rows, and the peak memory of the whole process.
"""

import argparse
import contextlib
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import Budget
from experiments.run.grid import GridPlan, case_groups, left_to_do
from experiments.run.kept_images import FIRST_HALF, keep_reference, pixel_digest
from experiments.run.machine import in_fresh_process, peak_memory_mib
from experiments.run.measure import Measured, MeasurementTask, ReferenceTask
from experiments.run.measurement import Grid, Measurement
from experiments.run.runner import Runner, left_of, write_rows
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import find_scale
from experiments.run.start import make_executor
from experiments.run.store import IMAGE, PIXELS, Store
from experiments.wu2025.table1 import table1
from metrics.registry import metrics
from samplers.threads import set_thread_count

SAMPLERS = ("mis", "uniform", "median-cut", "ours")
CASES = 128
IMAGES = np.zeros((1, 1, 3), np.float32)


def nothing(task: MeasurementTask) -> Measured:
    """A row as large as others are."""
    one = task.measurement
    row: dict[str, Any] = {
        "scene": one.case.scene, "environment": one.case.environment.name,
        "sampler": one.sampler.label, "budget": str(one.budget), "seed": one.seed,
        "scale": one.case.scale.name, "league": "fixed lights", "machine": "a processor",
        "repaired": 0, "over_budget": False, PIXELS: "0" * 24, "count": 16,
    }  # fmt: skip
    row |= {f"number_{k}": one.seed / 7.0 + k for k in range(10)}
    scores = {name: {f"{name}_{k}": one.seed / 3.0 + k for k in range(3)} for name in task.metrics}
    features = {name: {f"map_{k}": 0.5 for k in range(8)} for name in task.features}
    return Measured(row, scores, features)


def no_reference(task: ReferenceTask) -> dict[str, Any]:
    """A reference of a pixel."""
    keep_reference(Path(task.folder), task.case, IMAGES, IMAGES)
    digest = pixel_digest(IMAGES)
    return {PIXELS: digest, FIRST_HALF: digest, "noise_floor": 0.01}


def measurements(count: int) -> Iterator[Measurement]:
    """So many of a grid of 128 cases."""
    environments = tuple(EnvironmentSource(f"map-{k}", height=16) for k in range(CASES // 4))
    each = -(-count // (CASES * 8))
    grid = Grid(
        ("vase", "teapot", "birdcage", "rubiks-cube"), environments,
        tuple(map(SamplerSpec, SAMPLERS)), tuple(map(Budget, (8, 16))), find_scale("quick"),
    )  # fmt: skip
    # Every sampler with many seeds, the deterministic ones, too.
    wide = (
        replace(one, seed=seed) for one in grid.measurements() if one.seed == 0
        for seed in range(each)
    )  # fmt: skip
    return islice(wide, count)


def plan_of(count: int) -> GridPlan:
    """A start that is about so many."""
    groups = [
        replace(group, measure=nothing, reference=no_reference)
        for group in case_groups(measurements(count), images=False)
    ]
    return GridPlan(table1(), groups, {"bad_maps": {}})


@contextlib.contextmanager
def timed(what: str, count: int) -> Iterator[None]:
    started, before = time.perf_counter(), time.process_time()
    yield
    seconds, processor = time.perf_counter() - started, time.process_time() - before
    print(
        f"{what:<44}{seconds:8.2f} s{processor:8.2f} s of this process"
        f"{1e3 * seconds / count:8.3f} ms each{count / seconds:10.0f} / s", flush=True,
    )  # fmt: skip


def stored(store: Store, plan: GridPlan) -> None:
    """Put the rows themselves, without an executor."""
    for group in plan.groups:
        shared = group.case.score_identities
        names = tuple(metric.name for metric in metrics())
        for one in group.tasks:
            found = nothing(MeasurementTask(one, "", 0.0, False, names))
            scores = {shared[name].key: row for name, row in found.scores.items()}
            store.put(IMAGE, one.key, one.identity, found.image, scores, shared.values())


def run(kind: str, count: int) -> None:
    """By an executor, into a folder of its own; then list what is left, and write the rows."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        with timed(f"{kind}: making the list", count):
            plan = plan_of(count)
        with Store.writing(folder) as store:
            if kind != "store":
                print(f"{kind}: all to do: {len(left_to_do(plan.groups, store).measurements)}")
            with timed(f"{kind}: keys, and beginning", count):
                planned = [one for group in plan.groups for one in group.planned()]
                store.begin({"started": "", "commit": "", "load_average": 0.0, "command": ""},
                            plan.about, planned)  # fmt: skip
            if kind == "store":
                with timed("store: rows that are there already made", count):
                    stored(store, plan)
            else:
                workers = 0 if kind == "serial" else 2
                threads = 1 if kind in ("processes", "dask") else 0
                with make_executor(kind, workers, threads) as executor:
                    if kind == "dask":
                        executor._client.wait_for_workers(2)
                    with timed(f"{kind}: measured and stored", count):
                        outcome = Runner(store).run(left_of(plan.groups, store), executor)
                assert (outcome.measured, outcome.failures) == (count, []), outcome.failures[:3]
                again = plan_of(count)
                with timed(f"{kind}: what is left of all, by a new start", count):
                    left = left_to_do(again.groups, store)
                assert (left.measurements, left.references) == ([], 0)
                with timed(f"{kind}: rows and record", count):
                    write_rows(again, store, {})
        print(f"{kind}: peak {peak_memory_mib():.0f} MiB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=100_000)
    parser.add_argument("kinds", nargs="*", default=["store", "serial", "processes", "dask"])
    given = parser.parse_args()
    set_thread_count(1)
    for kind in given.kinds:
        in_fresh_process(partial(run, kind, given.count))


if __name__ == "__main__":
    main()
