"""What the renderer leaves out and what it keeps: rays, seconds, and the difference of the images.

Shading leaves out lights and samples that face away from a point, those that carry nothing, and
sub-pixels that show background. The renderer counts what it traces; what faces away is told from
what carries nothing by counting again under white light, where only the former is left out. That
neither changes a bit of an image is what tests show. A low-frequency layer without lights is
compared with one of a black light. BRDF sampling could be left out where all is ideally diffuse,
too: the renderer does not, since that changes the noise, though not the mean. Reuse: a view, the
shared tables of a map, a reference and a finished measurement are made once and found again. With
and without run in interleaved rounds; the difference is the largest of any pixel and channel, over
the mean image.
"""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.sources import EnvironmentSource
from experiments.report.parts import Part, Table, Text
from experiments.run.bench import Timing, interleaved, noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import (
    Case,
    choose_scenes,
    environment_identity,
    name_and_file,
    scene_file_digests,
)
from experiments.run.experiment import Group, Job, Row, RunRequest, Study, experiment
from experiments.run.grid import case_groups, run_measurements
from experiments.run.identity import source_digest
from experiments.run.loaded_run import Run
from experiments.run.measurement import Measurement
from experiments.run.rendering import SHARED_TABLES
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale, find_scale, of_scale
from experiments.run.store import Store
from experiments.run.study import study_environments
from metrics.errors import rmse
from metrics.registry import ranked_metrics
from renderer.background import background_radiance
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.reference import render_reference
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import View, make_view
from samplers import (
    DirectionalLights,
    EnvironmentMap,
    LayeredLights,
    LightDistribution,
    Lighting,
    make_sampler,
)

SCENES = ["rubiks-cube", "three-boxes"]
MAPS = ["noon-desert", "concert-stage"]
ROUNDS = {"quick": 5, "standard": 9, "paper": 9}
COUNT = 16
SAMPLERS = ("median-cut", "mis")
SMALL = Scale("quick", 64, 48, 1, 0.05, 64, 64, (COUNT,))
FORMATS = {
    "scene": "s", "environment": "s", "lighting": "s", "skip": "s", "rays_on": ",d",
    "rays_off": ",d", "rays_ratio": ".3f", "ms_on": ".2f", "ms_off": ".2f", "time_ratio": ".3f",
    "difference": ".2g", "rmse_on": ".4f", "rmse_off": ".4f",
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What a piece of work gave: rays traced, and an array that must not depend on the skip.

    image : None where only rays are counted
    reference : of the image, where the skip may change it
    """

    rays: int
    image: NDArray | None = None
    reference: NDArray | None = None


Work = Callable[[], Outcome]


@experiment("skipping")
def skipping() -> Study:
    """Rays, seconds and image difference with each skip on and off."""
    return Study(
        title="What each skip saves",
        sections=(savings,),
        groups=groups,
        sources=(__name__, "renderer.render"),
        findings=lambda run: [unchanged(run.rows)],
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per scene and map."""
    scale, rounds = find_scale(request.scale), of_scale(ROUNDS, request.scale)
    sources = study_environments(request, MAPS, scale.map_height)
    chosen = choose_scenes(request.scenes or SCENES)
    return [_group(scene, source, scale, rounds) for scene in chosen for source in sources]


def _group(scene: str, source: EnvironmentSource, scale: Scale, rounds: int) -> Group:
    """scene : a built-in one's name, or the path of a scene's file"""
    name, file = name_and_file(scene)
    made = f"renderer.scenes.{name.replace('-', '_')}"
    depends = {
        "map": environment_identity(source),
        "scale": repr(scale),
        "rounds": rounds,
        "scene": scene_file_digests(file) if file else source_digest(made),
        "samplers": [SamplerSpec(name).identity for name in SAMPLERS],
    }
    jobs = {
        f"{skip} ({lighting})": Job(
            {"scene": name, "environment": source.name, "lighting": lighting, "skip": skip},
            depends,
        )
        for lighting, skip in PAIRS
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        wanted = {name: jobs[name].columns for name in names}
        return _measure(_Stage(scene, source, scale), wanted, rounds)

    return Group(f"{name} under {source.name}", jobs, measure)


class _Stage:
    """A scene under a map, with what the pairs of work are made from."""

    def __init__(self, scene: str, source: EnvironmentSource, scale: Scale) -> None:
        self.scene, self.source, self.scale = scene, source, scale
        self.environment = source.load()
        self.view = make_view(load_scene(scene), scale.width, scale.height, scale.subpixels)
        rng = np.random.default_rng(0)
        self.lighting: dict[str, Lighting] = {
            name: make_sampler(name).prepare(self.environment, COUNT, rng) for name in SAMPLERS
        }
        lights = self.lighting["median-cut"]
        assert isinstance(lights, DirectionalLights)
        self.lighting["layered"] = LayeredLights(lights, DirectionalLights.none(), 2)
        black = DirectionalLights(np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3)), np.zeros(1))
        self.lighting["black layer"] = LayeredLights(lights, black, 2)

    def shading(self, lighting: str) -> Work:
        return partial(_shade, self.view, self.lighting[lighting], self.environment)


def _shade(view: View, lighting: Lighting, environment: EnvironmentMap) -> Outcome:
    result = render(view, lighting, environment)
    return Outcome(result.rays.traced, result.image)


def _counted(on: int, off: int) -> tuple[Work, Work]:
    return (lambda: Outcome(on)), (lambda: Outcome(off))


def _in_white_light(stage: _Stage, lighting: Lighting) -> int:
    """The rays traced where lights and map are white, so that all carries something."""
    radiance = np.ones_like(stage.environment.radiance)
    if isinstance(lighting, DirectionalLights):
        lighting = replace(lighting, irradiance=np.ones_like(lighting.irradiance))
    return render(stage.view, lighting, EnvironmentMap(radiance, "white")).rays.traced


def _facing(lighting: str) -> Callable[[_Stage], tuple[Work, Work]]:
    """Pairs of a point and a light or sample, and those of them that face each other."""

    def pair(stage: _Stage) -> tuple[Work, Work]:
        rays = render(stage.view, stage.lighting[lighting], stage.environment).rays
        facing = _in_white_light(stage, stage.lighting[lighting])
        return _counted(facing, rays.traced + rays.skipped)

    return pair


def _zero(lighting: str) -> Callable[[_Stage], tuple[Work, Work]]:
    """Those that face each other, and those of them that carry something."""

    def pair(stage: _Stage) -> tuple[Work, Work]:
        light = stage.lighting[lighting]
        rays = render(stage.view, light, stage.environment).rays
        return _counted(rays.traced, _in_white_light(stage, light))

    return pair


def _lambert(stage: _Stage) -> tuple[Work, Work]:
    view, environment, scale = stage.view, stage.environment, stage.scale
    truth = render_reference(view, environment, scale.noise_target, scale.max_samples)
    lighting = stage.lighting["mis"]
    assert isinstance(lighting, LightDistribution)

    def work(left_out: bool) -> Outcome:
        # Luminance alone reaches every texel with light, so that no BRDF sample is needed.
        half, light = SampleSplit.half_and_half(COUNT), SampleSplit.light_only(COUNT)
        split = light if left_out and view.is_lambertian else half
        points, rays = shade_distribution(view, environment, lighting, 0, split)
        image = view.to_image(points, background_radiance(view, environment))
        return Outcome(rays.traced, image, truth.image)

    return partial(work, True), partial(work, False)


def _black_ground(stage: _Stage) -> tuple[Work, Work]:
    """The map as many skies are stored: all below the horizon is black."""
    radiance = stage.environment.radiance.copy()
    radiance[len(radiance) // 2 :] = 0.0
    sky = EnvironmentMap(radiance, "sky")
    lighting = make_sampler("mis").prepare(sky, COUNT, np.random.default_rng(0))
    rays = render(stage.view, lighting, sky).rays
    return _counted(rays.traced, _in_white_light(stage, lighting))


def _background(stage: _Stage) -> tuple[Work, Work]:
    """Pairs of a light and a point that shows a surface, and those with any sub-pixel."""
    return _counted(COUNT * len(stage.view), COUNT * stage.view.subpixels * _pixels(stage.scale))


def _pixels(scale: Scale) -> int:
    return scale.width * scale.height


def _view(stage: _Stage) -> tuple[Work, Work]:
    view, scale = stage.view, stage.scale

    def again() -> Outcome:
        made = make_view(view.scene, scale.width, scale.height, scale.subpixels)
        return Outcome(scale.width * scale.height * scale.subpixels, made.position)

    return lambda: Outcome(0, view.position), again


def _tables(stage: _Stage) -> tuple[Work, Work]:
    environment = stage.environment

    def tables(source: EnvironmentMap) -> Outcome:
        built = [np.ravel(getattr(source, table)) for table in SHARED_TABLES]
        return Outcome(0, np.concatenate(built))

    return (
        lambda: tables(environment),
        lambda: tables(EnvironmentMap(environment.radiance, environment.name)),
    )


def _reference(stage: _Stage) -> tuple[Work, Work]:
    view = make_view(stage.view.scene, SMALL.width, SMALL.height, SMALL.subpixels)

    def again() -> Outcome:
        made = render_reference(view, stage.environment, SMALL.noise_target, SMALL.max_samples)
        return Outcome(made.rays.traced, made.image)

    kept = again()
    return lambda: Outcome(0, kept.image), again


def _measurements(stage: _Stage) -> tuple[Work, Work]:
    """A run of one small measurement in a folder that holds it, and in an empty one."""
    name, file = name_and_file(stage.scene)
    case = Case(name, stage.source, SMALL, file)
    measurement = Measurement(case, SamplerSpec("median-cut"), Budget(COUNT), 0)
    keep = tempfile.TemporaryDirectory()

    def run_in(folder: str) -> Outcome:
        with Store.writing(Path(folder) / "run") as store:
            measured = run_measurements(store, [measurement], images=False).measured
            (row,) = store.rows(case_groups([measurement])[0].planned())
            reference = store.get(case.reference_key)
        assert reference is not None
        rays = row["rays_shadow"] + row["rays_brdf"] + reference.result["rays"]
        return Outcome(measured * rays, np.array([row[metric.name] for metric in ranked_metrics()]))

    def fresh() -> Outcome:
        with tempfile.TemporaryDirectory() as folder:
            return run_in(folder)

    run_in(keep.name)
    return lambda: run_in(keep.name), fresh


PAIRS: dict[tuple[str, str], Callable[[_Stage], tuple[Work, Work]]] = {
    ("median-cut", "facing away"): _facing("median-cut"),
    ("mis", "facing away"): _facing("mis"),
    ("median-cut", "zero contribution"): _zero("median-cut"),
    ("mis", "zero contribution"): _zero("mis"),
    ("mis", "zero contribution, black ground"): _black_ground,
    ("median-cut", "background points"): _background,
    ("layered", "empty layer"): lambda stage: (
        stage.shading("layered"),
        stage.shading("black layer"),
    ),
    ("mis", "BRDF sampling if Lambertian"): _lambert,
    ("any", "view reused"): _view,
    ("any", "map tables reused"): _tables,
    ("any", "reference reused"): _reference,
    ("any", "stored measurement"): _measurements,
}
"""By lighting and skip: the work with the skip, and without it."""


def _measure(stage: _Stage, wanted: dict[str, Row], rounds: int) -> dict[str, Row]:
    works = {name: PAIRS[row["lighting"], row["skip"]](stage) for name, row in wanted.items()}
    found = {name: (on(), off()) for name, (on, off) in works.items()}
    tasks: dict[str, Callable[[], Any]] = {}
    for name, (on, off) in works.items():
        if found[name][0].image is not None:
            tasks[f"{name} on"], tasks[f"{name} off"] = on, off
    timings = interleaved(tasks, rounds)
    return {
        name: _row(*both, timings.get(f"{name} on"), timings.get(f"{name} off"))
        for name, both in found.items()
    }


def _row(on: Outcome, off: Outcome, time_on: Timing | None, time_off: Timing | None) -> Row:
    row: Row = {"rays_on": on.rays, "rays_off": off.rays}
    if on.image is None or off.image is None or time_on is None or time_off is None:
        return row
    scale = float(np.abs(off.image).mean()) or 1.0
    if on.reference is not None and off.reference is not None:
        row["rmse_on"] = rmse(on.image, on.reference) / scale
        row["rmse_off"] = rmse(off.image, off.reference) / scale
    return {
        **row,
        "difference": float(np.abs(on.image - off.image).max(initial=0.0)) / scale,
        "identical": float(np.array_equal(on.image, off.image)),
        **time_on.columns("seconds_on"),
        **time_off.columns("seconds_off"),
    }


def savings(run: Run) -> Iterator[Part]:
    """The table of what is saved."""
    rows = run.rows
    shown = rows.assign(
        ms_on=1e3 * rows["seconds_on"],
        ms_off=1e3 * rows["seconds_off"],
        rays_ratio=(rows["rays_on"] / rows["rays_off"]).where(rows["rays_off"] > 0),
        time_ratio=rows["seconds_on"] / rows["seconds_off"],
    )
    yield Table("skipping", shown, FORMATS, caption=unchanged(rows))
    yield Text(
        "`rays off` of what faces away are all pairs of a shading point and a light or sample, of "
        "what carries nothing those that face each other, of the background those with any "
        "sub-pixel. Leaving BRDF sampling out changes the noise where all is Lambertian, and "
        "nothing elsewhere. `difference` is the largest of any pixel and channel over the mean; "
        "`rmse` is against a reference, over the mean. Reference and measurement: "
        f"{SMALL.width}×{SMALL.height} pixels. {COUNT} lights or samples."
    )
    yield Text(noise_sentence(rows[rows["difference"].notna()]))


def unchanged(rows: pd.DataFrame) -> str:
    """How many of the images compared that must not change do not."""
    exact = rows[(rows["skip"] != "BRDF sampling if Lambertian") & rows["identical"].notna()]
    return (
        f"{int(exact['identical'].sum())} of {len(exact)} images that must not change are the "
        "same, bit for bit."
    )
