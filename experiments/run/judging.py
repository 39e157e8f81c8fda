"""Judging an image against its case's reference, by any metrics."""

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.run.case import Case
from experiments.run.kept_images import half_path, reference_path
from experiments.run.rendering import case_view, make_reference
from metrics.errors import exposure_scale, rmse
from metrics.registry import find_metric
from metrics.truth import Truth
from samplers.files.image_file import read_radiance

Row = dict[str, Any]


@lru_cache(maxsize=2)
def truth_of(case: Case, folder: str, noise_floor: float) -> Truth:
    """A case's reference, exposed.

    folder : of the run that keeps the reference; noise_floor : of the reference before exposure"""
    image = read_radiance(reference_path(Path(folder), case))
    first = read_radiance(half_path(Path(folder), case))
    exposure = exposure_scale(image, case_view(case).coverage > 0.0)

    def exposed(radiance: NDArray[np.float64] | NDArray[np.float32]) -> NDArray[np.float32]:
        return (radiance * np.float64(exposure)).astype(np.float32)

    # Where rounding of the mean to float32 would give the second half a negative value, it is 0.
    second = np.maximum(2.0 * image.astype(np.float64) - first, 0.0)
    halves = exposed(first), exposed(second)
    return Truth(exposed(image), exposure, noise_floor * exposure, halves)


def truth_in(folder: Path, case: Case) -> Truth:
    """A case's reference, exposed; it is rendered into the run's folder unless it is there.

    For experiments that render images of their own: no store tells the reference's noise, which is
    therefore taken from its halves, a and b: their mean's is the RMSE of (a - b) / 2."""
    if not (reference_path(folder, case).is_file() and half_path(folder, case).is_file()):
        make_reference(case, folder)
    image = read_radiance(reference_path(folder, case))
    floor = rmse(read_radiance(half_path(folder, case)), image)
    return truth_of(case, str(folder), floor)


def scores(image: NDArray[np.float32], truth: Truth, names: Iterable[str]) -> dict[str, Row]:
    """What a row says of an image by each metric, by the metric's name.

    image : (H, W, 3) as rendered, before exposure"""
    exposed = truth.exposed(image)
    return {name: find_metric(name).columns(exposed, truth) for name in names}
