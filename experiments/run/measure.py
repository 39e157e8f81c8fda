"""Measuring a case's reference and a measurement. Runs in whichever process a task is sent to.

What is timed: `prepare` of the sampler, on a map whose shared tables exist, and the shading of the
image, on a view that exists. A small trial of both goes before and is thrown away, so that nobody
is charged for compiling or loading kernels.
"""

import contextlib
import hashlib
import resource
import sys
import time
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.maps.sources import EnvironmentSource
from experiments.run.machine import machine_kind
from experiments.run.measurement import Case, Measurement, SamplerSpec
from experiments.run.ray_budget import TOLERANCE as RAY_TOLERANCE
from experiments.run.ray_budget import count_for_rays, range_for_rays
from metrics.errors import exposure_scale, psnr, relative_rmse, rmse
from metrics.flip import FlipReference
from renderer.image import write_exr
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
)
from samplers.conformance.lighting_check import check_lighting
from samplers.files.image_file import read_radiance

PROBE_REDUCTION, PROBE_WIDTH = 4, 80
"""Rays are searched on a view of 1/4 of the resolution, or less down to about 80 columns."""
FLOOR_FACTOR = 3.0
"""A measurement whose error is within this factor of its reference's noise floor is marked."""
SHARED_TABLES = (
    "luminance", "total_flux", "flux_table", "square_table", "band_table", "pixel_moment_table",
)  # fmt: skip
"""Tables of a map that samplers at their defaults ask for: built before the clock starts, as a map
serves many budgets and seeds, of which only the first would pay."""
MACHINE_COLUMNS = (
    "seconds_lights", "seconds_render", "seconds_metrics", "peak_memory_mib", "machine",
)  # fmt: skip
"""What depends on the machine and the moment; all else of a row does not."""


MOST_LIGHT_SETS = 4096
"""Kept at once; a run asks for a map's within a few hundred measurements."""


@dataclass(frozen=True)
class ReferenceTask:
    case: Case
    folder: str


@dataclass(frozen=True)
class MeasurementTask:
    measurement: Measurement
    folder: str
    noise_floor: float
    keep_image: bool


@lru_cache(maxsize=8)
def _view(scene: str, width: int, height: int, subpixels: int) -> View:
    return make_view(load_scene(scene), width, height, subpixels)


@lru_cache(maxsize=2)
def _environment(source: EnvironmentSource) -> EnvironmentMap:
    return source.load()


def _case_view(case: Case) -> View:
    scale = case.scale
    return _view(case.scene_file or case.scene, scale.width, scale.height, scale.subpixels)


def reference_path(folder: Path, case: Case) -> Path:
    """Where a case's reference image lies."""
    return folder / "references" / f"{case.key}.exr"


def keeps_image(measurement: Measurement) -> bool:
    """Whether a run that keeps images keeps this one: of several seeds the first one's."""
    return measurement.seed == 0


def image_path(folder: Path, measurement: Measurement) -> Path:
    """Where a measurement's image lies."""
    case, key = measurement.case, measurement.key[:8]
    label, budget, seed = measurement.sampler.label, measurement.budget, measurement.seed
    place = folder / "images" / case.scene / case.environment.name
    return place / f"{label}_{budget}_seed={seed}_{key}.exr"


@dataclass(frozen=True, eq=False)
class _Truth:
    """A case's reference, exposed, with what the metrics need of it."""

    image: NDArray[np.float32]
    scale: float
    hdr: FlipReference
    ldr: FlipReference


@lru_cache(maxsize=2)
def _truth(case: Case, folder: str) -> _Truth:
    image = read_radiance(reference_path(Path(folder), case))
    scale = exposure_scale(image, _case_view(case).coverage > 0.0)
    exposed = (image * np.float64(scale)).astype(np.float32)
    return _Truth(
        exposed, scale, FlipReference.hdr(exposed), FlipReference.ldr(exposed, encoded=False)
    )


def measure_reference(task: ReferenceTask) -> dict[str, Any]:
    """Render a case's reference into the run folder; returns its row."""
    case = task.case
    path = reference_path(Path(task.folder), case)
    reference = render_reference(
        _case_view(case),
        _environment(case.environment),
        case.scale.noise_target,
        case.scale.max_samples,
        checkpoint=path.with_suffix(".partial.npz"),
    )
    write_exr(path, reference.image)
    return {
        "scene": case.scene,
        "environment": case.environment.name,
        "pixels": _pixel_digest(reference.image),
        "noise_floor": reference.noise_floor,
        "samples": reference.samples,
        "rays": reference.rays.traced,
        "seconds": reference.seconds,
    }


def has_reference(task: ReferenceTask, pixels: str) -> bool:
    """Whether the case's reference image is there, undamaged, with pixels of this digest."""
    try:
        image = read_radiance(reference_path(Path(task.folder), task.case))
    except EnvlightError:
        return False
    return _pixel_digest(image) == pixels


def _pixel_digest(image: NDArray[np.float32]) -> str:
    return hashlib.blake2b(np.ascontiguousarray(image).data, digest_size=12).hexdigest()


@lru_cache(maxsize=64)
def _rehearse(sampler: SamplerSpec) -> None:
    """Prepare and render something tiny, so that every kernel is there before the clock starts."""
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (16, 32, 3))
    radiance[4, 7] = 1e3  # bright texels take other paths than the rest
    environment = EnvironmentMap.from_array(radiance, "rehearsal")
    count = max(16, sampler.sampler.minimum_count)
    # What goes wrong here is for the measurements themselves to tell: they may do without it.
    with contextlib.suppress(Exception):
        lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(0))
        render(_view("three-boxes", 16, 12, 1), lighting, environment)


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
    _rehearse(sampler)
    _build_shared_tables(environment)
    started = time.perf_counter()
    lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(seed))
    seconds = time.perf_counter() - started
    check_lighting(lighting, environment, count)
    return lighting, seconds


def measure_measurement(task: MeasurementTask) -> dict[str, Any]:
    """Prepare, render and judge one measurement that is not timed; returns its row."""
    measurement = task.measurement
    scene = CaseScene.of(measurement.case)
    if measurement.budget.kind == "rays":
        shot = _shot_with_rays(scene, measurement)
    else:
        shot = scene.shoot(measurement, measurement.budget.lights)
    return finished_row(task, scene, shot)


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
    environment: EnvironmentMap
    source: EnvironmentSource

    @classmethod
    def of(cls, case: Case, reduced: int = 1) -> "CaseScene":
        """The case's; with `reduced`, at one sub-pixel and 1/reduced of the resolution."""
        scale = case.scale
        width, height = -(-scale.width // reduced), -(-scale.height // reduced)
        view = _view(
            case.scene_file or case.scene, width, height, scale.subpixels if reduced == 1 else 1
        )
        return cls(view, _environment(case.environment), case.environment)

    def shoot(self, measurement: Measurement, count: int) -> Shot:
        """Prepare the lighting at a count, unless it is there already, and render it."""
        lighting, seconds = _lighting(self.source, measurement.sampler, count, measurement.seed)
        rendering = render(self.view, lighting, self.environment, seed=measurement.seed)
        return Shot(count, lighting, seconds, rendering)


def _shot_with_rays(scene: CaseScene, measurement: Measurement) -> Shot:
    """The measurement at the count that traces as many rays as its budget says."""
    small = CaseScene.of(
        measurement.case, max(PROBE_REDUCTION, measurement.case.scale.width // PROBE_WIDTH)
    )
    shots: dict[int, Shot] = {}

    def whole(count: int) -> float:
        if count not in shots:
            shots[count] = scene.shoot(measurement, count)
        return shots[count].rays

    probe = cache(lambda count: small.shoot(measurement, count).rays)
    budget = measurement.budget.amount
    allowed = range_for_rays(budget, measurement.sampler.sampler.minimum_count)
    return shots[count_for_rays(budget, allowed, probe, whole)]


def finished_row(task: MeasurementTask, scene: CaseScene, shot: Shot) -> dict[str, Any]:
    """Judge a measurement's image and keep it where it is to be kept; returns the row."""
    measurement, case = task.measurement, task.measurement.case
    truth = _truth(case, task.folder)
    rendering = shot.rendering
    image = (rendering.image * np.float64(truth.scale)).astype(np.float32)
    judged = time.perf_counter()
    error = rmse(image, truth.image)
    hdr, ldr = truth.hdr.compare(image), truth.ldr.compare(image)
    exposures = truth.hdr.exposures
    assert exposures is not None
    floor = task.noise_floor * truth.scale
    result = {
        "scene": case.scene,
        "environment": case.environment.name,
        "sampler": measurement.sampler.label,
        "budget": str(measurement.budget),
        "seed": measurement.seed,
        "scale": case.scale.name,
        "repaired": scene.environment.repaired,
        "count": shot.count,
        "lights": light_count(shot.lighting),
        "over_budget": over_budget(measurement, shot),
        "rmse": error,
        "rmse_unscaled": error / truth.scale,
        "relative_rmse": relative_rmse(image, truth.image),
        "psnr": psnr(image, truth.image),
        "flip": hdr.mean,
        "flip_ldr": ldr.mean,
        "flip_exposures": [exposures.start, exposures.stop, exposures.count],
        "exposure": truth.scale,
        "noise_floor": floor,
        "near_noise_floor": error < FLOOR_FACTOR * floor,
        "rays": shot.rays,
        "rays_primary": rendering.rays.primary,
        "rays_shadow": rendering.rays.shadow,
        "rays_brdf": rendering.rays.brdf,
        "rays_skipped": rendering.rays.skipped,
        "seconds_lights": shot.seconds_lights,
        "seconds_render": rendering.seconds,
        "seconds_metrics": time.perf_counter() - judged,
        "peak_memory_mib": peak_memory_mib(),
        "machine": machine_kind(),
    }
    if task.keep_image:
        write_exr(image_path(Path(task.folder), measurement), rendering.image, half=True)
    return result


def over_budget(measurement: Measurement, shot: Shot) -> bool:
    """Whether even the sampler's smallest count costs more than the budget of rays."""
    if measurement.budget.kind != "rays" or shot.count > measurement.sampler.sampler.minimum_count:
        return False
    return shot.rays > (1.0 + RAY_TOLERANCE) * measurement.budget.amount


def _build_shared_tables(environment: EnvironmentMap) -> None:
    for table in SHARED_TABLES:
        getattr(environment, table)


def light_count(lighting: Lighting) -> int:
    """Lights of a global set, or samples per shading point of a distribution."""
    match lighting:
        case LayeredLights():
            return len(lighting.direct) + len(lighting.indirect)
        case DirectionalLights() | DiscLights():
            return len(lighting)
    return lighting.count


def peak_memory_mib() -> float:
    """Peak resident memory of this process so far, in MiB."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20
