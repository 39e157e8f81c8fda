"""The kept images of a run's cases as pictures: comparison figures and montages.

A comparison figure has a case's reference, methods, insets and error maps; a montage is a sheet of
the reference and every sampler's image with its errors.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.classes import named_class, without_resolution
from experiments.maps.poly_haven import SUITES
from experiments.report.comparison_figure import Column, comparison_figure, worst_windows
from experiments.report.parts import Heading, Part, Picture, Text
from experiments.run.experiment import Section
from experiments.run.loaded_run import Run
from experiments.run.record import found_or_kept
from metrics.flip import FlipReference
from metrics.registry import leading_metric, ranked_metrics
from renderer.image import write_jpeg, write_png
from samplers.preview import contact_sheet, encoded, enlarged

COLUMNS, MONTAGE_COLUMNS = 8, 4
Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class CaseImages:
    """The kept images of a case at a budget, exposed, in the run's order of samplers.

    rows : of the images, one each; truth : (H, W, 3), the reference
    """

    rows: list[pd.Series]
    truth: Image
    images: list[Image]

    @property
    def names(self) -> pd.DataFrame:
        """Scene, environment, budget and sampler of every image."""
        rows = pd.DataFrame(self.rows).reset_index(drop=True)
        return rows[["scene", "environment", "budget", "sampler"]]

    def error_maps(self) -> list[Image]:
        """HDR-FLIP of every image, (H, W) each."""
        reference = FlipReference.hdr(self.truth)
        return [reference.compare(image).error_map for image in self.images]


Lines = Callable[[Run, CaseImages], list[str]]


def kept_rows(run: Run, scene: str, environment: str, budget: str) -> list[pd.Series]:
    """The rows of seed 0 whose images are kept; none where the reference is not."""
    at = run.at(budget)
    chosen = at[(at["scene"] == scene) & (at["environment"] == environment) & (at["seed"] == 0)]
    places = {name: place for place, name in enumerate(run.samplers)}
    chosen = chosen.sort_values("sampler", key=lambda names: names.map(places), kind="stable")
    kept = [row for _, row in chosen.iterrows() if run.kept_image(row) is not None]
    return kept if kept and run.kept_reference(kept[0]) is not None else []


def _kept_cases(run: Run) -> Iterator[list[pd.Series]]:
    """`kept_rows` of every case and budget that has any."""
    cases = run.rows[["scene", "environment", "budget"]].drop_duplicates()
    kept = (kept_rows(run, *names) for names in cases.itertuples(index=False, name=None))
    return filter(None, kept)


def read_case(run: Run, rows: list[pd.Series]) -> CaseImages | None:
    """The images of `kept_rows` that can be read; None where none or no reference can."""
    exposure = np.float64(rows[0]["exposure"])
    truth = run.read(run.kept_reference(rows[0]))
    found = [(row, run.read(run.kept_image(row))) for row in rows]
    images = [(row, image) for row, image in found if image is not None]
    if truth is None or not images:
        return None
    exposed = [(image * exposure).astype(np.float32) for _, image in images]
    return CaseImages([row for row, _ in images], (truth * exposure).astype(np.float32), exposed)


def found_in_images(
    run: Run, file: str, measure: Callable[[Run, CaseImages], pd.DataFrame]
) -> pd.DataFrame:
    """What is measured on every case and budget with images; what `file` keeps where none is."""
    cases = filter(None, (read_case(run, rows) for rows in _kept_cases(run)))
    found = [measure(run, case) for case in cases]
    return found_or_kept(run.folder / file, pd.concat(found or [pd.DataFrame()], ignore_index=True))


def _draw(
    run: Run, rows: list[pd.Series], title: str, lines: Lines, names: Mapping[str, str], path: Path
) -> None:
    """Write a case's comparison figure, unless its images cannot be read."""
    case = read_case(run, rows)
    if case is None:
        return
    errors = case.error_maps()
    columns = [Column("reference", case.truth, None, (_floors(rows[0]),))]
    told = zip(case.rows, case.images, errors, lines(run, case), strict=True)
    for row, image, error, line in told:
        label = str(row["sampler"])
        numbers = "  ".join(f"{m.label} {row[m.name]:.{m.digits}f}" for m in ranked_metrics())
        columns.append(Column(names.get(label, label), image, error, (numbers, line)))
    windows = worst_windows(np.mean(errors, axis=0))
    write_jpeg(path, comparison_figure(columns, windows, title, COLUMNS))


def _floors(row: pd.Series) -> str:
    floors = [(m, row[m.floor_column]) for m in ranked_metrics() if m.floor_column in row]
    return "noise: " + "  ".join(f"{metric.label} {floor:.4f}" for metric, floor in floors)


def costs(run: Run, case: CaseImages) -> list[str]:
    """What each image took: lights, rays per sub-pixel, milliseconds to render."""
    return [
        f"{row['lights']} lights, {row['rays']:.1f} rays, {1e3 * row['seconds_render']:.0f} ms"
        for row in case.rows
    ]


def hardest_maps(rows: pd.DataFrame, count: int = 2) -> list[str]:
    """The maps on which even the best sampler's leading error, averaged over scenes, is largest."""
    means = (
        rows.groupby(["environment", "sampler"])[leading_metric().name].mean().unstack("sampler")
    )
    least = means.min(axis=1).sort_values(ascending=False, kind="stable")
    return [str(name) for name in least.index[:count]]


def shown_maps(rows: pd.DataFrame, most: int = 8) -> list[str]:
    """The maps that figures are drawn for: all where there are few; else those that Wu 2025 names,
    one of each class of the others in the rows' order, and the two hardest."""
    present = [str(name) for name in rows["environment"].unique()]
    if len(present) <= most:
        return present
    classes: dict[str, str] = {}
    named = []
    for name in present:
        if without_resolution(name) in SUITES["paper-named-12"]:
            named.append(name)
        else:
            classes.setdefault(named_class(name) or "", name)
    return list(dict.fromkeys([*named, *classes.values(), *hardest_maps(rows)]))


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
        pictures = list(_pictures(part(run), most, lines, names or {}))
        if pictures:
            yield Text(
                "At seed 0 and the reference's exposure; below each image the windows of largest "
                "mean error over all methods, and its FLIP map."
            )
        else:
            yield Text("No images are kept with these rows, so there are no comparison figures.")
        yield from pictures

    return section


def _pictures(run: Run, most: int, lines: Lines, names: Mapping[str, str]) -> Iterator[Picture]:
    """Of each case that has images, or whose figure was drawn when it had."""
    scenes = sorted(run.rows["scene"].unique())
    for environment, scene, budget in product(shown_maps(run.rows, most), scenes, run.budgets):
        stem = Path(scene).stem
        file = f"figures/{stem}_{environment}_{budget}.jpg"
        title = f"{stem} under {environment}, {budget}"
        rows = kept_rows(run, scene, environment, budget)
        if rows:
            yield Picture(file, title, partial(_draw, run, rows, title, lines, names))
        elif (run.folder / file).is_file():
            yield Picture(file, title)


def write_montages(run: Run) -> None:
    """A sheet per case and budget whose images are kept, at the reference's exposure."""
    for rows in _kept_cases(run):
        case = read_case(run, rows)
        if case is not None:
            first = rows[0]
            name = f"{first['scene']}_{first['environment']}_{first['budget']}.png"
            write_png(run.folder / "montages" / name, _montage(case))


def _montage(case: CaseImages) -> NDArray[np.uint8]:
    errors = ranked_metrics()
    labels = ["reference · " + " / ".join(metric.label for metric in errors)]
    labels += [
        f"{row['sampler']} " + " / ".join(f"{row[metric.name]:.3f}" for metric in errors)
        for row in case.rows
    ]
    pictures = (enlarged(encoded(image)) for image in (case.truth, *case.images))
    columns = min(MONTAGE_COLUMNS, len(labels))
    return contact_sheet(list(zip(labels, pictures, strict=True)), columns)
