"""How long references at 640×480 pixels take to reach their noise target, per map and scene.

A case's reference is that which any experiment makes, with the noise target and the cap on samples
of scale standard, in an empty folder and a process of its own; map, view and kernels are there when
the clock starts.
"""

import tempfile

import numpy as np
import pandas as pd

from experiments.maps.sources import find_environments
from experiments.run.case import Case
from experiments.run.experiment import TEST_SCENES
from experiments.run.machine import in_fresh_process, peak_memory_mib
from experiments.run.measure import ReferenceTask, measure_reference
from experiments.run.rendering import CaseScene
from experiments.run.scale import SCALES, Scale
from experiments.run.timed import alone_on_the_machine
from renderer import scenes
from renderer.reference import render_reference
from renderer.view import make_view
from samplers import EnvironmentMap
from samplers.threads import set_thread_count, thread_count


def times(environments: str, maps: list[str], scale: Scale = SCALES["standard"]) -> pd.DataFrame:
    """Make every reference; a row each: seconds, samples per shading point, rays, peak memory."""
    sources = find_environments(environments, maps, scale.map_height)
    rows = []
    for case in (Case(scene, source, scale) for source in sources for scene in TEST_SCENES):
        with tempfile.TemporaryDirectory() as place, alone_on_the_machine():
            row = in_fresh_process(_make, ReferenceTask(case, place), thread_count())
        rows.append({"scene": case.scene, "environment": case.environment.name, **row})
        print(f"{case}: {row['seconds']:.1f} s", flush=True)
    return pd.DataFrame(rows)


def _make(task: ReferenceTask, threads: int) -> dict[str, float]:
    set_thread_count(threads)
    CaseScene.of(task.case)
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (16, 32, 3))
    environment = EnvironmentMap.from_array(radiance, "rehearsal")
    render_reference(make_view(scenes.make("three-boxes"), 16, 12, 1), environment, 0.01, 256)
    made = measure_reference(task)
    kept = {name: float(made[name]) for name in ("seconds", "samples", "rays")}
    return {**kept, "peak_mib": peak_memory_mib()}


def by_scene(rows: pd.DataFrame) -> pd.DataFrame:
    """Median, most and total seconds and the largest peak of each scene, then of all."""
    parts = [*rows.groupby("scene", sort=False), ("all", rows)]
    return pd.DataFrame(
        {
            "scene": scene,
            "maps": part["environment"].nunique(),
            "median_seconds": part["seconds"].median(),
            "most_seconds": part["seconds"].max(),
            "slowest": part["environment"].iloc[int(part["seconds"].argmax())],
            "total_seconds": part["seconds"].sum(),
            "peak_mib": part["peak_mib"].max(),
        }
        for scene, part in parts
    )
