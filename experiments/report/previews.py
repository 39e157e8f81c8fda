"""Pictures for the comparison view: an image that keeps its exposure range, and its FLIP map.

A preview stores log(1 + 16 x) of exposed radiance x in eight bits, four stops beyond white, which
the page turns into sRGB at any exposure. It is a compressed picture to look at, with colour at
full resolution; numbers come from the float images. Pictures are named after what determines
them, so those that are there already are not made again.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.run_data import RunData
from experiments.run.identity import digest
from metrics.flip import FlipReference
from renderer.image import FULL_COLOUR, write_jpeg, write_whole
from samplers.files.image_file import read_radiance

STEEPNESS = 16.0
WHITEST = 16.0
"""Exposed radiance of code 255; 1 is white at exposure 0."""
QUALITY = 88
FLIP_LEVELS = 32
VERSION = 2


@dataclass(frozen=True)
class Pictures:
    """Files of one measurement, relative to the report's folder; empty where there is no image.

    preview, flip : pictures; exr : the stored image
    """

    preview: str
    flip: str
    exr: str


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
    """Previews and FLIP maps of all measurements of the first seed that have an image, by key.

    The reference's preview stands under "reference:" and the same name as its file.
    """
    made: dict[str, Pictures] = {}
    first = data.rows.groupby(["scene", "environment", "sampler", "budget"])["seed"].transform(
        "min"
    )
    for _, case in data.rows[data.rows["seed"] == first].groupby(["scene", "environment"]):
        made |= _case_pictures(data, case, folder, width)
    kept = {name for found in made.values() for name in (found.preview, found.flip)}
    for file in (*folder.glob("previews/*"), *folder.glob("flip/*")):
        if f"{file.parent.name}/{file.name}" not in kept:
            file.unlink()
    return made


def _case_pictures(
    data: RunData, case: pd.DataFrame, folder: Path, width: int
) -> dict[str, Pictures]:
    reference = data.reference(case["key"].iloc[0])
    exposure = float(case["exposure"].iloc[0])
    truth: NDArray[np.float32] | None = None
    flip: FlipReference | None = None
    made: dict[str, Pictures] = {}
    if reference is not None:
        name = _name(reference.stem, width)
        if not (folder / f"previews/{name}.jpg").is_file():
            truth = _exposed(reference, exposure)
            _write_preview(folder / f"previews/{name}.jpg", truth, width)
        made[f"reference:{reference.stem}"] = Pictures(
            f"previews/{name}.jpg", "", _relative(data, reference)
        )
    scene, environment = str(case["scene"].iloc[0]), str(case["environment"].iloc[0])
    for key, exposures in zip(case["key"], case["flip_exposures"], strict=True):
        path = data.image(key, scene, environment)
        if path is None:
            continue
        name = _name(key, width)
        preview, error = f"previews/{name}.jpg", f"flip/{name}.png" if reference else ""
        made[key] = Pictures(preview, error, _relative(data, path))
        if (folder / preview).is_file() and (not error or (folder / error).is_file()):
            continue
        image = _exposed(path, exposure)
        _write_preview(folder / preview, image, width)
        if reference is not None:
            truth = _exposed(reference, exposure) if truth is None else truth
            start, stop, count = exposures
            flip = FlipReference.hdr(truth, start, stop, count) if flip is None else flip
            _write_flip(folder / error, flip.compare(image).error_map, width)
    return made


def _name(key: str, width: int) -> str:
    return digest([key, width, VERSION])[:16]


def _relative(data: RunData, path: Path) -> str:
    return "../" + path.relative_to(data.folder).as_posix()


def _exposed(path: Path, exposure: float) -> NDArray[np.float32]:
    return (read_radiance(path) * np.float64(exposure)).astype(np.float32)


def _write_preview(path: Path, image: NDArray[np.float32], width: int) -> None:
    write_jpeg(path, coded(reduced(image, width)), QUALITY, FULL_COLOUR)


def _write_flip(path: Path, error: NDArray[np.float32], width: int) -> None:
    """The error map in the "magma" colours that FLIP's authors use."""
    import matplotlib as mpl
    from PIL import Image

    levels = np.round(np.clip(reduced(error, width), 0.0, 1.0) * (FLIP_LEVELS - 1))
    table = mpl.colormaps["magma"](np.linspace(0.0, 1.0, FLIP_LEVELS), bytes=True)[:, :3]
    picture = Image.fromarray(levels.astype(np.uint8))
    picture.putpalette(table.tobytes())
    write_whole(path, lambda target: picture.save(target, "PNG", optimize=True))
