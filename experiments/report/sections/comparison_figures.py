"""Comparison figures of a run's cases: reference, methods, insets and error maps in one picture."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path

import pandas as pd

from experiments.report.case_figures import (
    CaseImages,
    costs,
    draw_case,
    kept_rows,
    read_case,
    shown_maps,
)
from experiments.report.parts import Heading, Part, Picture, Text
from experiments.run.experiment import Section
from experiments.run.loaded_run import Run

Lines = Callable[[Run, CaseImages], list[str]]


def comparison_figures(
    most: int = 8,
    part: Callable[[Run], Run] = lambda run: run,
    lines: Lines = costs,
    names: Mapping[str, str] | None = None,
) -> Section:
    """The section.

    most : how many maps are all shown; of more, see `shown_maps`
    part : which rows, samplers and budgets of the run are shown
    lines : a line of text under each image of a case
    names : what samplers are called above their images, where not by their labels
    """

    def section(run: Run) -> Iterator[Part]:
        yield Heading("Comparison figures")
        pictures = list(_pictures(part(run), most, lines, dict(names or {})))
        if pictures:
            yield Text(
                "At seed 0 and the reference's exposure; below each image the windows of largest "
                "mean error over all methods, and its FLIP map."
            )
        else:
            yield Text("No images are kept with these rows, so there are no comparison figures.")
        yield from pictures

    return section


def _pictures(run: Run, most: int, lines: Lines, names: dict[str, str]) -> Iterator[Picture]:
    """Of each case that has images, or whose figure was drawn when it had."""
    scenes = sorted(run.rows["scene"].unique())
    for environment, scene, budget in product(shown_maps(run.rows, most), scenes, run.budgets):
        stem = Path(scene).stem
        file, title = f"figures/{stem}_{environment}_{budget}.jpg", f"{stem} under {environment}"
        title = f"{title}, {budget}"
        rows = kept_rows(run, scene, environment, budget)
        if rows:
            yield Picture(file, title, partial(_draw, run, rows, title, lines, names))
        elif (run.folder / file).is_file():
            yield Picture(file, title)


def _draw(
    run: Run, rows: list[pd.Series], title: str, lines: Lines, names: dict[str, str], path: Path
) -> None:
    case = read_case(run, rows)
    draw_case(case, title, names, lines(run, case), path)
