"""The kept images of a run's cases as pictures: comparison figures, montages and sheets.

A comparison figure has a column for the reference and for each method: from top to bottom its name
and numbers, its image with the insets' frames, the insets enlarged, and its FLIP map. Small images
are enlarged by whole factors without smoothing, large ones box-filtered. Insets are the windows
with the largest mean error over all methods, so that none is favoured. A montage is a sheet of the
reference and every sampler's image with its errors. Other sheets are of tiles of a study, or of
images of a grid: a tile is a function that gives the picture, sRGB bytes (H, W, 3), or None where
its file cannot be read; None stands for one whose file is gone.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.classes import named_class, without_resolution
from experiments.maps.poly_haven import SUITES
from experiments.report.parts import Heading, Part, Picture, Text
from experiments.report.style import label_of
from experiments.run.experiment import Section
from experiments.run.kept_images import in_file_name
from experiments.run.loaded_run import Run, found_or_kept
from metrics.flip import FlipReference
from metrics.registry import leading_metric, ranked_metrics
from renderer.image import write_png, write_webp
from samplers import EnvlightError
from samplers.preview import contact_sheet, encoded, enlarged, reduced

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
    run: Run, rows: list[pd.Series], lines: Lines, names: Mapping[str, str], path: Path
) -> None:
    """Write a case's comparison figure, unless its images cannot be read."""
    case = read_case(run, rows)
    if case is None:
        return
    errors = case.error_maps()
    columns = [Column("reference", case.truth, None, (_floors(rows[0]), "below: FLIP from 0 to 1"))]
    told = zip(case.rows, case.images, errors, lines(run, case), strict=True)
    for row, image, error, line in told:
        label = str(row["sampler"])
        numbers = "  ".join(f"{m.label} {row[m.name]:.{m.digits}f}" for m in ranked_metrics())
        columns.append(Column(names.get(label, label_of(label)), image, error, (numbers, line)))
    windows = worst_windows(np.mean(errors, axis=0))
    write_webp(path, comparison_figure(columns, windows, COLUMNS))


def _floors(row: pd.Series) -> str:
    floors = [(m, row[m.floor_column]) for m in ranked_metrics() if m.floor_column in row]
    return "noise: " + "  ".join(f"{metric.label} {floor:.4f}" for metric, floor in floors)


def costs(run: Run, case: CaseImages) -> list[str]:
    """What each image took: lights, rays per sub-pixel, milliseconds to render."""
    return [
        f"{row['lights']} lights, {row['rays']:.1f} rays, {1e3 * row['seconds_render']:.0f} ms"
        for row in case.rows
    ]


def hardest_maps(rows: pd.DataFrame) -> list[str]:
    """The two maps on which even the least leading error, averaged over scenes, is largest."""
    means = (
        rows.groupby(["environment", "sampler"])[leading_metric().name].mean().unstack("sampler")
    )
    least = means.min(axis=1).sort_values(ascending=False, kind="stable")
    return [str(name) for name in least.index[:2]]


def shown_maps(rows: pd.DataFrame, most: int = 8) -> list[str]:
    """The maps that figures are drawn for: all where there are few; else those that Wu 2025 names,
    one of each class of the others in the rows' order, and the two hardest.
    """
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
        file = f"figures/{stem}_{environment}_{in_file_name(budget)}.webp"
        title = f"{stem} under {environment}, {budget}"
        rows = kept_rows(run, scene, environment, budget)
        if rows:
            yield Picture(file, title, partial(_draw, run, rows, lines, names))
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
        f"{label_of(row['sampler'])} " + " / ".join(f"{row[metric.name]:.3f}" for metric in errors)
        for row in case.rows
    ]
    pictures = (enlarged(encoded(image)) for image in (case.truth, *case.images))
    columns = min(MONTAGE_COLUMNS, len(labels))
    return contact_sheet(list(zip(labels, pictures, strict=True)), columns)


PANEL = 320
"""Columns of a picture at most."""
INSET_SHARE = 0.2
"""Side of an inset in units of the image's."""
FRAMES = ((255, 80, 60), (60, 200, 255))


@dataclass(frozen=True, eq=False)
class Column:
    """One column.

    image : (H, W, 3) exposed linear radiance; error_map : (H, W) in [0, 1], None for the reference
    lines : below the image, such as its numbers
    """

    label: str
    image: NDArray[np.float32]
    error_map: NDArray[np.float32] | None
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Window:
    """A part of an image, in pixels."""

    top: int
    left: int
    height: int
    width: int

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)


def worst_windows(error: NDArray[np.float32]) -> list[Window]:
    """The windows of largest mean error (H, W), largest first, that do not overlap."""
    height, width = (max(1, round(INSET_SHARE * side)) for side in error.shape)
    table = np.zeros((error.shape[0] + 1, error.shape[1] + 1))
    table[1:, 1:] = error.cumsum(axis=0, dtype=np.float64).cumsum(axis=1)
    total = (
        table[height:, width:] - table[:-height, width:] - table[height:, :-width]
        + table[:-height, :-width]
    )  # fmt: skip
    found: list[Window] = []
    for _ in FRAMES:
        best = int(total.argmax())
        top, left = divmod(best, total.shape[1])
        if not np.isfinite(total[top, left]):
            break
        found.append(Window(top, left, height, width))
        total[
            max(0, top - height + 1) : top + height, max(0, left - width + 1) : left + width
        ] = -math.inf
    return found


def comparison_figure(
    pictures: list[Column], windows: list[Window], columns: int
) -> NDArray[np.uint8]:
    """The columns side by side, in rows of at most `columns`; (H, W, 3)."""
    tiles = [("\n".join([one.label, *one.lines]), _tile(one, windows)) for one in pictures]
    return contact_sheet(tiles, min(columns, len(tiles)))


def _tile(column: Column, windows: list[Window]) -> NDArray[np.uint8]:
    """Image, insets and error map of a column, one below the other."""
    from PIL import Image

    picture = enlarged(encoded(reduced(column.image, PANEL)))
    height, width = picture.shape[:2]
    scale = width / column.image.shape[1]
    size = (width // len(FRAMES), round(height / len(FRAMES)))
    insets = np.zeros((size[1], width, 3), np.uint8)
    for k, (frame, window) in enumerate(zip(FRAMES, windows, strict=False)):
        part = Image.fromarray(encoded(column.image[window.slices]))
        smooth = Image.Resampling.BOX if part.width > size[0] else Image.Resampling.NEAREST
        inset = _framed(np.array(part.resize(size, smooth)), Window(0, 0, *size[::-1]), frame)
        insets[:, k * size[0] : (k + 1) * size[0]] = inset
        sides = (window.top, window.left, window.height, window.width)
        picture = _framed(picture, Window(*(round(scale * side) for side in sides)), frame)
    if column.error_map is None:  # which colour is which error, from 0 to 1
        errors = flip_colors(np.tile(np.linspace(0.0, 1.0, width, dtype=np.float32), (height, 1)))
    else:
        errors = enlarged(flip_colors(reduced(column.error_map, PANEL)))
    return np.vstack([picture, insets, errors])


def _framed(
    picture: NDArray[np.uint8], window: Window, colour: tuple[int, int, int]
) -> NDArray[np.uint8]:
    """The picture with a line of one pixel inside the edges of a window."""
    inside, (rows, columns) = np.zeros(picture.shape[:2], np.bool_), window.slices
    inside[rows, columns] = True
    inside[rows.start + 1 : rows.stop - 1, columns.start + 1 : columns.stop - 1] = False
    return np.where(inside[..., None], np.array(colour, np.uint8), picture)


def flip_colors(error: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Errors in [0, 1] in the "magma" colours that FLIP's authors use, (H, W, 3)."""
    import matplotlib as mpl

    table = mpl.colormaps["magma"](np.arange(256), bytes=True)[:, :3]
    colors: NDArray[np.uint8] = table[np.round(np.clip(error, 0.0, 1.0) * 255.0).astype(np.intp)]
    return colors


Bytes = NDArray[np.uint8]
Tile = Callable[[], Bytes | None]
Labelled = Sequence[tuple[str, Tile | None]]


def sheet(file: str, caption: str, tiles: Labelled, columns: int) -> Picture:
    """The tiles that are there, `columns` in a row; without any, the sheet that is there already.

    file : its place below the run's folder, a WebP
    """
    there = [(label, tile) for label, tile in tiles if tile is not None]

    def draw(path: Path) -> None:
        made = ((label, tile()) for label, tile in there)
        pictures = [(label, picture) for label, picture in made if picture is not None]
        if pictures:
            write_webp(path, contact_sheet(pictures, min(columns, len(pictures))))

    return Picture(file, caption, draw if there else None)


def tile_path(folder: Path, *names: object) -> Path:
    """Where a study keeps a tile; these are not published."""
    return folder / "pictures" / ("_".join(map(str, names)) + ".png")


def keep_tile(path: Path, picture: NDArray) -> None:
    """Keep a picture for a sheet: sRGB bytes, or an exposed linear image."""
    write_png(path, enlarged(picture if picture.dtype == np.uint8 else encoded(picture)))


def kept_tile(path: Path) -> Tile | None:
    """A tile that was kept."""
    return partial(_read, path) if path.is_file() else None


def image_tile(
    run: Run, path: Path | None, exposure: float, reference: Path | None = None
) -> Tile | None:
    """A kept image of a grid, or how far it is from its reference."""

    def tile() -> Bytes | None:
        image, truth = run.read(path), run.read(reference)
        if image is None or (reference and truth is None):
            return None
        return enlarged(encoded(exposure * (image if truth is None else np.abs(image - truth))))

    return None if path is None else tile


def _read(file: Path) -> Bytes:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(file) as picture:
            return np.array(picture.convert("RGB"))
    except (OSError, UnidentifiedImageError) as error:
        raise EnvlightError(f"{file}: not a readable picture ({error}); delete the file") from error
