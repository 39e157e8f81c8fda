"""Rendering a case's reference, and a measurement's image. Runs in whichever process has the task.

What is timed: `prepare` of the sampler, on a map whose shared tables exist, and the shading of the
image, on a view that exists. A small trial of both goes before and is thrown away, so that nobody
is charged for compiling or loading kernels.
"""

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.maps.features import map_features
from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import ALLOWED
from experiments.run.case import Case
from experiments.run.counts import TOLERANCE as RAY_TOLERANCE
from experiments.run.counts import count_for_rays, range_for_rays
from experiments.run.kept_images import FIRST_HALF, keep_reference, pixel_digest, reference_path
from experiments.run.machine import machine_kind, peak_memory_mib
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import PIXELS
from renderer.reference import render_reference
from renderer.render import Rendering, render
from renderer.scene.load import load_scene
from renderer.view import View, make_view
from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    EnvlightError,
    LayeredLights,
    Lighting,
    SurfaceDistribution,
)
from samplers.conformance.lighting_check import check_lighting

PROBE_REDUCTION, PROBE_WIDTH = 4, 80
"""Rays are searched on a view of 1/4 of the resolution, or less down to about 80 columns."""
SHARED_TABLES = (
    "luminance", "total_flux", "flux_table", "square_table", "band_table", "pixel_moment_table",
)  # fmt: skip
"""Tables of a map that samplers at their defaults ask for: built before the clock starts, as a map
serves many budgets and seeds, of which only the first would pay."""
MACHINE_COLUMNS = ("seconds_lights", "seconds_render", "peak_memory_mib", "machine")
"""What depends on the machine and the moment; all else of a row does not."""
MOST_LIGHT_SETS = 4096
"""Kept at once; a run asks for a map's within a few hundred measurements."""


@lru_cache(maxsize=8)
def cached_view(scene: str, width: int, height: int, subpixels: int) -> View:
    """The view of a scene, built in or from a file, at a resolution."""
    return make_view(load_scene(scene), width, height, subpixels)


@lru_cache(maxsize=2)
def _environment(source: EnvironmentSource) -> EnvironmentMap:
    return source.load()


@lru_cache(maxsize=2)
def _map_digest(source: EnvironmentSource) -> str:
    return pixel_digest(_environment(source).radiance)


@contextlib.contextmanager
def _map_left_alone(source: EnvironmentSource, sampler: SamplerSpec) -> Iterator[None]:
    """Raise EnvlightError where a sampler in a file wrote into the map's memory, which all share;
    the map is read anew for the others.
    """
    before = _map_digest(source) if sampler.content else ""
    try:
        yield
    finally:
        if before and pixel_digest(_environment(source).radiance) != before:
            for kept in (_environment, _map_digest, cached_features, _make_lighting):
                kept.cache_clear()
            _light_sets.clear()
            raise EnvlightError("it wrote into the map, which samplers share; let it write a copy")


@lru_cache(maxsize=1024)
def cached_features(source: EnvironmentSource) -> dict[str, float]:
    """What can be measured on a map, by the name of its column."""
    return map_features(_environment(source))


def case_view(case: Case) -> View:
    """The case's view; kept for the next who asks."""
    scale = case.scale
    return cached_view(case.scene_file or case.scene, scale.width, scale.height, scale.subpixels)


def make_reference(case: Case, folder: Path) -> dict[str, Any]:
    """Render a case's reference into the run folder; returns its row."""
    path = reference_path(folder, case)
    reference = render_reference(
        case_view(case),
        _environment(case.environment),
        case.scale.noise_target,
        case.scale.max_samples,
        checkpoint=path.with_suffix(".partial.npz"),
    )
    keep_reference(folder, case, reference.image, reference.first_half)
    return {
        "scene": case.scene,
        "environment": case.environment.name,
        PIXELS: pixel_digest(reference.image),
        FIRST_HALF: pixel_digest(reference.first_half),
        "noise_floor": reference.noise_floor,
        "samples": reference.samples,
        "rays": reference.rays.traced,
        "seconds": reference.seconds,
    }


@cache
def _rehearsal_map() -> EnvironmentMap:
    """A tiny map."""
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (16, 32, 3))
    radiance[4:6, 7:9] = 1e3  # bright texels take other paths than the rest
    return EnvironmentMap.from_array(radiance, "rehearsal")


def _rehearsal_view() -> View:
    return cached_view("three-boxes", 16, 12, 1)


def rehearse_lights(sampler: SamplerSpec) -> Lighting:
    """A lighting of something tiny, so that every kernel that prepares it is there."""
    count = max(16, sampler.sampler.minimum_count)
    return sampler.sampler.prepare(_rehearsal_map(), count, np.random.default_rng(0))


@lru_cache(maxsize=64)
def shared_tables(sampler: SamplerSpec) -> tuple[str, ...]:
    """Those of the shared tables that a sampler asks for, of a map without any.

    The others are not built: all of them take four times as much memory as the map.
    """
    environment = EnvironmentMap(_rehearsal_map().radiance)
    # Ignore errors here; the measured run reports them.
    with contextlib.suppress(Exception):
        count = max(16, sampler.sampler.minimum_count)
        sampler.sampler.prepare(environment, count, np.random.default_rng(0))
    return tuple(table for table in SHARED_TABLES if table in environment.built)


@lru_cache(maxsize=64)
def rehearse(sampler: SamplerSpec) -> None:
    """Prepare and render something tiny, so that every kernel is there before the clock starts."""
    # Ignore errors here; the measured run reports them.
    with contextlib.suppress(Exception):
        render(_rehearsal_view(), rehearse_lights(sampler), _rehearsal_map())


def rehearse_reference() -> None:
    """A reference of something tiny, so that its kernels are there."""
    render_reference(_rehearsal_view(), _rehearsal_map(), target=0.0, max_samples=64)


_Made = tuple[Lighting, float]
_light_sets: dict[tuple[EnvironmentSource, SamplerSpec, int, int], _Made] = {}


def _lighting(source: EnvironmentSource, sampler: SamplerSpec, count: int, seed: int) -> _Made:
    """A map's lighting and the seconds it took: made once for all scenes under the map.

    Light sets are small and all kept; of other lightings, which hold tables, the newest.
    """
    key = source, sampler, count, seed
    made = _light_sets.get(key)
    if made is None:
        made = _make_lighting(*key)
        if isinstance(made[0], DirectionalLights | LayeredLights):
            if len(_light_sets) >= MOST_LIGHT_SETS:
                _light_sets.clear()
            _light_sets[key] = made
    return made


@lru_cache(maxsize=16)
def _make_lighting(source: EnvironmentSource, sampler: SamplerSpec, count: int, seed: int) -> _Made:
    environment = _environment(source)
    rehearse(sampler)
    for table in shared_tables(sampler):
        getattr(environment, table)
    started = time.perf_counter()
    lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(seed))
    seconds = time.perf_counter() - started
    check_lighting(lighting, environment, count)
    return lighting, seconds


@dataclass(frozen=True, eq=False)
class Shot:
    """An image at a count, and what it cost. seconds_lights : to prepare the lighting"""

    count: int
    lighting: Lighting
    seconds_lights: float
    rendering: Rendering

    @property
    def rays(self) -> float:
        """Shadow and BRDF rays per sub-pixel, over all sub-pixels."""
        rays = self.rendering.rays
        return (rays.shadow + rays.brdf) / rays.primary


@dataclass(frozen=True, eq=False)
class CaseScene:
    """What is rendered in a case: the view, and the map."""

    view: View
    source: EnvironmentSource

    @property
    def environment(self) -> EnvironmentMap:
        return _environment(self.source)

    @classmethod
    def of(cls, case: Case, reduced: int = 1) -> "CaseScene":
        """The case's; with `reduced`, at one sub-pixel and 1/reduced of the resolution."""
        if reduced == 1:
            view = case_view(case)
        else:
            width, height = -(-case.scale.width // reduced), -(-case.scale.height // reduced)
            view = cached_view(case.scene_file or case.scene, width, height, 1)
        return cls(view, case.environment)

    def shoot(self, measurement: Measurement, count: int) -> Shot:
        """Prepare the lighting at a count, unless it is there already, and render it."""
        one = measurement
        with _map_left_alone(self.source, one.sampler):
            lighting, seconds = _lighting(self.source, one.sampler, count, one.seed)
            made = self.render(one, lighting)
        if made.rays.traced + made.rays.skipped > count * len(self.view):
            raise EnvlightError(f"lighting: more than {count} samples were taken at a point")
        return Shot(count, lighting, seconds, made)

    def render(self, measurement: Measurement, lighting: Lighting) -> Rendering:
        """The image of a measurement under its lighting."""
        seed, sets = measurement.seed, measurement.case.scale.sets
        return render(self.view, lighting, self.environment, seed, sets)


def shoot(measurement: Measurement) -> tuple[CaseScene, Shot]:
    """The image of a measurement that is not timed."""
    scene, budget = CaseScene.of(measurement.case), measurement.budget
    if budget.kind == "rays":
        return scene, _shot_with_rays(scene, measurement)
    count = int(allowed(measurement)) if budget.like else budget.lights
    return scene, scene.shoot(measurement, count)


def allowed(measurement: Measurement) -> float:
    """What a budget that is not timed comes to in its case: lights, or rays per sub-pixel."""
    budget = measurement.budget
    if not budget.like:
        return budget.amount
    count, rays = _spent(measurement.like)
    return rays if budget.kind == "rays" else count


@lru_cache(maxsize=64)
def _spent(measurement: Measurement) -> tuple[int, float]:
    """The count and the rays per sub-pixel of an image: many are held to those of one."""
    _, shot = shoot(measurement)
    return shot.count, shot.rays


def _shot_with_rays(scene: CaseScene, measurement: Measurement) -> Shot:
    """The image at the count that traces as many rays as the budget says."""
    case, budget = measurement.case, measurement.budget
    if budget.like == measurement.sampler.label:
        return scene.shoot(measurement, _spent(measurement.like)[0])
    small = CaseScene.of(case, max(PROBE_REDUCTION, case.scale.width // PROBE_WIDTH))
    shots: dict[int, Shot] = {}

    def whole(count: int) -> float:
        if count not in shots:
            shots[count] = scene.shoot(measurement, count)
        return shots[count].rays

    probe = cache(lambda count: small.shoot(measurement, count).rays)
    rays = allowed(measurement)
    counts = range_for_rays(rays, measurement.sampler.sampler.minimum_count)
    return shots[count_for_rays(rays, counts, probe, whole)]


def image_row(measurement: Measurement, scene: CaseScene, shot: Shot) -> dict[str, Any]:
    """What a measurement's row says of its image."""
    case, budget, rendering = measurement.case, measurement.budget, shot.rendering
    return {
        "scene": case.scene, "environment": case.environment.name,
        "sampler": measurement.sampler.label, "budget": str(budget), "seed": measurement.seed,
        "scale": case.scale.name, "repaired": scene.environment.repaired, "count": shot.count,
        "lights": light_count(shot.lighting), "league": league(shot.lighting),
        "over_budget": over_budget(measurement, shot), "rays": shot.rays,
        "rays_primary": rendering.rays.primary, "rays_shadow": rendering.rays.shadow,
        "rays_brdf": rendering.rays.brdf, "rays_skipped": rendering.rays.skipped,
        "seconds_lights": shot.seconds_lights, "seconds_render": rendering.seconds,
        "peak_memory_mib": peak_memory_mib(), "machine": machine_kind(),
        # What a budget that is a sampler's came to; one that is timed tells that itself.
        **({ALLOWED: allowed(measurement)} if budget.like and not budget.timed else {}),
    }  # fmt: skip


def over_budget(measurement: Measurement, shot: Shot) -> bool:
    """Whether even the sampler's smallest count costs more than the budget of rays."""
    if measurement.budget.kind != "rays" or shot.count > measurement.sampler.sampler.minimum_count:
        return False
    return shot.rays > (1.0 + RAY_TOLERANCE) * allowed(measurement)


def league(lighting: Lighting) -> str:
    """What a sampler returns, in words: samplers are ranked within their league, too."""
    match lighting:
        case LayeredLights():
            return "layers"
        case DirectionalLights():
            return "fixed lights"
        case DiscLights():
            return "disc lights"
        case SurfaceDistribution():
            return "distribution that sees the surface"
    return "distribution"


def light_count(lighting: Lighting) -> int:
    """Lights of a global set, or samples per shading point of a distribution."""
    match lighting:
        case LayeredLights():
            return len(lighting.direct) + len(lighting.indirect)
        case DirectionalLights() | DiscLights():
            return len(lighting)
    return lighting.count
