"""Whether the paper's 4 seconds at 1600×1200 with 4 sub-pixels can be kept by every sampler.

Wu, "Efficient environment map rendering based on decomposition", 2025, gives every method 4 s an
image. Each sampler renders a scene under a map at the count that budgets of seconds choose for it,
then once more in a process of its own, which makes view and lights itself and tells its peak
memory.
"""

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

import pandas as pd

from experiments.maps.sources import EMBEDDED, find_environments
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.machine import in_fresh_process, peak_memory_mib
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene
from experiments.run.sampler_spec import choose_samplers
from experiments.run.scale import SCALES, Scale
from experiments.run.timed import allowed_counts, alone_on_the_machine, time_at_budget
from samplers.threads import set_thread_count, thread_count

SCENE, MAP = "vase", "noon-desert"
REHEARSAL = "three-boxes"


def shares(
    samplers: Sequence[str] = (), seconds: float = 4.0, scale: Scale = SCALES["paper"]
) -> pd.DataFrame:
    """Measure every sampler: a row each, with the share of the budget that its image takes."""
    case = Case(SCENE, find_environments(EMBEDDED, [MAP], scale.map_height)[0], scale)
    budget = Budget.parse(f"seconds={seconds}")
    measurements = [Measurement(case, spec, budget, 0) for spec in choose_samplers(list(samplers))]
    rows = []
    with alone_on_the_machine():
        found = time_at_budget(CaseScene.of(case), measurements)
        for one, timed in found.items():
            if isinstance(timed, Exception):
                raise timed
            least, count = allowed_counts(one).least, timed.shot.count
            taken = timed.timing.median
            rows.append(
                {
                    "sampler": one.sampler.label,
                    "least_count": least,
                    "count": count,
                    "seconds": taken,
                    "ratio": taken / seconds,
                    **in_fresh_process(_by_itself, one, count, thread_count()),
                }
            )
    return pd.DataFrame(rows)


def _by_itself(measurement: Measurement, count: int, threads: int) -> dict[str, float]:
    """All that one image takes, from nothing: seconds of view and lights, and peak memory, MiB."""
    set_thread_count(threads)
    case = measurement.case
    # Loads the map and all kernels, in little memory.
    CaseScene.of(replace(case, scene=REHEARSAL), case.scale.width // 16).shoot(
        measurement, allowed_counts(measurement).least
    )
    started = perf_counter()
    scene = CaseScene.of(case)
    seconds = perf_counter() - started
    shot = scene.shoot(measurement, count)
    return {
        "seconds_view": seconds,
        "seconds_lights": shot.seconds_lights,
        "peak_mib": peak_memory_mib(),
    }
