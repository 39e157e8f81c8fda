"""Maps as a few area lights and an ambient map: how many, how long it takes, how good the images.

Reproduces Table 1 and Figures 2 and 3 of Arbree, Walter and Bala, "Pre-processing environment maps
for dynamic hardware shadows", 2005. For each map: the number of lights that `center-surround`
finds, their sizes and share of the energy, the time of the decomposition, and the lights drawn on
the map. For the scenes with three boxes (38 triangles) and a column (about 440): soft shadows by
rays over each disc, in the mode "area", which integrates over the disc, and in the mode "centre",
which takes all of a light from its centre as the paper's penumbra wedges do; beside them median cut
and `ours` with as many rays at each point. Errors are against the reference at its exposure;
`brightness` is the mean of the lit scene over the reference's, which tells the loss of shadows in
the ambient part and the paper's change of tone.

The paper's maps are Galileo's Tomb, Grace Cathedral, Kitchen and St Peter's; ours are others. Its
frame rates are a graphics card's of 2004 and are told, not compared.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.arbree2005.area_lights_report import report, save_tile
from experiments.maps.patterns import select
from experiments.maps.sources import EMBEDDED, EnvironmentSource, find_environments
from experiments.report.disc_map import draw_discs
from experiments.run.bench import interleaved
from experiments.run.case import Case
from experiments.run.kept_reference import kept_reference
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import find_scale
from experiments.run.study import Group, Job, Row, Study, run_study
from metrics.errors import exposure_scale, rmse
from metrics.flip import FlipReference
from renderer import scenes
from renderer.area import Mode
from renderer.render import Rendering, render
from renderer.view import View, make_view
from samplers import DiscLights, EnvironmentMap, Lighting
from samplers.environment import LUMINANCE_WEIGHTS

NAME = "area-lights"
SCENES = ["three-boxes", "column"]
RENDERED = {"quick": 6}
"""How many of the maps are rendered by default: the first of `MAPS`; all at larger scales."""
MAPS = (
    "gothic-church", "room-one-window", "room-three-windows", "concert-stage", "noon-desert",
    "studio-two-softboxes",
)  # fmt: skip
COUNT = {"quick": 64, "standard": 256, "paper": 1024}
"""Shadow rays at each point, shared among the lights; the paper's reference took 1024."""
ROUNDS = {"quick": 3, "standard": 5, "paper": 5}
AREA, DECOMPOSITION = SamplerSpec("center-surround"), "decomposition"
MODES: dict[str, Mode] = {"area": "area", "centre": "centre"}
RIVALS = ("median-cut", "ours")
TILE = 448


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    scale = find_scale(request.scale)
    sources = find_environments(
        request.environments, request.maps, scale.map_height, request.repair
    )
    rendered = {source.name for source in sources}
    if request.environments == EMBEDDED and not request.maps and scale.name in RENDERED:
        rendered = set(MAPS)
    chosen = select(scenes.names(), request.scenes or SCENES, "scene")
    count = request.lights(COUNT[scale.name])
    folder = run_folder(request.output, NAME, request.scale)
    groups = [
        _group(
            [Case(scene, source, scale) for scene in (chosen if source.name in rendered else [])],
            source, count, ROUNDS[scale.name], folder,
        )
        for source in sources
    ]  # fmt: skip
    modules = (__name__, "renderer.render")
    return run_study(Study(NAME, modules, groups, partial(report, count=count)), request, dry_run)


def _group(
    cases: list[Case], source: EnvironmentSource, count: int, rounds: int, folder: Path
) -> Group:
    common = {"environment": source.name, "height": source.height, "rays": count}
    jobs = {
        DECOMPOSITION: Job(
            {"table": DECOMPOSITION, **common},
            {"map": source.identity, "sampler": AREA.identity, "rounds": rounds},
        )
    }
    places: dict[str, tuple[Case, str]] = {}
    for case in cases:
        for method in (*MODES, *RIVALS):
            name = f"{case.scene} {method}"
            spec = AREA if method in MODES else SamplerSpec(method)
            jobs[name] = Job(
                {"table": "images", **common, "scene": case.scene, "method": method},
                {"case": case.identity, "sampler": spec.identity, "area": AREA.identity},
            )
            places[name] = (case, method)

    def measure(names: Sequence[str]) -> dict[str, Row]:
        stage = _Stage(source.load(), count, folder)
        rows: dict[str, Row] = {}
        if DECOMPOSITION in names:
            rows[DECOMPOSITION] = stage.decomposition(rounds)
        for case in cases:
            wanted = {n: places[n][1] for n in names if n in places and places[n][0] is case}
            if wanted:
                rows |= stage.images(case, wanted)
        return rows

    return Group(source.name, jobs, measure)


def _prepared(spec: SamplerSpec, environment: EnvironmentMap, count: int) -> Lighting:
    return spec.sampler.prepare(environment, count, np.random.default_rng(0))


class _Stage:
    """A map with its disc lights."""

    def __init__(self, environment: EnvironmentMap, count: int, folder: Path) -> None:
        self.environment, self.count, self.folder = environment, count, folder
        lights = _prepared(AREA, environment, count)
        assert isinstance(lights, DiscLights)
        self.lights = lights

    def decomposition(self, rounds: int) -> Row:
        """Number, size and energy of the lights, and the time to find them."""
        task = partial(_prepared, AREA, self.environment, self.count)
        timing = interleaved({DECOMPOSITION: task}, rounds)[DECOMPOSITION]
        with_lights, as_lights = draw_discs(self.environment, self.lights, TILE)
        save_tile(self.folder, [self.environment.name, "lights"], with_lights)
        save_tile(self.folder, [self.environment.name, "lighting"], as_lights)
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

    def images(self, case: Case, wanted: dict[str, str]) -> dict[str, Row]:
        """Errors of the methods by name, one scene; pictures of them into the folder."""
        scale = case.scale
        view = make_view(scenes.make(case.scene), scale.width, scale.height, scale.subpixels)
        reference = kept_reference(self.folder, view, self.environment, scale)
        inside = view.coverage > 0.0
        exposure = exposure_scale(reference.image, inside)
        truth = (reference.image * np.float64(exposure)).astype(np.float32)
        where = [case.environment.name, case.scene]
        save_tile(self.folder, [*where, "reference"], truth)
        judge = FlipReference.hdr(truth)
        rows: dict[str, Row] = {}
        for name, method in wanted.items():
            rendering, rays = self._rendered(view, method)
            image = (rendering.image * np.float64(exposure)).astype(np.float32)
            save_tile(self.folder, [*where, method], image)
            rows[name] = {
                "lights": len(self.lights) if method in MODES else rays,
                "rmse": rmse(image, truth),
                "flip": judge.compare(image).mean,
                "brightness": _mean(image, inside) / _mean(truth, inside),
                "noise_floor": reference.noise_floor * exposure,
                "rays_traced": rendering.rays.traced,
                "points": len(view),
                "seconds_render": rendering.seconds,
            }
        return rows

    def _rendered(self, view: View, method: str) -> tuple[Rendering, int]:
        """The image, and how many rays each point was allowed."""
        rays = len(self.lights) * self.lights.rays_per_light
        if method in MODES:
            return render(view, self.lights, self.environment, mode=MODES[method]), rays
        # Where no disc is found there is nothing to match: the rivals get the whole budget.
        rays = rays or self.count
        lighting = _prepared(SamplerSpec(method), self.environment, rays)
        return render(view, lighting, self.environment), rays


def _mean(image: NDArray[Any], inside: NDArray[np.bool_]) -> float:
    return float((image[inside].astype(np.float64) @ LUMINANCE_WEIGHTS).mean())
