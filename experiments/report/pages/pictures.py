"""Pictures for the comparison view: an image that keeps its exposure range, and its error maps.

A preview stores log(1 + 16 x) of exposed radiance x in eight bits, four stops beyond white, which
the page turns into sRGB at any exposure. It has the image's own pixels: without loss where they are
640 × 480 or fewer, else compressed with colour at full resolution by a transform whose blocks are
filtered away. Numbers come from the float images. Error maps have 32 levels and no loss. Pictures
are named after what determines them, so those that are there already are not made again.
"""

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.run.identity import digest
from experiments.run.loaded_run import Run
from metrics.registry import Metric, metrics
from metrics.truth import Truth
from renderer.image import write_whole
from samplers import EnvlightError
from samplers.files.image_file import read_radiance
from samplers.preview import reduced

STEEPNESS = 16.0
WHITEST = 16.0
"""Exposed radiance of code 255; 1 is white at exposure 0."""
LOSSLESS_PIXELS = 640 * 480
"""Images of up to so many pixels are stored without loss."""
LOSSLESS: dict[str, Any] = {"format": "WEBP", "lossless": True, "method": 0, "quality": 30}
COMPRESSED: dict[str, Any] = {"format": "AVIF", "quality": 90, "subsampling": "4:4:4", "speed": 8}
THUMBNAIL = 160
"""Columns of the small pictures on the first page."""
LEVELS = 32
REFERENCE = "reference"
PREVIEWS, ERRORS = "pictures", "errors"
VERSION = 3


@dataclass(frozen=True)
class Pictures:
    """Files of an image, relative to its run's folder among the pages.

    preview, thumbnail : pictures, the latter of references alone; exr : the stored image
    errors : error maps by the metric's name
    """

    preview: str
    exr: str
    thumbnail: str = ""
    errors: dict[str, str] = field(default_factory=dict)


def mapped_metrics() -> tuple[Metric, ...]:
    """The metrics that have an error map."""
    return tuple(metric for metric in metrics() if metric.error_map is not None)


def error_colors() -> list[str]:
    """The colours of error maps from 0 to 1, as CSS writes them: "magma", as FLIP's authors use."""
    return ["#" + bytes(color).hex() for color in _palette()]


def _palette() -> NDArray[np.uint8]:
    import matplotlib as mpl

    table: NDArray[np.uint8] = mpl.colormaps["magma"](np.linspace(0.0, 1.0, LEVELS), bytes=True)
    return table[:, :3]


def coded(exposed: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Eight-bit codes of exposed radiance."""
    clipped = np.clip(exposed, 0.0, WHITEST)
    code = np.log1p(STEEPNESS * clipped) / np.log1p(STEEPNESS * WHITEST)
    return np.round(255.0 * code).astype(np.uint8)


def decoding_table(nodes: int = 64) -> list[float]:
    """sRGB values in [0, 1] at exposure 0 of equally spaced codes, as an SVG filter wants them."""
    code = np.linspace(0.0, 1.0, nodes)
    linear = np.clip(np.expm1(code * np.log1p(STEEPNESS * WHITEST)) / STEEPNESS, 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return [round(float(value), 4) for value in curve]


def case_pictures(
    run: Run, folder: Path, old: Path, width: int, linked: bool = True
) -> tuple[dict[str, Pictures], list[str]]:
    """Pictures of a case's first seeds by key, of its reference under "reference"; and what is
    wrong with an image that cannot be read, which has none.

    Pictures that are in the folder `old` are taken from there; without its image one is shown where
    it is there.

    run : with the rows of the case alone
    width : wider images are reduced to so many columns
    linked : whether pages link to the images, which are there as long as the run's folder is
    """
    shelf, wrong = Shelf(folder, old), []
    made: dict[str, Pictures] = {}
    first = run.rows[
        run.rows["seed"] == run.rows.groupby(["sampler", "budget"])["seed"].transform("min")
    ]
    truth = _Image(run.kept_reference(first.iloc[0]), first["exposure"].iloc[0])
    images = {
        str(row["key"]): _Image(run.kept_image(row), row["exposure"]) for _, row in first.iterrows()
    }
    for key, image in {str(first["reference"].iloc[0]): truth, **images}.items():
        try:
            preview = _preview(shelf, key, width, image)
            errors = {} if image is truth else {
                metric.name: file
                for metric in mapped_metrics()
                if preview and (file := _error_map(shelf, key, metric, width, image, truth))
            }  # fmt: skip
            small = _preview(shelf, key, THUMBNAIL, image) if image is truth else ""
        except EnvlightError as error:
            if str(error) not in wrong:
                wrong.append(str(error))
            if image is truth:
                truth.path = None
            continue
        if preview:
            at = image.path.relative_to(run.folder).as_posix() if linked and image.path else ""
            exr = f"../../../{at}" if at else ""
            made[REFERENCE if image is truth else key] = Pictures(preview, exr, small, errors)
    return made, wrong


class _Image:
    """An exposed image that is read once, where it is asked for; of a reference also its truth."""

    def __init__(self, path: Path | None, exposure: float) -> None:
        self.path, self._exposure = path, exposure

    @cached_property
    def exposed(self) -> NDArray[np.float32]:
        assert self.path is not None
        return (read_radiance(self.path) * np.float64(self._exposure)).astype(np.float32)

    @cached_property
    def truth(self) -> Truth:
        return Truth(self.exposed, self._exposure, float("nan"))


class Shelf:
    """Files named after what determines them; what an older folder has is not made again."""

    def __init__(self, folder: Path, old: Path) -> None:
        self._folder, self._old = folder, old

    def has(self, name: str) -> bool:
        """Whether a file is there, now or from before."""
        target, before = self._folder / name, self._old / name
        if not target.is_file() and before.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(before, target)
            except OSError:
                shutil.copyfile(before, target)
        return target.is_file()

    def put(self, name: str, write: Callable[[Path], object]) -> str:
        """Write a file where it is missing; returns its name."""
        if not self.has(name):
            write_whole(self._folder / name, write)
        return name


def _preview(shelf: Shelf, key: str, width: int, image: _Image) -> str:
    """The preview's file, made where it is missing; empty where it cannot be."""
    stem = f"{PREVIEWS}/{digest([key, width, VERSION])[:16]}"
    for suffix in (".webp", ".avif"):
        if shelf.has(f"{stem}{suffix}"):
            return f"{stem}{suffix}"
    if image.path is None:
        return ""
    code = coded(reduced(image.exposed, width))
    lossless = code.shape[0] * code.shape[1] <= LOSSLESS_PIXELS
    name = f"{stem}{'.webp' if lossless else '.avif'}"
    return shelf.put(name, partial(save, code, LOSSLESS if lossless else COMPRESSED))


def save(code: NDArray[np.uint8], options: dict[str, Any], path: Path) -> None:
    """Write bytes as a picture."""
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(code)).save(path, **options)


def _error_map(
    shelf: Shelf, key: str, metric: Metric, width: int, image: _Image, reference: _Image
) -> str:
    """The error map's file, made where it is missing; empty where it cannot be."""

    def write(path: Path) -> None:
        from PIL import Image

        error = reduced(metric.map_of(image.exposed, reference.truth), width)
        levels = np.round(np.clip(error, 0.0, 1.0) * (LEVELS - 1)).astype(np.uint8)
        picture = Image.fromarray(levels)
        picture.putpalette(_palette().tobytes())
        picture.save(path, "PNG", optimize=True)

    name = f"{ERRORS}/{digest([key, metric.name, width, VERSION])[:16]}.png"
    if not shelf.has(name) and (image.path is None or reference.path is None):
        return ""
    return shelf.put(name, write)
