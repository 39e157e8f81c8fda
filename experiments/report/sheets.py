"""Sheets of labelled pictures, from what is there: tiles of a study, or the images of a grid.

A tile is a function that gives the picture, sRGB bytes (H, W, 3); None where its file is gone.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.report.parts import Picture
from renderer.image import write_png, write_webp
from samplers import EnvlightError
from samplers.files.image_file import read_radiance
from samplers.preview import contact_sheet, encoded, enlarged

Bytes = NDArray[np.uint8]
Tile = Callable[[], Bytes]
Labelled = Sequence[tuple[str, Tile | None]]


def sheet(file: str, caption: str, tiles: Labelled, columns: int) -> Picture:
    """The tiles that are there, `columns` in a row; without any, the sheet that is there already.

    file : its place below the run's folder, a WebP
    """
    there = [(label, tile) for label, tile in tiles if tile is not None]

    def draw(path: Path) -> None:
        pictures = [(label, tile()) for label, tile in there]
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


def image_tile(path: Path | None, exposure: float) -> Tile | None:
    """An image of a grid, or a reference."""
    if path is None:
        return None
    return lambda: enlarged(encoded(read_radiance(path) * exposure))


def difference_tile(
    path: Path | None, reference: Path | None, exposure: float, times: float
) -> Tile | None:
    """How far an image is from its reference, `times` as large."""
    if path is None or reference is None:
        return None
    return lambda: enlarged(
        encoded(times * exposure * np.abs(read_radiance(path) - read_radiance(reference)))
    )


def _read(file: Path) -> Bytes:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(file) as picture:
            return np.array(picture.convert("RGB"))
    except (OSError, UnidentifiedImageError) as error:
        raise EnvlightError(f"{file}: not a readable picture ({error}); delete the file") from error
