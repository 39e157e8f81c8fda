"""Where a store keeps references and images, how they are read again, and their names in runs.

References and images are OpenEXR in float32, so that what is read is what was rendered: a score
made later from a kept image equals the one that was made at once, to the last digit. Rows tell a
hash of the pixels: what was damaged since is not judged, but rendered again.

In a store files are called by their keys. A run folder has them, too, images by names that a reader
knows: as hard links, or as copies where the file system has none.
"""

import hashlib
import os
import re
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.run.case import Case
from experiments.run.measurement import Measurement
from experiments.run.store import PIXELS
from renderer.image import write_exr, write_whole
from samplers import EnvlightError
from samplers.files.image_file import read_radiance

Image = NDArray[np.float32]
FIRST_HALF = "first_half"
"""What a reference's row calls the hash of its first half's pixels."""
MOST_LETTERS = 80
"""Of a label in a file's name."""


def reference_path(folder: Path, case: Case) -> Path:
    """Where a case's reference image lies."""
    return folder / "references" / f"{case.reference_key}.exr"


def half_path(folder: Path, case: Case) -> Path:
    """Where the first of the two halves lies whose mean the reference is."""
    return folder / "references" / f"{case.reference_key}_half.exr"


def keep_reference(folder: Path, case: Case, image: Image, first_half: Image) -> None:
    """Write a case's reference, and its first half before it."""
    write_exr(half_path(folder, case), first_half)
    write_exr(reference_path(folder, case), image)


def has_reference(folder: Path, case: Case, row: dict[str, Any]) -> bool:
    """Whether the case's reference is there with the pixels that its row tells."""
    return (
        undamaged(reference_path(folder, case), row[PIXELS]) is not None
        and undamaged(half_path(folder, case), row[FIRST_HALF]) is not None
    )


def undamaged(path: Path, pixels: str) -> Image | None:
    """An image, None where it cannot be read or has not the pixels of this hash."""
    try:
        image = read_radiance(path)
    except EnvlightError:
        return None
    return image if pixel_digest(image) == pixels else None


def pixel_digest(image: Image) -> str:
    """A hash of an image's pixels."""
    return hashlib.blake2b(np.ascontiguousarray(image).data, digest_size=12).hexdigest()


def stored_image(folder: Path, key: str) -> Path:
    """Where a store keeps the image of a key."""
    return folder / "images" / key[:2] / f"{key}.exr"


def image_path(run: Path, measurement: Measurement) -> Path:
    """Where a run has a measurement's image; the key tells files of like names apart."""
    case, key = measurement.case, measurement.key[:8]
    label, budget, seed = measurement.sampler.label, measurement.budget, measurement.seed
    place = run / "images" / case.scene / case.environment.name
    return place / f"{in_file_name(label)}_{in_file_name(str(budget))}_seed={seed}_{key}.exr"


def in_file_name(label: str) -> str:
    """A label without what would lead to another folder or make no name."""
    return re.sub(r"[^\w\[\]=,.+ -]", "_", label)[:MOST_LETTERS]


def budget_in_file_name(budget: str) -> str:
    """A budget as a part of a figure's name: "lights16", "timeours_8"."""
    return in_file_name(budget.replace("=", ""))


def link_case(folder: Path, run: Path, case: Case) -> None:
    """Have a case's reference in a run folder, the whole image last."""
    for path in (half_path, reference_path):
        _link_file(path(folder, case), path(run, case))


def link_image(folder: Path, run: Path, measurement: Measurement) -> None:
    """Have a measurement's image in a run folder, where the store keeps it."""
    _link_file(stored_image(folder, measurement.key), image_path(run, measurement))


def _link_file(source: Path, target: Path) -> None:
    """Have a file of the store in a run; what was rendered again takes the place of what it was."""
    if not source.is_file() or (target.exists() and target.samefile(source)):
        return
    # A file system's clock may tick too slowly to tell an image from the one rendered just before.
    if not target.exists() or target.stat().st_mtime_ns <= source.stat().st_mtime_ns:
        write_whole(target, partial(_link, source))


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
