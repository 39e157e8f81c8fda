"""Highly glossy materials at equal time: highlights of fixed lights against sampled reflectance.

Reproduces Fig. 11 of Wu 2025: MIS, median cut, TMMS and the paper's method on a scene of glossy
metals and glazes, 4 s each at the paper's resolution (see `equal-time`); beside them methods that
look at the surface. Errors are given over the whole image and over the pixels that see a glossy
object alone, at seed 0, where images are kept. The paper prints its figures inside the pictures
only. Scale quick has the embedded maps most like the paper's two, an attic and a fireplace, and one
of every kind.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.case_figures import CaseImages, comparison_figures, found_in_images
from experiments.report.parts import Heading, Part, Table
from experiments.report.sections.ranks import ranked
from experiments.report.style import label_of
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.loaded_run import Run
from experiments.run.rendering import cached_view
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.published import seconds_budget
from renderer.scene.materials import Lambert
from renderer.view import View

SAMPLERS = ("mis", "median-cut", "tmms", "ours")
"""The figure's."""
RIVALS = ("mis-compensated", "ris", "ris-stratified", "product", "restir")
"""Others that are made for glossy surfaces."""
ERRORS = ["rmse", "rmse_glossy", "flip", "flip_glossy"]
FORMATS = {"budget": "s", "sampler": "s", **dict.fromkeys(ERRORS, ".4f"), "cases": "d"}


@experiment("glossy")
def glossy() -> GridExperiment:
    """Glossy materials at equal time, with errors over glossy objects alone."""
    return GridExperiment(
        title="Glossy materials at equal time (Wu 2025, Fig. 11)",
        sections=(ranked(), over_glossy, comparison_figures(12)),
        scenes=("glossy",),
        samplers=lambda: tuple(map(SamplerSpec, SAMPLERS + RIVALS)),
        budgets=seconds_budget,
        quick_maps=1,
        quick_named=("room-one-window", "fireplace-cabin"),
        figures=(PaperFigure("Fig. 11", "glossy materials in equal time", beaten),),
    )


def beaten(run: Run) -> tuple[str, str]:
    """How many of the figure's methods have more error over glossy objects than the paper's."""
    errors = over_glossy_errors(run)
    means = errors.groupby("sampler")["flip_glossy"].mean()
    rivals = [name for name in SAMPLERS if name in means and name != "ours"]
    more = sum(bool(means["ours"] < means[name]) for name in rivals)
    return f"{answer(more, len(rivals))}: beats {more} of {len(rivals)}", told(errors)


def over_glossy_errors(run: Run) -> pd.DataFrame:
    """Errors of every image; those that were found before where no images are kept."""
    return found_in_images(
        run,
        "glossy.csv",
        lambda run, case: glossy_errors(case, glossy_pixels(run, str(case.rows[0]["scene"]))),
    )


def over_glossy(run: Run) -> Iterator[Part]:
    """Errors over the pixels that see an object which is not ideally diffuse."""
    errors = over_glossy_errors(run)
    if errors.empty:
        return
    yield Heading("Over glossy objects")
    yield Table(
        "glossy_means", glossy_means(errors, run.samplers), FORMATS,
        caption="At seed 0: `rmse glossy` and `flip glossy` over the pixels that see an object "
        "which is not ideally diffuse.",
    )  # fmt: skip


def glossy_errors(case: CaseImages, mask: NDArray[np.bool_]) -> pd.DataFrame:
    """Errors of a case's images over all pixels and over those of the mask, one line each."""
    lines = case.names
    squares = [(image.astype(np.float64) - case.truth) ** 2 for image in case.images]
    flips = [error.astype(np.float64) for error in case.error_maps()]
    for suffix, chosen in (("", np.ones_like(mask)), ("_glossy", mask)):
        some = bool(chosen.any())
        lines[f"rmse{suffix}"] = [np.sqrt(s[chosen].mean()) if some else np.nan for s in squares]
        lines[f"flip{suffix}"] = [f[chosen].mean() if some else np.nan for f in flips]
    return lines


def glossy_means(errors: pd.DataFrame, samplers: list[str]) -> pd.DataFrame:
    """Means by budget and sampler, in the order of `samplers`."""
    groups = errors.groupby(["budget", "sampler"], sort=False)
    table = groups[ERRORS].mean().assign(cases=groups.size()).reset_index()
    order = {name: place for place, name in enumerate(samplers)}
    return table.sort_values(["budget", "sampler"], key=lambda c: c.map(order).fillna(0))


def told(errors: pd.DataFrame) -> str:
    """On how many cases the paper's method has the smaller error over glossy objects."""
    case = ["scene", "environment", "budget"]
    flip = errors.pivot_table(index=case, columns="sampler", values="flip_glossy")
    rivals = [name for name in SAMPLERS if name in flip and name != "ours"]
    if "ours" not in flip or not rivals:
        return "Without the paper's method and another of the figure's methods nothing is compared."
    pairs = {name: flip[["ours", name]].dropna() for name in rivals}
    wins = [
        f"{label_of(name)} on {(pair['ours'] < pair[name]).sum()} of {len(pair)} cases"
        for name, pair in pairs.items()
    ]
    return (
        f"By FLIP over glossy objects, {label_of('ours')} has less error than "
        f"{', than '.join(wins)}. The paper says that it beats the "
        "other fixed sets, has less noise than MIS and may misplace highlights."
    )


def _view_of(run: Run, scene: str) -> View:
    scale = run.record["scale"]
    return cached_view(scene, scale["width"], scale["height"], scale["subpixels"])


def foreground(run: Run, scene: str) -> NDArray[np.bool_]:
    """(H, W), the pixels that see any surface."""
    return _view_of(run, scene).coverage > 0.0


def glossy_pixels(run: Run, scene: str) -> NDArray[np.bool_]:
    """(H, W), the pixels that see an object whose material is not ideally diffuse."""
    view = _view_of(run, scene)
    glossy = np.array([not isinstance(item.material, Lambert) for item in view.scene.objects])
    mask = np.zeros(view.height * view.width, np.bool_)
    mask[view.pixel[glossy[view.material]]] = True
    return mask.reshape(view.height, view.width)
