"""Pictures for the comparison view: an image that keeps its exposure range, and its error maps.

A preview stores log(1 + 16 x) of exposed radiance x in eight bits, four stops beyond white, which
the page turns into sRGB at any exposure. It has the image's own pixels: without loss where they are
640 × 480 or fewer, else compressed with colour at full resolution by a transform whose blocks are
filtered away. Numbers come from the float images. Error maps have 32 levels and no loss. Pictures
are named after what determines them, so those that are there already are not made again.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.run_data import RunData
from experiments.run.identity import digest
from metrics.registry import Metric, metrics
from metrics.truth import Truth
from renderer.image import write_whole
from samplers.files.image_file import read_radiance

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
OWN = re.compile(r"[0-9a-f]{16}\.(webp|avif|png)")
"""How pictures are called after what determines them; others in their folder are somebody's."""
VERSION = 3


@dataclass(frozen=True)
class Pictures:
    """Files of an image, relative to the report's folder.

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


def reduced(image: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Box-filtered to at most `width` columns; any number of trailing channels."""
    from PIL import Image

    if image.shape[1] <= width:
        return image
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    planes = np.moveaxis(image.reshape(*image.shape[:2], -1), -1, 0)
    small = [
        np.asarray(Image.fromarray(np.ascontiguousarray(plane)).resize(size, Image.Resampling.BOX))
        for plane in planes
    ]
    return np.stack(small, axis=-1).reshape(size[1], size[0], *image.shape[2:])


def write_pictures(data: RunData, folder: Path, width: int) -> dict[str, Pictures]:
    """Pictures of all measurements of the first seed that have an image, by key.

    The reference's stand under "reference:" and the same name as its file.

    width : wider images are reduced to so many columns
    """
    made: dict[str, Pictures] = {}
    first = data.rows.groupby(["scene", "environment", "sampler", "budget"])["seed"].transform(
        "min"
    )
    for _, case in data.rows[data.rows["seed"] == first].groupby(["scene", "environment"]):
        made |= _case_pictures(data, case, folder, width)
    kept = {name for found in made.values() for name in _files(found)}
    for file in (*folder.glob("pictures/*"), *folder.glob("errors/*")):
        if OWN.fullmatch(file.name) and f"{file.parent.name}/{file.name}" not in kept:
            file.unlink()
    return made


def _files(pictures: Pictures) -> Iterable[str]:
    return (pictures.preview, pictures.thumbnail, *pictures.errors.values())


def _case_pictures(
    data: RunData, case: pd.DataFrame, folder: Path, width: int
) -> dict[str, Pictures]:
    reference = data.reference(case["key"].iloc[0])
    exposure = float(case["exposure"].iloc[0])
    made: dict[str, Pictures] = {}

    @cache
    def truth() -> Truth:
        assert reference is not None
        return Truth(_exposed(reference, exposure), exposure, float("nan"))

    if reference is not None:
        made[f"reference:{reference.stem}"] = Pictures(
            _preview(folder, reference.stem, width, lambda: truth().image),
            _relative(data, reference),
            _preview(folder, reference.stem, THUMBNAIL, lambda: truth().image),
        )
    scene, environment = str(case["scene"].iloc[0]), str(case["environment"].iloc[0])
    for key in case["key"]:
        path = data.image(key, scene, environment)
        if path is None:
            continue
        image = cache(lambda path=path: _exposed(path, exposure))
        errors = {
            metric.name: _error_map(folder, key, metric, width, image, truth)
            for metric in (mapped_metrics() if reference is not None else ())
        }
        preview = _preview(folder, key, width, image)
        made[key] = Pictures(preview, _relative(data, path), errors=errors)
    return made


def _relative(data: RunData, path: Path) -> str:
    return "../" + path.relative_to(data.folder).as_posix()


def _exposed(path: Path, exposure: float) -> NDArray[np.float32]:
    return (read_radiance(path) * np.float64(exposure)).astype(np.float32)


def _preview(folder: Path, key: str, width: int, image: Callable[[], NDArray[np.float32]]) -> str:
    """The preview's file, made where it is missing."""
    stem = digest([key, width, VERSION])[:16]
    for suffix in (".webp", ".avif"):
        if (folder / f"pictures/{stem}{suffix}").is_file():
            return f"pictures/{stem}{suffix}"
    code = coded(reduced(image(), width))
    lossless = code.shape[0] * code.shape[1] <= LOSSLESS_PIXELS
    name = f"pictures/{stem}{'.webp' if lossless else '.avif'}"
    _save(folder / name, code, LOSSLESS if lossless else COMPRESSED)
    return name


def _save(path: Path, code: NDArray[np.uint8], options: dict[str, Any]) -> None:
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(code))
    write_whole(path, lambda target: picture.save(target, **options))


def _error_map(
    folder: Path,
    key: str,
    metric: Metric,
    width: int,
    image: Callable[[], NDArray[np.float32]],
    truth: Callable[[], Truth],
) -> str:
    """The error map's file, made where it is missing."""
    from PIL import Image

    name = f"errors/{digest([key, metric.name, width, VERSION])[:16]}.png"
    if not (folder / name).is_file():
        error = reduced(metric.map_of(image(), truth()), width)
        levels = np.round(np.clip(error, 0.0, 1.0) * (LEVELS - 1)).astype(np.uint8)
        picture = Image.fromarray(levels)
        picture.putpalette(_palette().tobytes())
        write_whole(folder / name, lambda target: picture.save(target, "PNG", optimize=True))
    return name
