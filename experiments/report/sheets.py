"""Sheets of labelled pictures, from what is there: tiles of a study, or the images of a grid.

A tile is a function that gives the picture, sRGB bytes (H, W, 3), or None where its file cannot be
read; None stands for one whose file is gone.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.report.parts import Picture
from experiments.run.loaded_run import Run
from renderer.image import write_png, write_webp
from samplers import EnvlightError
from samplers.preview import contact_sheet, encoded, enlarged

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
