"""Where a run folder keeps references and images, and how they are read again.

References and images are OpenEXR in float32, so that what is read is what was rendered: a score
made later from a kept image equals the one that was made at once, to the last digit.
"""

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.run.case import Case
from experiments.run.measurement import Measurement
from renderer.image import write_exr
from samplers import EnvlightError
from samplers.files.image_file import read_radiance

Image = NDArray[np.float32]


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


def has_reference(folder: Path, case: Case, pixels: str) -> bool:
    """Whether the case's reference is there, undamaged, with pixels of this digest."""
    try:
        image = read_radiance(reference_path(folder, case))
        read_radiance(half_path(folder, case))
    except EnvlightError:
        return False
    return pixel_digest(image) == pixels


def pixel_digest(image: Image) -> str:
    """A hash of an image's pixels."""
    return hashlib.blake2b(np.ascontiguousarray(image).data, digest_size=12).hexdigest()


def image_path(folder: Path, measurement: Measurement) -> Path:
    """Where a measurement's image lies."""
    case, key = measurement.case, measurement.key[:8]
    label, budget, seed = measurement.sampler.label, measurement.budget, measurement.seed
    place = folder / "images" / case.scene / case.environment.name
    return place / f"{label}_{budget}_seed={seed}_{key}.exr"


def keep_image(path: Path, image: Image) -> None:
    """Write a measurement's image."""
    write_exr(path, image)
