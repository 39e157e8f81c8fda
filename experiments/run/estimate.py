"""How long a grid will take: an estimate from rendering one tiny view by every sampler.

Each sampler prepares a lighting on the first map and renders a small view of the first scene, and
so does the reference's estimator. Times of rendering grow with sub-pixels × lights, those of
preparing do not, and measurements with a budget of seconds take what their rounds take, one after
another. Metrics, other maps and what is stored already are not looked at: it is an estimate.
"""

import time
from dataclasses import replace

from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.grid import Grid
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene
from experiments.run.scale import Scale
from experiments.run.timed import FINAL_ROUNDS, SEARCH_ROUNDS
from renderer.reference import render_reference

WIDTH, HEIGHT = 48, 36
PROBE_LIGHTS = 16
SEARCHES = 3
"""Counts that the search for a time tries, about."""
WORKERS = (8, 32)


def estimate(grid: Grid) -> str:
    """One sentence: hours on this machine, and on several like it."""
    measurements, scale = grid.measurements(), grid.scale
    small = Case(grid.scenes[0], grid.environments[0], replace(scale, width=WIDTH, height=HEIGHT))
    scene = CaseScene.of(small)
    enlarged = scale.width * scale.height / (WIDTH * HEIGHT)
    costs = {
        spec.label: _seconds(scene, Measurement(small, spec, Budget(1), 0))
        for spec in grid.samplers
    }
    seconds = (
        enlarged
        * _reference_seconds(scene, scale)
        * len({measurement.case for measurement in measurements})
    )
    timed = 0.0
    for measurement in measurements:
        prepare, light = costs[measurement.sampler.label]
        if measurement.budget.timed:
            timed += prepare + (FINAL_ROUNDS + SEARCHES * SEARCH_ROUNDS) * measurement.budget.amount
        else:
            seconds += prepare + enlarged * light * measurement.budget.amount
    hours = [(seconds / count + timed) / 3600.0 for count in (1, *WORKERS)]
    others = " or ".join(f"{h:.2g} on {n}" for h, n in zip(hours[1:], WORKERS, strict=True))
    return f"about {hours[0]:.2g} hours on this machine, {others} like it (from one small view)"


def _seconds(scene: CaseScene, measurement: Measurement) -> tuple[float, float]:
    """Seconds of a sampler to prepare, and to render the view with one light."""
    count = max(PROBE_LIGHTS, measurement.sampler.sampler.minimum_count)
    scene.shoot(measurement, count)  # compiles, and fills caches
    shot = scene.shoot(measurement, count)
    return shot.seconds_lights, shot.rendering.seconds / count


def _reference_seconds(scene: CaseScene, scale: Scale) -> float:
    render_reference(scene.view, scene.environment, scale.noise_target, 4)
    started = time.perf_counter()
    render_reference(scene.view, scene.environment, scale.noise_target, scale.max_samples)
    return time.perf_counter() - started
