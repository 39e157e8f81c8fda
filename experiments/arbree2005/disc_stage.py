"""A map with its disc lights: how long they take to find, and images lit by them and by rivals.

Pictures: the discs' outlines over the map, and the lighting that they stand for.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.report.preview import automatic_exposure, encoded
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
from samplers.center_surround import disc_pixels
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.sphere import cap_solid_angle, normalized, uv_from_direction

DISCS = SamplerSpec("center-surround")
MODES: dict[str, Mode] = {"area": "area", "centre": "centre"}
RIVALS = {name: SamplerSpec(name) for name in ("median-cut", "ours")}
TILE = 448
COLOR = (255, 60, 60)
CORNERS = 256


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


def rim(centre: NDArray[np.float64], half_angle: float) -> list[NDArray[np.float64]]:
    """The rim of a disc as runs of map coordinates (n, 2), cut where it crosses the seam."""
    axis = np.eye(3)[np.argmin(np.abs(centre))]
    tangent = normalized(np.cross(axis, centre), axis)
    turn = np.linspace(0.0, 2.0 * math.pi, CORNERS + 1)[:, None]
    side = np.cos(turn) * tangent + np.sin(turn) * np.cross(centre, tangent)
    u, v = uv_from_direction(math.cos(half_angle) * centre + math.sin(half_angle) * side)
    seam = np.flatnonzero(np.abs(np.diff(u)) > 0.5) + 1
    return np.split(np.stack([u, v], axis=1), seam)


def as_map(lights: DiscLights) -> NDArray[np.float64]:
    """The radiance (H, 2H, 3) that the lighting stands for: ambient map and uniform discs."""
    radiance = lights.ambient.radiance.astype(np.float64)
    height, width = radiance.shape[:2]
    u, v = uv_from_direction(lights.direction)
    level = lights.irradiance / cap_solid_angle(lights.half_angle)[:, None]
    for k, half_angle in enumerate(lights.half_angle):
        disc = disc_pixels(height, float(u[k]), float(v[k]), float(half_angle))
        for i, row in enumerate(disc.row):
            radiance[row, disc.columns(i, width)] += level[k]
    return radiance


def draw_discs(
    environment: EnvironmentMap, lights: DiscLights, width: int
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The map with the discs' rims, and the lighting as a map, (width / 2, width, 3) each.

    Both have the map's exposure.
    """
    from PIL import Image, ImageDraw

    exposure = automatic_exposure(environment.radiance)
    size = (width, width // 2)
    pictures = [
        Image.fromarray(encoded(radiance, exposure)).resize(size, Image.Resampling.BOX)
        for radiance in (environment.radiance, as_map(lights))
    ]
    draw = ImageDraw.Draw(pictures[0])
    for centre, half_angle in zip(lights.direction, lights.half_angle, strict=True):
        for run in rim(centre, float(half_angle)):
            draw.line([(u * size[0], v * size[1]) for u, v in run], fill=COLOR, width=2)
    return np.array(pictures[0]), np.array(pictures[1])
