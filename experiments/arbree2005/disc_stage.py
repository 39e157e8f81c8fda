"""A map with its disc lights: how long they take to find, and images lit by them and by rivals."""

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.report.disc_map import draw_discs
from experiments.report.sheets import keep_tile, tile_path
from experiments.run.bench import interleaved
from experiments.run.case import Case
from experiments.run.experiment import Row
from experiments.run.judging import scores, truth_in
from experiments.run.rendering import CaseScene
from experiments.run.sampler_spec import SamplerSpec
from metrics.registry import ranked_metrics
from renderer.area import Mode
from renderer.render import Rendering, render
from renderer.view import View
from samplers import DiscLights, EnvironmentMap, Lighting
from samplers.environment import LUMINANCE_WEIGHTS

DISCS = SamplerSpec("center-surround")
MODES: dict[str, Mode] = {"area": "area", "centre": "centre"}
RIVALS = {name: SamplerSpec(name) for name in ("median-cut", "ours")}
TILE = 448


def _prepared(spec: SamplerSpec, environment: EnvironmentMap, count: int) -> Lighting:
    return spec.sampler.prepare(environment, count, np.random.default_rng(0))


class Stage:
    """A map with its disc lights."""

    def __init__(self, environment: EnvironmentMap, count: int, folder: Path) -> None:
        self.environment, self.count, self.folder = environment, count, folder
        lights = _prepared(DISCS, environment, count)
        assert isinstance(lights, DiscLights)
        self.lights = lights

    def lights_row(self, rounds: int) -> Row:
        """Number, size and energy of the lights, and the time to find them."""
        task = partial(_prepared, DISCS, self.environment, self.count)
        timing = interleaved({"": task}, rounds)[""]
        drawn = draw_discs(self.environment, self.lights, TILE)
        for kind, picture in zip(("discs", "lighting"), drawn, strict=True):
            keep_tile(tile_path(self.folder, self.environment.name, kind), picture)
        degrees = np.degrees(self.lights.half_angle)
        total = self.environment.luminous_flux
        inside = float((self.lights.irradiance @ LUMINANCE_WEIGHTS).sum())
        found = len(self.lights) > 0
        return {
            "lights": len(self.lights),
            "rays_per_light": self.lights.rays_per_light,
            "energy_lights": inside / total if total > 0.0 else float("nan"),
            "smallest": float(degrees.min()) if found else None,
            "largest": float(degrees.max()) if found else None,
            **timing.columns(),
        }

    def image_row(self, case: Case, method: str) -> Row:
        """Errors and cost of an image; its picture into the folder, and the reference's."""
        view, truth = CaseScene.of(case).view, truth_in(self.folder, case)
        rendering, lights = self._rendered(view, method)
        image, inside = truth.exposed(rendering.image), view.coverage > 0.0
        where = self.folder, case.environment.name, case.scene
        keep_tile(tile_path(*where, method), image)
        keep_tile(tile_path(*where, "reference"), truth.image)
        judged = scores(rendering.image, truth, [metric.name for metric in ranked_metrics()])
        return {
            "lights": lights,
            **{name: found[name] for name, found in judged.items()},
            "brightness": _mean(image, inside) / _mean(truth.image, inside),
            "rays_per_point": rendering.rays.traced / len(view),
            "seconds_render": rendering.seconds,
        }

    def _rendered(self, view: View, method: str) -> tuple[Rendering, int]:
        """The image, and how many lights each point was given."""
        if method in MODES:
            rendering = render(view, self.lights, self.environment, mode=MODES[method])
            return rendering, len(self.lights)
        # Where no disc is found there is nothing to match: the rivals get the whole budget.
        rays = len(self.lights) * self.lights.rays_per_light or self.count
        lighting = _prepared(RIVALS[method], self.environment, rays)
        return render(view, lighting, self.environment), rays


def _mean(image: NDArray[np.float32], inside: NDArray[np.bool_]) -> float:
    return float((image[inside].astype(np.float64) @ LUMINANCE_WEIGHTS).mean())
