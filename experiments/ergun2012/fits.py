"""What a kd-tree keeps of a map: size and fit of its blocks, and of the law that draws them.

Reproduces Figures 1 and 2 and the compression ratios of Ergun, Kurt and Öztürk, "Real-time kd-tree
based importance sampling of environment maps", SCCG 2012: criteria by which blocks are chosen for
a split, fits by number of blocks, and pictures of the fitted density (see `blocks`). Embedded maps
are 2048 × 1024, as the paper's; its own maps (Uffizi, Doge2) cannot be passed on.
"""

import json
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.ergun2012 import published
from experiments.ergun2012.blocks import CURVE, blocks_of, fit_row, keep_pictures
from experiments.maps.sources import EnvironmentSource
from experiments.report.figures import line_plot
from experiments.report.parts import Heading, Part, Plot, Table
from experiments.report.sheets import kept_tile, sheet, tile_path
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest, run_folder
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from samplers.kd_tree.build import SELECTIONS

NAME = "kd-tree-fits"
HEIGHT = 1024
"""Rows of the embedded maps at every scale: the paper's, by which it counts compression."""
MAPS = {
    "quick": ["overcast-courtyard", "room-three-windows", "constant"],
    "standard": ["overcast-courtyard", "room-three-windows", "gothic-church", "fireplace-cabin",
                 "noon-desert", "concert-stage", "constant"],
    "paper": [],
}  # fmt: skip
"""A courtyard and a hall with windows stand for Uffizi and Doge2; at scale paper all 32."""
MOST_BLOCKS, FEW_BLOCKS = published.BLOCKS, 16
BLOCKS = (FEW_BLOCKS, 64, 256, 1024, MOST_BLOCKS)
OWN, SOLID_ANGLE = "sse", "solid-angle"
CRITERIA = {
    **{str(selection): (str(selection), SOLID_ANGLE) for selection in SELECTIONS},
    "sse, pixels alike": (OWN, "pixels"),
}
"""Selection and weighting by name; the paper's as published lets pixels count alike."""
FORMATS = {
    "environment": "s", "criterion": "s", "blocks": "d", "compression": ".1f", "unexplained": ".4f",
    "psnr_shown": ".1f", "distance_blocks": ".4f", "distance_law": ".4f", "variance_blocks": ".3f",
    "variance_law": ".3f", "residual": ".3f", "published": "s",
}  # fmt: skip
MEASURES = {
    "unexplained": "variation left", "psnr_shown": "PSNR shown",
    "variance_blocks": "variance of the blocks", "variance_law": "variance of the law",
}  # fmt: skip


@experiment(NAME)
def kd_tree_fits() -> Study:
    """Size and fit of a kd-tree's blocks, and of the law that draws them."""
    return Study(
        title="Blocks of a kd-tree (Ergun, Kurt and Öztürk 2012, Fig. 1 and 2)",
        sections=(fits_section, pictures_section),
        groups=groups,
        sources=("experiments.ergun2012.blocks",),
        timed=False,
        findings=lambda run: [best_criterion(run.rows)],
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map."""
    folder = run_folder(request.output, NAME, request.scale)
    sources = study_environments(request, of_scale(MAPS, request.scale), HEIGHT)
    return [_group(source, folder) for source in sources]


def _group(source: EnvironmentSource, folder: Path) -> Group:
    asked = {f"{name} {blocks}": (name, blocks) for name in CRITERIA for blocks in BLOCKS}
    depends = {"map": environment_identity(source), "sampler": SamplerSpec("kd-tree").identity}
    jobs = {
        key: Job({"environment": source.name, "criterion": name, "blocks": blocks}, depends)
        for key, (name, blocks) in asked.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        environment = source.load()
        size = {"width": environment.width, "height": environment.height}
        rows: dict[str, Row] = {}
        for key in names:
            name, blocks = asked[key]
            selection, weighting = CRITERIA[name]
            made = blocks_of(environment, blocks, selection, weighting)
            rows[key] = {**size, **fit_row(environment, made)}
            if blocks == MOST_BLOCKS and weighting == SOLID_ANGLE:
                keep_pictures(folder, environment, made, name)
        return rows

    return Group(source.name, jobs, measure)


def fits_section(run: Run) -> Iterator[Part]:
    """All fits beside the paper's compression."""
    rows = run.rows
    flat = rows.groupby("environment")["unexplained"].transform("max") == 0.0
    blocks = rows["blocks"]
    known = (blocks == MOST_BLOCKS) & ~flat | (blocks == FEW_BLOCKS) & flat
    known &= (rows["width"] == published.WIDTH) & (rows["criterion"] == OWN)
    table = rows.assign(published=blocks.map(published.COMPRESSIONS).where(known))
    caption = (
        "`compression` is the bytes of the map as one channel of 32 bits over those of the "
        "blocks' bounds, 8 a block; beside it the paper's, on maps of 2048 × 1024. `unexplained` "
        "is the part of the map's variation that block means leave; `psnr shown` is of the means "
        "as an 8-bit picture, in dB. `distance` (½ ∫ |p − q|) and `variance` (∫ p²/q − 1) compare "
        "the map's density with the blocks' and with the law's, which sampling uses; `residual` "
        f"is the L1 distance of the law's fit. {best_criterion(rows)}"
    )
    yield Table("fits", table.drop(columns=CURVE), FORMATS, caption=caption)


def best_criterion(rows: pd.DataFrame) -> str:
    """Which criterion leaves least, map by map, at the paper's number of blocks."""
    most = rows[rows["blocks"] == MOST_BLOCKS]
    varied = most[most.groupby("environment")["unexplained"].transform("max") > 0.0]
    if varied.empty:
        return "No map varies."
    found = []
    for column, name in MEASURES.items():
        ordered = varied.sort_values(column, ascending=column != "psnr_shown", kind="stable")
        best = ordered.groupby("environment", sort=True).first()["criterion"]
        found.append(f"{name}: " + ", ".join(f"{c} ({e})" for e, c in best.items()))
    return f"Best criterion at {MOST_BLOCKS} blocks (the paper: SSE) by " + "; ".join(found) + "."


def pictures_section(run: Run) -> Iterator[Part]:
    """Errors over the number of blocks, the law's curve, and pictures, map by map."""
    for name, part in run.rows.groupby("environment", sort=False):
        yield Heading(str(name), 3)
        flat = part["unexplained"].max() == 0.0
        for column, axis in () if flat else (
            ("unexplained", "part of the variation that blocks leave"),
            ("variance_law", "relative variance of a sample by the law"),
        ):  # fmt: skip
            rows, axes = part[part[column] > 0.0], ("blocks", axis)
            draw = partial(line_plot, rows, "blocks", column, "criterion", axes)
            yield Plot(f"{column}_{name}", draw, f"{name}: {axis}.")
        yield from _law(str(name), part, FEW_BLOCKS if flat else MOST_BLOCKS)
        yield from _sheets(run.folder, str(name), part)


def _law(name: str, part: pd.DataFrame, count: int) -> Iterator[Part]:
    chosen = part[(part["criterion"] == OWN) & (part["blocks"] == count)]
    if chosen.empty:
        return
    curve = pd.DataFrame(json.loads(chosen[CURVE].iloc[0]), columns=["block", "empirical", "law"])
    lines = curve.melt("block", var_name="kind", value_name="probability")
    rows, axes = lines[lines["probability"] > 0.0], ("number of the block", "probability")
    draw = partial(line_plot, rows, "block", "probability", "kind", axes)
    yield Plot(f"law_{name}", draw, f"{name}: probabilities of {count} blocks, and the law.")


def _sheets(folder: Path, name: str, part: pd.DataFrame) -> Iterator[Part]:
    psnr = part[part["blocks"] == MOST_BLOCKS].set_index("criterion")["psnr_shown"]
    criteria = [("map", "map")] + [
        (f"{criterion}, {psnr[criterion]:.1f} dB", criterion)
        for criterion in ("range", "variance", OWN) if criterion in psnr
    ]  # fmt: skip
    density = [
        ("luminance", "map"), (f"means of {MOST_BLOCKS} blocks", OWN),
        ("density of the fitted law", "law"),
        ("law over map: red too often, blue too seldom", "error"),
    ]  # fmt: skip
    for kind, tiles in (("criteria", criteria), ("density", density)):
        kept = [(text, kept_tile(tile_path(folder, name, tile))) for text, tile in tiles]
        yield sheet(f"{kind}_{name}.jpg", f"{name}: {kind}", kept, 2)
