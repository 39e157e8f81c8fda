"""Highly glossy materials at equal time: highlights of fixed lights against sampled reflectance.

Reproduces Fig. 11 of Wu, "Efficient environment map rendering based on decomposition", 2025: MIS,
median cut, TMMS and the paper's method on a scene of glossy metals and glazes, 4 s each at the
paper's resolution (see `equal-time`). Errors are given over the whole image and over the pixels
that see a glossy object alone, at seed 0, where images are kept. The paper says that its method
beats the other fixed sets, has less noise than MIS and may misplace highlights; it prints its
figures inside the pictures only.

Scale quick uses the embedded maps most like the paper's two, an attic and a fireplace, and one of
every other kind, chosen by kind alone; --maps '*' takes all.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.maps.classes import representatives
from experiments.maps.sources import EMBEDDED
from experiments.report.case_figures import CaseImages
from experiments.run.defaults import QUICK
from experiments.run.foreground import glossy_pixels
from experiments.run.grid_experiment import GridExperiment, Run, run_grid
from experiments.run.request import RunRequest
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.equal_time import FORMATS, means, seconds_budget

NAME = "glossy"
TITLE = "Glossy materials at equal time (Wu 2025, Fig. 11)"
SCENES = ("glossy",)
LIKE_THE_PAPERS = ["room-one-window", "fireplace-cabin"]
SAMPLERS = ("mis", "median-cut", "tmms", "ours")
GLOSSY_FORMATS = {
    "budget": "s", "sampler": "s", "rmse": ".4f", "rmse_glossy": ".4f", "flip": ".4f",
    "flip_glossy": ".4f", "cases": "d",
}  # fmt: skip


def paper_samplers() -> tuple[SamplerSpec, ...]:
    """The methods of the figure, in its order."""
    return tuple(SamplerSpec(name) for name in SAMPLERS)


def glossy_errors(case: "CaseImages", mask: np.ndarray) -> pd.DataFrame:
    """Errors of a case's images over all pixels and over those of the mask, one line each."""
    lines = []
    for row, image, error in zip(case.rows, case.images, case.flip_maps(), strict=True):
        squared = (image.astype(np.float64) - case.truth) ** 2
        inside = bool(mask.any())
        lines.append(
            {
                "scene": row["scene"], "environment": row["environment"], "budget": row["budget"],
                "sampler": row["sampler"], "rmse": row["rmse"], "flip": row["flip"],
                "rmse_glossy": float(np.sqrt(squared[mask].mean())) if inside else np.nan,
                "flip_glossy": float(error[mask].mean(dtype=np.float64)) if inside else np.nan,
                "noise_floor": row["noise_floor"],
            }
        )  # fmt: skip
    return pd.DataFrame(lines)


def report(run: Run) -> list[Path]:
    """The report with means, errors over glossy objects and strips; tables as CSV."""
    from experiments.report.case_figures import (
        case_images,
        gallery,
        shown_maps,
        write_strips,
    )
    from experiments.report.frames import rounded, table
    from experiments.report.write import closing, opening
    from experiments.run.record import found_or_kept, write_text

    lines, files = opening(run, TITLE), []
    formats = {name: text for name, text in FORMATS.items() if not name.startswith("paper")}
    for budget in run.budgets:
        rows = run.rows[run.rows["budget"] == budget]
        if len(rows):
            lines += [f"## {budget}", "", table(rounded(means(rows), formats), "pipe"), ""]
    cases = [
        case_images(run, *names)
        for names in run.rows[["scene", "environment", "budget"]]
        .drop_duplicates()
        .itertuples(index=False, name=None)
    ]
    found = [
        glossy_errors(case, glossy_pixels(run, str(case.rows[0]["scene"])))
        for case in cases
        if case is not None
    ]
    kept = run.folder / "glossy.csv"
    errors = found_or_kept(kept, pd.concat([pd.DataFrame(), *found], ignore_index=True))
    if len(errors):
        files.append(kept)
        lines += [
            "## Over glossy objects",
            "",
            table(rounded(_means(errors, run.samplers), GLOSSY_FORMATS), "pipe"),
            "",
            "At seed 0: `rmse glossy` and `flip glossy` over the pixels that see an object which "
            "is not ideally diffuse.",
            "",
        ]
    strips = write_strips(run, shown_maps(run.rows, 12))
    lines += [
        "Times and rays are means of what was really used; `near floor` counts measurements "
        "within 3× "
        "of the noise of their reference.",
        "",
        *gallery(run, strips),
        *closing(run),
    ]
    path = run.folder / "report.md"
    write_text(path, "\n".join(lines))
    return [path, *files]


def _means(errors: pd.DataFrame, samplers: list[str]) -> pd.DataFrame:
    columns = ["rmse", "rmse_glossy", "flip", "flip_glossy"]
    groups = errors.groupby(["budget", "sampler"], sort=False)
    table = groups[columns].mean().assign(cases=groups.size()).reset_index()
    order = {name: place for place, name in enumerate(samplers)}
    return table.sort_values(["budget", "sampler"], key=lambda c: c.map(order).fillna(0))


EXPERIMENT = GridExperiment(NAME, TITLE, SCENES, paper_samplers, seconds_budget, report)


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    if request.scale == QUICK and not request.maps and request.environments == EMBEDDED:
        maps = [*LIKE_THE_PAPERS, *representatives(1)]
        request = replace(request, maps=list(dict.fromkeys(maps)))
    return run_grid(EXPERIMENT, request, dry_run)
