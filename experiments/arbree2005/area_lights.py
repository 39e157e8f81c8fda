"""Maps as a few area lights and an ambient map: how many, how long it takes, how good the images.

Reproduces Table 1 and Figures 2 and 3 of Arbree, Walter and Bala, "Pre-processing environment maps
for dynamic hardware shadows", 2005. For each map: the number of lights that `center-surround`
finds, their sizes and share of the energy, the time of the decomposition, and the lights drawn on
the map. For the scenes with three boxes (38 triangles) and a column (about 440): soft shadows by
rays over each disc, in the mode "area", which integrates over the disc, and in the mode "centre",
which takes all of a light from its centre as the paper's penumbra wedges do; beside them median cut
and `ours` with as many rays at each point. The modes are the renderer's, and how many rays the
discs take is known only when they are found; a grid has neither, so that the images are rows of
this study, on a grid's cases and judged as a grid judges. `brightness` is the mean of the lit scene
over the reference's, which tells the loss of shadows in the ambient part and the paper's change of
tone.

The paper's maps are Galileo's Tomb, Grace Cathedral, Kitchen and St Peter's; ours are others. Its
frame rates are a graphics card's of 2004 and are told, not compared.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from experiments.arbree2005.disc_stage import DISCS, MODES, RIVALS, Stage
from experiments.maps.sources import EMBEDDED, EnvironmentSource
from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sheets import kept_tile, sheet, tile_path
from experiments.report.tables import with_milliseconds
from experiments.run.bench import noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import Case, environment_identity
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest, run_folder
from experiments.run.scale import find_scale, of_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.study import study_environments
from metrics.registry import ranked_metrics

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
        sources=("experiments.arbree2005.disc_stage",),
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map: its lights, and the images under it."""
    scale = find_scale(request.scale)
    if request.reference_noise:
        scale = scale.with_noise(request.reference_noise)
    sources = study_environments(request, [], scale.map_height)
    few = scale.name == "quick" and request.environments == EMBEDDED and not request.maps
    scenes = [name_and_file(scene) for scene in choose_scenes(request.scenes or SCENES)]
    folder = run_folder(request.output, NAME, request.scale)
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
    jobs = {LIGHTS: Job({"table": LIGHTS, **common}, {**depends, "rounds": rounds})}
    asked: dict[str, tuple[Case, str]] = {}
    for case in cases:
        for method in (*MODES, *RIVALS):
            name = f"{case.scene} {method}"
            rival = RIVALS[method].identity if method in RIVALS else {}
            columns = {"table": IMAGES, **common, "scene": case.scene, "method": method}
            reference = {"reference": case.reference_identity, "rival": rival}
            jobs[name] = Job(columns, {**depends, **reference})
            asked[name] = case, method

    def measure(names: Sequence[str]) -> dict[str, Row]:
        stage = Stage(source.load(), count, folder)
        return {
            name: stage.image_row(*asked[name]) if name in asked else stage.lights_row(rounds)
            for name in names
        }

    return Group(source.name, jobs, measure)


def found_sentence(lights: pd.DataFrame) -> str:
    """On how many maps there are lights, and how many."""
    found = lights.loc[lights["lights"] > 0, "lights"]
    span = f"{found.min():.0f} to {found.max():.0f}" if len(found) else "none"
    return f"Lights are found on {len(found)} of {len(lights)} maps: {span} of them."


def findings(run: Run) -> list[str]:
    """On how many maps there are lights."""
    lights = run.rows[run.rows["table"] == LIGHTS]
    return [found_sentence(lights)] if len(lights) else []


def lights_section(run: Run) -> Iterator[Part]:
    """The lights of each map beside the paper's, and the maps with them."""
    lights = run.rows[run.rows["table"] == LIGHTS].dropna(axis=1, how="all")
    if lights.empty:
        return
    lights = with_milliseconds(lights)
    caption = (
        f"{found_sentence(lights)} Smallest and largest: half angles of the discs in degrees. "
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
    yield sheet("maps.jpg", "Maps with their lights, and the lighting these stand for", tiles, 4)


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
        "shares for all discs leave of it; median-cut and ours as so many lights, of which ours "
        "renders most at a quarter of the pixels. Rays per point: those that were traced. "
        "Brightness: mean of the scene over the reference's; above 1, light leaks through the "
        "ambient part, which casts no shadows."
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
            label = f"{row['method']} " + " / ".join(f"{row[name]:.3f}" for name in names)
            tiles.append((label, kept_tile(tile_path(run.folder, *key, row["method"]))))
    columns = 1 + images["method"].nunique()
    legend = f"References and images with {' / '.join(headings.values())}"
    yield sheet("images.jpg", legend, tiles, columns)
