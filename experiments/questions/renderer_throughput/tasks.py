"""What the experiment renderer-throughput times: kinds of work, who does them, and their rays."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.questions.renderer_throughput.ray_lists import (
    PlainEmbree,
    global_rays,
    sampled_rays,
    trace_bare,
    trace_packets,
)
from experiments.questions.renderer_throughput.stages import STAGES, shade_to_stage
from renderer.area import shade_discs
from renderer.background import background_radiance
from renderer.direct import interleaved, shade_directional
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.rays import RayCount
from renderer.render import INTERLEAVED_SETS
from renderer.scene import Scene
from renderer.upsampling import guides_of, split_guides_of, upsample
from renderer.view import View, make_view
from samplers import DirectionalLights, DiscLights, EnvironmentMap, LayeredLights, make_sampler
from samplers.grids.tabulated import TabulatedDistribution

MIS, LIGHT_ONLY = SampleSplit(1, 1), SampleSplit(1, 0)
KERNEL, SAMPLED, VIEW = "global lights", "MIS", "primary"
IMAGE_MIS, IMAGE_LIGHT, IMAGE_GLOBAL = "image, MIS 1+1", "image, 1+0", "image, global lights"
DISCS, UPSAMPLING = "disc lights", "upsampling"
STAGED = "MIS by stage"
IMAGES = (IMAGE_MIS, IMAGE_LIGHT, IMAGE_GLOBAL)
OWN, KEPT_VIEW, BARE, EMBREEX = "renderer", "renderer, view kept", "bare Embree", "embreex"
PACKETS = "packets of 16"
TWO_LIGHTS = "two lights"
SUBPIXELS = 4
"""Where upsampling is timed: as many as images of experiments have."""
Shade = Callable[[View], tuple[NDArray[np.float32], RayCount]]


@dataclass(frozen=True)
class Size:
    """lights : directional lights of a global set, and emitter samples of the peers for it"""

    width: int
    height: int
    subpixels: int
    lights: int
    rounds: int


def emitter_and_bsdf(work: str, size: Size) -> tuple[int, int]:
    """Samples of each technique that a peer takes at a sub-pixel for a kind of image."""
    return {IMAGE_MIS: (1, 1), IMAGE_LIGHT: (1, 0), IMAGE_GLOBAL: (size.lights, 0)}[work]


@dataclass(frozen=True, eq=False)
class Bench:
    """What is timed, by kind of work and method; the rays of each kind, and the shading points.

    Under MIS by stage the methods are the stages; each is timed with all before it.
    """

    tasks: dict[tuple[str, str], Callable[[], Any]]
    rays: dict[str, int]
    points: int

    @classmethod
    def of(cls, scene: Scene, environment: EnvironmentMap, size: Size) -> "Bench":
        rng = np.random.default_rng(0)
        view = _view(scene, size)
        lights = make_sampler("median-cut").prepare(environment, size.lights, rng)
        assert isinstance(lights, DirectionalLights)
        sampled = make_sampler("mis").prepare(environment, MIS.light + MIS.brdf, rng)
        assert isinstance(sampled, TabulatedDistribution)
        sets, sent = interleaved(lights, INTERLEAVED_SETS, rng)
        shade: dict[str, Shade] = {
            IMAGE_MIS: partial(
                shade_distribution, environment=environment, lighting=sampled, seed=0, split=MIS
            ),
            IMAGE_LIGHT: partial(
                shade_distribution, environment=environment, lighting=sampled, seed=0,
                split=LIGHT_ONLY,
            ),
            IMAGE_GLOBAL: partial(shade_directional, direction=sets, irradiance=sent),
        }  # fmt: skip
        tasks: dict[tuple[str, str], Callable[[], Any]] = {
            (KERNEL, OWN): partial(shade[IMAGE_GLOBAL], view),
            (SAMPLED, OWN): partial(shade[IMAGE_MIS], view),
            (VIEW, OWN): partial(_view, scene, size),
        }
        primary = size.width * size.height * size.subpixels
        rays = {VIEW: primary}
        for image, work in shade.items():
            tasks[image, OWN] = partial(_image, scene, size, environment, work, None)
            tasks[image, KEPT_VIEW] = partial(_image, scene, size, environment, work, view)
            rays[image] = primary + work(view)[1].traced
        rays[KERNEL] = rays[IMAGE_GLOBAL] - primary
        rays[SAMPLED] = rays[IMAGE_MIS] - primary
        plain = PlainEmbree(scene)
        lists = {KERNEL: global_rays(view, sets), SAMPLED: sampled_rays(view, sampled, MIS, 0)}
        for name, some in lists.items():
            tasks[name, BARE] = partial(trace_bare, view.embree, some)
            tasks[name, PACKETS] = partial(trace_packets, view.embree, some, name == KERNEL)
            tasks[name, EMBREEX] = partial(plain.trace, some)
        discs = make_sampler("center-surround").prepare(environment, size.lights, rng)
        assert isinstance(discs, DiscLights)
        tasks[DISCS, OWN] = partial(shade_discs, view, discs, 0)
        rays[DISCS] = shade_discs(view, discs, 0)[1].shadow
        two = make_sampler("median-cut").prepare(environment, 2, rng)
        assert isinstance(two, DirectionalLights)
        usual = (
            view
            if size.subpixels == SUBPIXELS
            else _view(scene, replace(size, subpixels=SUBPIXELS))
        )
        tasks[UPSAMPLING, OWN] = _upsampling(usual)
        tasks[UPSAMPLING, TWO_LIGHTS] = partial(
            shade_directional, usual, *interleaved(two, INTERLEAVED_SETS, rng)
        )
        for last, stage in enumerate(STAGES):
            tasks[STAGED, stage] = partial(shade_to_stage, view, environment, sampled, last)
        return cls(tasks, rays, len(view))


def _upsampling(view: View) -> Callable[[], Any]:
    """Upsampling alone, with the guides there: they are kept with the view."""
    near, far = float(view.depth.min()), float(view.depth.max())
    small = guides_of(view.reduced(LayeredLights.upsampling), (near, far))
    noise = np.random.default_rng(0).random((*small.coverage.shape, 3), np.float32)
    return partial(upsample, noise, small, split_guides_of(view, (near, far)))


def _view(scene: Scene, size: Size) -> View:
    return make_view(scene, size.width, size.height, size.subpixels)


def _image(
    scene: Scene, size: Size, environment: EnvironmentMap, shade: Shade, view: View | None
) -> NDArray[np.float32]:
    """A whole image, with its primary rays unless their view is given."""
    seen = view or _view(scene, size)
    points, _ = shade(seen)
    return seen.to_image(points, background_radiance(seen, environment))
