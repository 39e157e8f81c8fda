"""Maps as a few area lights and an ambient map: how many, how long it takes, how good the images.

Reproduces Table 1 and Figures 2 and 3 of Arbree 2005. For each map: the number of lights that
`center-surround` finds, their sizes and share of the energy, the time of the decomposition, and the
lights drawn on the map. For the scenes with three boxes (38 triangles) and a column (about 440):
soft shadows by rays over each disc, in the mode "area", which integrates over the disc, and in the
mode "centre", which takes all of a light from its centre as the paper's penumbra wedges do; beside
them median cut and `ours` with as many rays at each point. How many rays the discs take is known
only when they are found, so that the images are rows of this study, judged as a grid judges.

The paper's maps are Galileo's Tomb, Grace Cathedral, Kitchen and St Peter's; ours are others. Its
frame rates are a graphics card's of 2004 and are told, not compared.
"""

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.sources import EMBEDDED, EnvironmentSource
from experiments.report.case_figures import keep_tile, kept_tile, sheet, tile_path
from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.style import label_of
from experiments.report.tables import with_milliseconds
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import Case, choose_scenes, environment_identity, name_and_file
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    answer,
    experiment,
)
from experiments.run.judging import scores, truth_in
from experiments.run.loaded_run import Run
from experiments.run.rendering import CaseScene
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import find_scale, of_scale
from experiments.run.study import study_environments
from metrics.registry import leading_metric, ranked_metrics
from renderer.area import Mode
from renderer.render import Rendering, render
from renderer.view import View
from samplers import DiscLights, EnvironmentMap, Lighting
from samplers.center_surround import disc_pixels
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.preview import automatic_exposure, encoded
from samplers.sphere import cap_solid_angle, normalized, uv_from_direction

NAME = "area-lights"
SCENES = ["three-boxes", "column"]
RENDERED = (
    "gothic-church", "room-one-window", "room-three-windows", "concert-stage", "noon-desert",
    "studio-two-softboxes",
)  # fmt: skip
"""At scale quick images are of these of the embedded maps alone."""
COUNT = {"quick": 64, "standard": 256, "paper": 1024}
"""Shadow rays at each point, shared among the lights; the paper's reference took 1024."""
ROUNDS = {"quick": 3, "standard": 5, "paper": 5}
LIGHTS, IMAGES = "lights", "images"
LIGHT_FORMATS = {
    "environment": "s", "lights": ".0f", "energy_lights": ".1%", "smallest": ".1f",
    "largest": ".1f", "ms": ".1f", "ms_lower": ".1f", "ms_upper": ".1f",
}  # fmt: skip
PAPER_FORMATS = {"map": "s", "lights": "d", "fps_three_boxes": ".1f", "fps_column": ".1f"}
TABLE1 = pd.DataFrame(
    [
        ("Galileo", 8, 12.8, 7.5),
        ("Grace", 10, 6.7, 4.2),
        ("Kitchen", 4, 21.2, 5.6),
        ("St Peter's", 17, 5.1, 4.1),
    ],
    columns=["map", "lights", "fps_three_boxes", "fps_column"],
)
"""As printed: frames per second of a GeForce 6800 of 2004 at 512 × 512 pixels."""
REFERENCE_FPS, REFERENCE_POINTS = 0.1, 1024
DECOMPOSITION = "0.5 to 1.5 hours on two Xeons of 3.06 GHz"


@experiment(NAME)
def area_lights() -> Study:
    """Area lights and an ambient map: how many, how long it takes, how good images are."""
    return Study(
        title="Area lights and an ambient map (Arbree, Walter and Bala 2005)",
        sections=(lights_section, images_section),
        groups=groups,
        sources=(__name__,),
        figures=(
            PaperFigure("Table 1", "lights of each map, and frames a second", numbers),
            PaperFigure("Fig. 2", "maps and the lights found on them", energy_of_lights),
            PaperFigure("Fig. 3", "two scenes with soft shadows", images_beside_rivals),
        ),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map: its lights, and the images under it."""
    scale = find_scale(request.scale)
    if request.reference_noise:
        scale = scale.with_noise(request.reference_noise)
    sources = study_environments(request, [], scale.map_height)
    few = scale.name == "quick" and request.environments == EMBEDDED and not request.maps
    scenes = [name_and_file(scene) for scene in choose_scenes(request.scenes or SCENES)]
    folder = request.folder
    rounds = of_scale(ROUNDS, scale.name)
    count = request.budget(Budget(of_scale(COUNT, scale.name))).lights
    found = []
    for source in sources:
        cases = [Case(name, source, scale, file) for name, file in scenes]
        rendered = cases if source.name in RENDERED or not few else []
        found.append(_group(source, rendered, count, rounds, folder))
    return found


def _group(
    source: EnvironmentSource, cases: list[Case], count: int, rounds: int, folder: Path
) -> Group:
    common = {"environment": source.name, "count": count}
    depends = {"map": environment_identity(source), "discs": DISCS.identity}
    asked: list[tuple[Row, Row, tuple[Case, str] | None]] = [
        ({"table": LIGHTS, **common}, {**depends, "rounds": rounds}, None)
    ]
    for case in cases:
        for method in (*MODES, *RIVALS):
            rival = RIVALS[method].identity if method in RIVALS else {}
            columns = {"table": IMAGES, **common, "scene": case.scene, "method": method}
            reference = {"reference": case.reference_identity, "rival": rival}
            asked.append((columns, {**depends, **reference}, (case, method)))

    def measure(work: list[tuple[Case, str] | None]) -> Iterator[Row]:
        stage = Stage(source.load(), count, folder)
        return (stage.image_row(*one) if one else stage.lights_row(rounds) for one in work)

    return Group(source.name, asked, measure)


def numbers(run: Run) -> tuple[str, str]:
    """On how many maps lights are found, how many and how quickly."""
    lights = run.rows[run.rows["table"] == LIGHTS]
    found, ms = lights.loc[lights["lights"] > 0, "lights"], 1e3 * lights["seconds"]
    return (
        f"{answer(len(found), len(lights))}: lights on {len(found)} of {len(lights)} maps",
        f"{found.min():.0f} to {found.max():.0f} of them, the paper {TABLE1['lights'].min()} to "
        f"{TABLE1['lights'].max()}; made in {ms.min():.0f} to {ms.max():.0f} ms, the paper's in "
        f"{DECOMPOSITION}. Its frames a second are a graphics card's.",
    )


def energy_of_lights(run: Run) -> tuple[str, str]:
    """How much of the maps' energy the lights have."""
    lights = run.rows[run.rows["table"] == LIGHTS]
    share = 100.0 * lights.loc[lights["lights"] > 0, "energy_lights"]
    return (
        f"shown: {len(share)} maps with lights",
        f"The discs have {share.min():.0f} to {share.max():.0f} % of the map's energy, "
        f"{share.median():.0f} % in the median.",
    )


def images_beside_rivals(run: Run) -> tuple[str, str]:
    """The images' error in both modes, and that of rivals with as many rays."""
    images = run.rows[run.rows["table"] == IMAGES]
    means = images.groupby("method")[leading_metric().name].mean()
    told = ", ".join(
        f"{label_of(name)} {means[name]:.3f}" for name in (*MODES, *RIVALS) if name in means
    )
    least = means.idxmin()
    return (
        f"shown: {label_of(str(least))} has least error",
        f"Mean {leading_metric().label} with as many rays, discs in the modes area and centre: "
        f"{told}.",
    )


def lights_section(run: Run) -> Iterator[Part]:
    """The lights of each map beside the paper's, and the maps with them."""
    lights = run.rows[run.rows["table"] == LIGHTS].dropna(axis=1, how="all")
    if lights.empty:
        return
    lights = with_milliseconds(lights)
    caption = (
        f"Lights are found on {(lights['lights'] > 0).sum()} of {len(lights)} maps. Smallest and "
        "largest: half angles of the discs in degrees. "
        f"At most {lights['count'].max()} lights, as each gets at least one ray. Times are medians "
        f"and quartiles of the whole decomposition; the paper's took {DECOMPOSITION}."
    )
    paper = (
        "Table 1 of Arbree 2005, on other maps and a graphics card of 2004, 512 × 512 pixels; its "
        f"reference of {REFERENCE_POINTS} points ran at {REFERENCE_FPS} fps."
    )
    yield Heading("Lights (Table 1, Fig. 2)")
    yield Table("lights", lights, LIGHT_FORMATS, caption=caption)
    yield Table("lights_published", TABLE1, PAPER_FORMATS, caption=paper)
    yield Text(noise_sentence(lights))
    tiles = [
        (f"{name}{label}", kept_tile(tile_path(run.folder, name, kind)))
        for name in lights["environment"]
        for kind, label in (("discs", ""), ("lighting", ": lights and ambient"))
    ]
    yield sheet("maps.webp", "Maps with their lights, and the lighting these stand for", tiles, 4)


def images_section(run: Run) -> Iterator[Part]:
    """Errors by image and their means, and the images."""
    images = run.rows[run.rows["table"] == IMAGES].dropna(axis=1, how="all")
    if images.empty:
        return
    images = images.assign(ms=1e3 * images["seconds_render"])
    errors = [metric for metric in ranked_metrics() if metric.name in images]
    names = [metric.name for metric in errors]
    judged = {metric.name: f".{metric.digits}f" for metric in errors} | {"brightness": ".3f"}
    headings = {metric.name: metric.label for metric in errors}
    by_method = images.groupby(["scene", "method"], sort=False)
    means = by_method[[*names, "brightness"]].mean()
    means["maps"] = by_method["environment"].nunique()
    caption = (
        "All methods are allowed the same number of rays at each point: the budget, or what equal "
        "shares for all discs leave of it; the other methods as so many lights, of which "
        f"{label_of('ours')} renders most at a quarter of the pixels. Rays per point: those that "
        "were traced. Brightness: mean of the scene over the reference's; above 1, light leaks "
        "through the ambient part, which casts no shadows."
    )
    yield Heading("Images (Fig. 3)")
    formats = {"scene": "s", "method": "s", "maps": "d"} | judged
    yield Table("image_means", means.reset_index(), formats, headings, caption="Means over maps.")
    formats = {"scene": "s", "environment": "s", "method": "s", "lights": ".0f"} | judged
    formats |= {"rays_per_point": ".1f", "ms": ".0f"}
    yield Table("images", images, formats, headings, caption=caption)
    tiles = []
    for key, part in images.groupby(["environment", "scene"], sort=False):
        tiles.append((f"{key[0]}: reference", kept_tile(tile_path(run.folder, *key, "reference"))))
        for _, row in part.iterrows():
            label = f"{label_of(row['method'])} " + " / ".join(f"{row[name]:.3f}" for name in names)
            tiles.append((label, kept_tile(tile_path(run.folder, *key, row["method"]))))
    columns = 1 + images["method"].nunique()
    legend = f"References and images with {' / '.join(headings.values())}"
    yield sheet("images.webp", legend, tiles, columns)


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
