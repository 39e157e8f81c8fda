"""Where a run folder keeps references and images, and how they are read again.

References and images are OpenEXR in float32, so that what is read is what was rendered: a score
made later from a kept image equals the one that was made at once, to the last digit. Rows tell a
hash of the pixels: what was damaged since is not judged, but rendered again.
"""

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.run.case import Case
from experiments.run.measurement import Measurement
from experiments.run.store import PIXELS
from renderer.image import write_exr
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
        _undamaged(reference_path(folder, case), row[PIXELS]) is not None
        and _undamaged(half_path(folder, case), row[FIRST_HALF]) is not None
    )


def _undamaged(path: Path, pixels: str) -> Image | None:
    """An image, None where it cannot be read or has not the pixels of this hash."""
    try:
        image = read_radiance(path)
    except EnvlightError:
        return None
    return image if pixel_digest(image) == pixels else None


def pixel_digest(image: Image) -> str:
    """A hash of an image's pixels."""
    return hashlib.blake2b(np.ascontiguousarray(image).data, digest_size=12).hexdigest()


def image_path(folder: Path, measurement: Measurement) -> Path:
    """Where a measurement's image lies. The key tells names apart that are alike in a file's."""
    case, key = measurement.case, measurement.key[:8]
    label, budget, seed = measurement.sampler.label, measurement.budget, measurement.seed
    place = folder / "images" / case.scene / case.environment.name
    return place / f"{in_file_name(label)}_{budget}_seed={seed}_{key}.exr"


def in_file_name(label: str) -> str:
    """A label without what would lead to another folder or make no name."""
    return re.sub(r"[^\w\[\]=,.+ -]", "_", label)[:MOST_LETTERS]


def kept_image(folder: Path, measurement: Measurement, pixels: str) -> Image | None:
    """A measurement's image, None where it is not there with pixels of this hash."""
    return _undamaged(image_path(folder, measurement), pixels)


def keep_image(path: Path, image: Image) -> None:
    """Write a measurement's image."""
    write_exr(path, image)
