"""The report's end: pictures side by side, versions and settings, what is not compared."""

from collections.abc import Iterator

from experiments.questions.production_renderers.measure import (
    CONVERGED,
    SHOWN_SAMPLES,
    picture_path,
)
from experiments.questions.production_renderers.noise_tables import (
    BASE,
    measured,
    reported_settings,
)
from experiments.questions.production_renderers.shots import OWN
from experiments.report.parts import Heading, Items, Part, Text
from experiments.report.sheets import kept_tile, sheet
from experiments.run.loaded_run import Run


def settings(run: Run) -> Iterator[Part]:
    """Versions and settings, as the renderers' programs report them."""
    rows = measured(run)
    if rows.empty:
        return
    yield Heading("Versions and settings")
    found = []
    for renderer, answers in reported_settings(rows).items():
        for facts in answers:
            told = "; ".join(f"{key} {value}" for key, value in facts.items() if key != "renderer")
            found.append(f"{renderer}: {told}.")
    yield Items(tuple(found))


def pictures(run: Run) -> Iterator[Part]:
    """Every scene under the first map: the converged mean, and each renderer's few samples."""
    rows = run.rows
    environment = str(rows["environment"].iloc[0])
    labels = [str(name) for name in dict.fromkeys(rows["renderer"])]
    scenes = [str(name) for name in dict.fromkeys(rows["scene"])]
    yield Heading("Images")
    for materials in dict.fromkeys(rows["materials"]):
        tiles = []
        for scene in scenes:
            shown = [(BASE, CONVERGED), *((label, str(SHOWN_SAMPLES)) for label in labels)]
            for label, name in shown:
                place = (scene, str(materials), environment, label, name)
                title = "converged" if name == CONVERGED else label
                tiles.append((f"{scene}, {title}", kept_tile(picture_path(run.folder, *place))))
        caption = f"{materials} under {environment}, {SHOWN_SAMPLES} samples a pixel."
        yield sheet(f"images_{materials}.jpg", caption, tiles, len(labels) + 1)


def limits(run: Run) -> Iterator[Part]:
    """What each renderer does with the map, and what is not compared."""
    yield Heading("What each does with a map")
    yield Items(
        (
            "Mitsuba 3 draws from a table of luminance × sin θ at the map's resolution, by a "
            "hierarchical warp; its compensation takes the mean off that table.",
            "Cycles draws from a table of the mean of red, green and blue × sin θ, of at least "
            "4096×2048 cells.",
            "LuxCore draws from a table of luminance without sin θ, and so too often near the "
            "poles; the density divides by sin θ, which keeps it unbiased. Where a path may have "
            "one vertex only it draws from that table alone, and is far noisier; here paths have "
            "two, of which the second ends them before any other surface shines.",
            f"{OWN} draws from a table of luminance × solid angle; `mis-compensated` takes off "
            "what BRDF sampling covers; `ris-stratified` traces the best of several candidates.",
        )
    )
    yield Heading("What is not compared")
    yield Text(
        "Only direct light under a map, with two kinds of materials, on the processor. These "
        "programs are made for more: light that bounces, textures, many kinds of lights, graphics "
        "processors, denoisers; what they take for that generality is in their times. Of light "
        "under a map alone nothing here says which of them is the better renderer."
    )
