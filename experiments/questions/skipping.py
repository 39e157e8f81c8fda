"""What the renderer leaves out and what it keeps: rays, seconds, and the difference of the images.

Shading leaves out lights and samples that face away from a point, those that carry nothing, and
sub-pixels that show background. The renderer counts what it traces; what faces away is told from
what carries nothing by counting again under white light, where only the former is left out. A
low-frequency layer without lights is compared with one of a black light. BRDF sampling could be
left out where all is ideally diffuse, too: the renderer does not, since that changes the noise,
though not the mean.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from experiments.maps.sources import EnvironmentSource
from experiments.report.parts import Part, Table, Text
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.case import (
    choose_scenes,
    environment_identity,
    name_and_file,
    scene_file_digests,
)
from experiments.run.experiment import Group, Row, RunRequest, Study, experiment
from experiments.run.identity import source_digest
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale, find_scale, of_scale
from experiments.run.study import study_environments
from metrics.errors import rmse
from metrics.truth import Image
from renderer.background import background_radiance
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.reference import render_reference
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import make_view
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
FORMATS = {
    "scene": "s", "environment": "s", "lighting": "s", "skip": "s", "rays_on": ",d",
    "rays_off": ",d", "rays_ratio": ".3f", "ms_on": ".2f", "ms_off": ".2f", "time_ratio": ".3f",
    "difference": ".2g", "rmse_on": ".4f", "rmse_off": ".4f",
}  # fmt: skip
Work = Callable[[], tuple[int, Image]]
"""Rays traced, and the image."""


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
    case = {"scene": name, "environment": source.name}
    pairs = (*COUNTED, *RENDERED)
    asked = (({"lighting": lit, "skip": skip}, Row(), (lit, skip)) for lit, skip in pairs)

    def measure(pairs: list[tuple[str, str]]) -> Iterator[Row]:
        stage = _Stage(scene, source, scale)
        for pair in pairs:
            if pair in COUNTED:
                on, off = COUNTED[pair](stage)
                yield {"rays_on": on, "rays_off": off}
            else:
                yield _rendered(*RENDERED[pair](stage), rounds)

    return Group(f"{name} under {source.name}", asked, measure, case, depends)


class _Stage:
    """A scene under a map, with the lightings by name."""

    def __init__(self, scene: str, source: EnvironmentSource, scale: Scale) -> None:
        self.scale, self.environment = scale, source.load()
        self.view = make_view(load_scene(scene), scale.width, scale.height, scale.subpixels)
        rng = np.random.default_rng(0)
        self.lighting: dict[str, Lighting] = {
            name: make_sampler(name).prepare(self.environment, COUNT, rng) for name in SAMPLERS
        }

    def traced(self, lighting: Lighting) -> tuple[int, int]:
        """Pairs of a point and a light or sample that are traced, and all."""
        rays = render(self.view, lighting, self.environment).rays
        return rays.traced, rays.traced + rays.skipped

    def in_white_light(self, lighting: Lighting) -> int:
        """The rays traced where lights and map are white, so that all carries something."""
        radiance = np.ones_like(self.environment.radiance)
        if isinstance(lighting, DirectionalLights):
            lighting = replace(lighting, irradiance=np.ones_like(lighting.irradiance))
        return render(self.view, lighting, EnvironmentMap(radiance, "white")).rays.traced


def _facing(lighting: str, stage: _Stage) -> tuple[int, int]:
    """Pairs of a point and a light or sample, and those of them that face each other."""
    light = stage.lighting[lighting]
    return stage.in_white_light(light), stage.traced(light)[1]


def _zero(lighting: str, stage: _Stage) -> tuple[int, int]:
    """Those that face each other, and those of them that carry something."""
    light = stage.lighting[lighting]
    return stage.traced(light)[0], stage.in_white_light(light)


def _black_ground(stage: _Stage) -> tuple[int, int]:
    """The map as many skies are stored: all below the horizon is black."""
    radiance = stage.environment.radiance.copy()
    radiance[len(radiance) // 2 :] = 0.0
    sky = EnvironmentMap(radiance, "sky")
    lighting = make_sampler("mis").prepare(sky, COUNT, np.random.default_rng(0))
    return render(stage.view, lighting, sky).rays.traced, stage.in_white_light(lighting)


def _background(stage: _Stage) -> tuple[int, int]:
    """Pairs of a light and a point that shows a surface, and those with any sub-pixel."""
    pixels = stage.scale.width * stage.scale.height
    return COUNT * len(stage.view), COUNT * stage.view.subpixels * pixels


COUNTED: dict[tuple[str, str], Callable[[_Stage], tuple[int, int]]] = {
    ("median-cut", "facing away"): partial(_facing, "median-cut"),
    ("mis", "facing away"): partial(_facing, "mis"),
    ("median-cut", "zero contribution"): partial(_zero, "median-cut"),
    ("mis", "zero contribution"): partial(_zero, "mis"),
    ("mis", "zero contribution, black ground"): _black_ground,
    ("median-cut", "background points"): _background,
}
"""By lighting and skip: rays with the skip, and without it."""


def _layers(stage: _Stage) -> tuple[Work, Work, None]:
    lights = stage.lighting["median-cut"]
    assert isinstance(lights, DirectionalLights)
    black = DirectionalLights(np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3)), np.zeros(1))

    def work(layer: DirectionalLights) -> tuple[int, Image]:
        found = render(stage.view, LayeredLights(lights, layer, 2), stage.environment)
        return found.rays.traced, found.image

    return partial(work, DirectionalLights.none()), partial(work, black), None


def _lambert(stage: _Stage) -> tuple[Work, Work, Image]:
    view, environment, scale = stage.view, stage.environment, stage.scale
    truth = render_reference(view, environment, scale.noise_target, scale.max_samples)
    lighting = stage.lighting["mis"]
    assert isinstance(lighting, LightDistribution)

    def work(left_out: bool) -> tuple[int, Image]:
        # Luminance alone reaches every texel with light, so that no BRDF sample is needed.
        half, light = SampleSplit.half_and_half(COUNT), SampleSplit.light_only(COUNT)
        split = light if left_out and view.is_lambertian else half
        points, rays = shade_distribution(view, environment, lighting, 0, split)
        return rays.traced, view.to_image(points, background_radiance(view, environment))

    return partial(work, True), partial(work, False), truth.image


LAMBERT = "BRDF sampling if Lambertian"
RENDERED: dict[tuple[str, str], Callable[[_Stage], tuple[Work, Work, Image | None]]] = {
    ("layered", "empty layer"): _layers,
    ("mis", LAMBERT): _lambert,
}
"""The work with the skip, that without it, and the reference where the skip changes the image."""


def _rendered(on: Work, off: Work, truth: Image | None, rounds: int) -> Row:
    (rays_on, image_on), (rays_off, image_off) = on(), off()
    times = interleaved({"on": on, "off": off}, rounds)
    mean = float(np.abs(image_off).mean()) or 1.0
    row: Row = {
        "rays_on": rays_on,
        "rays_off": rays_off,
        "difference": float(np.abs(image_on - image_off).max(initial=0.0)) / mean,
        "identical": float(np.array_equal(image_on, image_off)),
        **times["on"].columns("seconds_on"),
        **times["off"].columns("seconds_off"),
    }
    if truth is not None:
        row["rmse_on"], row["rmse_off"] = (
            rmse(image_on, truth) / mean,
            rmse(image_off, truth) / mean,
        )
    return row


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
        f"`rmse` is against a reference, over the mean. {COUNT} lights or samples."
    )
    yield Text(noise_sentence(rows[rows["difference"].notna()]))


def unchanged(rows: pd.DataFrame) -> str:
    """How many of the images compared that must not change do not."""
    exact = rows[(rows["skip"] != LAMBERT) & rows["identical"].notna()]
    return (
        f"{int(exact['identical'].sum())} of {len(exact)} images that must not change are the "
        "same, bit for bit."
    )
