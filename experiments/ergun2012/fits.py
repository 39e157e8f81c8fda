"""What a kd-tree keeps of a map: size and fit of its blocks, and of the law that draws them.

Reproduces Figures 1 and 2 and the compression ratios of Ergun 2012: criteria by which blocks are
chosen for a split, fits by number of blocks, and pictures of the fitted density. Its maps (Uffizi,
Doge2) cannot be passed on. Errors are integrals over solid angle; p is the map's density, luminance
over its integral, and q another one.

unexplained : ∫ (L − mean of the block)² over ∫ (L − mean of the map)²
psnr_shown : of the map of block means, as a grey picture of 8 bits at an automatic exposure
distance : ½ ∫ |p − q|, by the blocks' means and by the law's density
variance : ∫ p² / q − 1, the relative variance of one sample's estimate of the map's energy
"""

import json
import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.ergun2012 import COMPRESSIONS, MOST_BLOCKS, WIDTH
from experiments.maps.sources import EnvironmentSource
from experiments.report.case_figures import keep_tile, kept_tile, sheet, tile_path
from experiments.report.figures import line_plot
from experiments.report.parts import Heading, Part, Plot, Table, counted
from experiments.run.case import environment_identity
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    answer,
    experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from metrics.errors import psnr
from samplers import EnvironmentMap, EnvlightError, make_sampler
from samplers.kd_tree import KdTreeDistribution
from samplers.kd_tree.build import SELECTIONS
from samplers.kd_tree.fit import masses
from samplers.preview import automatic_exposure, encoded

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
FEW_BLOCKS = 16
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


@experiment(NAME)
def kd_tree_fits() -> Study:
    """Size and fit of a kd-tree's blocks, and of the law that draws them."""
    return Study(
        title="Blocks of a kd-tree (Ergun, Kurt and Öztürk 2012, Fig. 1 and 2)",
        sections=(fits_section, pictures_section),
        groups=groups,
        sources=(__name__,),
        timed=False,
        figures=(
            PaperFigure("Fig. 1", "maps of block means by three criteria", best_by_sse),
            PaperFigure("Fig. 2", "blocks' probabilities and the fitted law", fit_of_the_law),
        ),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map."""
    folder = request.folder
    sources = study_environments(request, of_scale(MAPS, request.scale), HEIGHT)
    return [_group(source, folder) for source in sources]


def _group(source: EnvironmentSource, folder: Path) -> Group:
    depends = {"map": environment_identity(source), "sampler": SamplerSpec("kd-tree").identity}
    asked = (
        ({"criterion": criterion, "blocks": blocks}, Row(), (criterion, blocks))
        for criterion in CRITERIA
        for blocks in BLOCKS
    )

    def measure(work: list[tuple[str, int]]) -> Iterator[Row]:
        environment = source.load()
        size = {"width": environment.width, "height": environment.height}
        for criterion, blocks in work:
            selection, weighting = CRITERIA[criterion]
            made = blocks_of(environment, blocks, selection, weighting)
            if blocks == MOST_BLOCKS and weighting == SOLID_ANGLE:
                keep_pictures(folder, environment, made, criterion)
            yield {**size, **fit_row(environment, made)}

    return Group(source.name, asked, measure, {"environment": source.name}, depends)


def fits_section(run: Run) -> Iterator[Part]:
    """All fits beside the paper's compression."""
    rows = run.rows
    flat = rows.groupby("environment")["unexplained"].transform("max") == 0.0
    blocks = rows["blocks"]
    known = (blocks == MOST_BLOCKS) & ~flat | (blocks == FEW_BLOCKS) & flat
    known &= (rows["width"] == WIDTH) & (rows["criterion"] == OWN)
    table = rows.assign(published=blocks.map(COMPRESSIONS).where(known))
    caption = (
        "`compression` is the bytes of the map as one channel of 32 bits over those of the "
        "blocks' bounds, 8 a block; beside it the paper's, on maps of 2048 × 1024. `unexplained` "
        "is the part of the map's variation that block means leave; `psnr shown` is of the means "
        "as an 8-bit picture, in dB. `distance` (½ ∫ |p − q|) and `variance` (∫ p²/q − 1) compare "
        "the map's density with the blocks' and with the law's, which sampling uses; `residual` "
        "is the L1 distance of the law's fit."
    )
    yield Table("fits", table.drop(columns=CURVE), FORMATS, caption=caption)


def _varied(rows: pd.DataFrame, criteria: Sequence[str]) -> pd.DataFrame:
    """The rows of maps that vary, at the paper's number of blocks."""
    most = rows[(rows["blocks"] == MOST_BLOCKS) & rows["criterion"].isin(criteria)]
    return most[most.groupby("environment")["unexplained"].transform("max") > 0.0]


def best_by_sse(run: Run) -> tuple[str, str]:
    """On how many maps the paper's criterion leaves least of the map's variation."""
    rows = _varied(run.rows, [*map(str, SELECTIONS)])
    left = rows.pivot_table(index="environment", columns="criterion", values="unexplained")
    best = int((left.idxmin(axis="columns") == OWN).sum())
    shown = rows[rows["criterion"] == OWN]
    return (
        f"{answer(best, len(left))}: SSE best on {best} of {len(left)}",
        f"Its {MOST_BLOCKS} blocks leave {100.0 * left[OWN].max():.1f} % of a map's variation at "
        f"most and hold it {shown['compression'].min():.0f} : 1; the paper has "
        f"{COMPRESSIONS[MOST_BLOCKS]}.",
    )


def fit_of_the_law(run: Run) -> tuple[str, str]:
    """How much more a sample by the law varies than one by the blocks themselves."""
    rows = _varied(run.rows, [OWN])
    times = rows["variance_law"] / rows["variance_blocks"]
    near = int((times <= FITS).sum())
    return (
        f"{answer(near, len(times))}: law's variance {times.min():.1f}× to {times.max():.1f}×",
        f"Blocks drawn by the fitted law instead of their own probabilities, on "
        f"{counted(len(times), 'map')}; the law misplaces {100.0 * rows['distance_law'].min():.0f} "
        f"to {100.0 * rows['distance_law'].max():.0f} % of the samples.",
    )


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
        for criterion in ("range", "variance", OWN)
        if criterion in psnr
    ]
    density = [
        ("luminance", "map"),
        (f"means of {MOST_BLOCKS} blocks", OWN),
        ("density of the fitted law", "law"),
        ("law over map: red too often, blue too seldom", "error"),
    ]
    for kind, tiles in (("criteria", criteria), ("density", density)):
        kept = [(text, kept_tile(tile_path(folder, name, tile))) for text, tile in tiles]
        yield sheet(f"{kind}_{name}.webp", f"{name}: {kind}", kept, 2)


FITS = 1.1
"""A law's variance of at most so many times the blocks' is said to fit."""
CURVE = "curve"
CURVE_POINTS = 60
PICTURE_WIDTH = 640
SHOWN_STOPS = 3.0
"""Ratios of the law's density to the map's are shown between 2⁻³ and 2³."""

Array = NDArray[np.float64]


def blocks_of(
    environment: EnvironmentMap, blocks: int, selection: str, weighting: str
) -> KdTreeDistribution:
    """The kd-tree sampler's distribution; EnvlightError for a black map, which has none."""
    sampler = make_sampler("kd-tree", blocks=blocks, selection=selection, weighting=weighting)
    made = sampler.prepare(environment, 1, np.random.default_rng(0))
    if not isinstance(made, KdTreeDistribution):
        raise EnvlightError(f"map '{environment.name}' is black: it has no blocks to fit")
    return made


def block_means(environment: EnvironmentMap, made: KdTreeDistribution) -> Array:
    """The map (H, W) of each block's mean luminance over solid angle."""
    label = made.label.ravel()
    solid_angle = np.repeat(environment.row_solid_angle, environment.width)
    flux = np.bincount(label, environment.flux.ravel())
    mean = flux / np.bincount(label, solid_angle)
    return np.asarray(mean[label].reshape(environment.luminance.shape))


def law_density(made: KdTreeDistribution) -> Array:
    """The density (H, W) in sr⁻¹ with which the law draws directions, at pixels' centres."""
    return np.asarray(made.density[made.label])


def fit_row(environment: EnvironmentMap, made: KdTreeDistribution) -> Row:
    """Size and errors of the blocks and of the law."""
    luminance = environment.luminance.astype(np.float64)
    weight = environment.row_solid_angle[:, None]
    total = environment.flux.sum()
    means, mean = block_means(environment, made), total / (4.0 * math.pi)
    varies = float((weight * (luminance - mean) ** 2).sum())
    left = float((weight * (luminance - means) ** 2).sum())
    p = luminance / total
    by_blocks, by_law = means / total, law_density(made)
    return {
        "drawn": len(made.record),
        "compression": made.compression_ratio,
        "unexplained": left / varies if varies > 1e-12 * mean * total else 0.0,
        "psnr_shown": psnr(grey(means, luminance), grey(luminance, luminance)),
        "distance_blocks": float(0.5 * (weight * np.abs(p - by_blocks)).sum()),
        "distance_law": float(0.5 * (weight * np.abs(p - by_law)).sum()),
        "variance_blocks": _variance(p, by_blocks, weight),
        "variance_law": _variance(p, by_law, weight),
        "alpha": made.alpha,
        "residual": made.residual,
        CURVE: json.dumps(law_curve(made)),
    }


def _variance(p: Array, q: Array, weight: Array) -> float:
    """∫ p² / q − 1 where p is; infinite where q leaves some of it out."""
    lit = p > 0.0
    if (q[lit] <= 0.0).any():
        return math.inf
    ratio = np.divide(p, q, out=np.zeros_like(p), where=lit)
    return max(0.0, float((weight * p * ratio).sum()) - 1.0)


def law_curve(made: KdTreeDistribution) -> list[list[float]]:
    """Block number from 1, empirical probability and the law's, at some blocks evenly in log."""
    count = len(made.record)
    number = np.unique(np.geomspace(1, count, CURVE_POINTS).round().astype(int))
    law = masses(count, made.alpha)
    return [[int(n), float(made.probability[n - 1]), float(law[n - 1])] for n in number]


def grey(luminance: Array, exposed_by: Array) -> NDArray[np.float32]:
    """A luminance map (H, W) as an exposed grey image (H, W, 3)."""
    level = 2.0 ** automatic_exposure(np.repeat(exposed_by[:, :, None], 3, axis=2))
    return np.repeat((luminance * level).astype(np.float32)[:, :, None], 3, axis=2)


def keep_pictures(
    folder: Path, environment: EnvironmentMap, made: KdTreeDistribution, selection: str
) -> None:
    """The map of block means; for "sse" also the map itself, the law's density and its error."""
    luminance = environment.luminance.astype(np.float64)
    name = environment.name
    _keep(tile_path(folder, name, selection), grey(block_means(environment, made), luminance))
    if selection == "sse":
        drawn = law_density(made) * environment.flux.sum()
        _keep(tile_path(folder, name, "map"), grey(luminance, luminance))
        _keep(tile_path(folder, name, "law"), grey(drawn, luminance))
        _keep(tile_path(folder, name, "error"), ratio_picture(drawn, luminance))


def ratio_picture(drawn: Array, luminance: Array) -> NDArray[np.float32]:
    """Red where the law draws too often, blue where too seldom, white where right.

    drawn : (H, W) the law's density times the map's energy, which should be its luminance

    Full colour is a factor of 8; what is dark and never drawn is black.
    """
    ratio = np.log2(np.maximum(drawn, 1e-30) / np.maximum(luminance, 1e-30)) / SHOWN_STOPS
    amount = np.clip(ratio, -1.0, 1.0)
    out = np.ones((*amount.shape, 3))
    out[..., 1:] -= 0.85 * np.maximum(amount, 0.0)[..., None]
    out[..., :2] -= 0.85 * np.maximum(-amount, 0.0)[..., None]
    out[(drawn <= 0.0) & (luminance <= 0.0)] = 0.0
    return out.astype(np.float32)


def _keep(path: Path, image: NDArray[np.float32]) -> None:
    """Keep an exposed image as a tile, reduced to about 640 texels across."""
    from PIL import Image

    factor = max(1, image.shape[1] // PICTURE_WIDTH)
    keep_tile(path, np.array(Image.fromarray(encoded(image)).reduce(factor)))
