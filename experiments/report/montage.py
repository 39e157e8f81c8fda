"""One picture per case: the reference, and every sampler's image with its errors."""

from itertools import groupby
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.preview import contact_sheet, encoded
from experiments.run.case import Case
from experiments.run.kept_images import image_path, reference_path
from experiments.run.measurement import Measurement
from metrics.errors import exposure_scale
from metrics.registry import ranked_metrics
from renderer.image import write_png
from samplers.files.image_file import read_radiance

COLUMNS = 4
LEAST_WIDTH = 240
"""Smaller pictures are enlarged by whole factors, so that labels fit above them."""


def write_montages(folder: Path, measurements: list[Measurement], rows: pd.DataFrame) -> None:
    """One montage per case and budget of the measurements."""
    by_key = rows.set_index("key")
    for (case, _), group in groupby(
        measurements, key=lambda measurement: (measurement.case, measurement.budget)
    ):
        write_montage(folder, case, list(group), by_key)


def write_montage(
    folder: Path, case: Case, measurements: list[Measurement], rows: pd.DataFrame
) -> Path | None:
    """Draw the case's images of the first seed, at the reference's exposure; None without any.

    rows : results by measurement key
    """
    reference = reference_path(folder, case)
    shown = [
        measurement
        for measurement in measurements
        if measurement.seed == 0
        and image_path(folder, measurement).is_file()
        and measurement.key in rows.index
    ]
    if not shown or not reference.is_file():
        return None
    truth = read_radiance(reference)
    scale = exposure_scale(truth)
    enlarge = max(1, -(-LEAST_WIDTH // truth.shape[1]))

    def picture(image: NDArray[np.float32]) -> NDArray[np.uint8]:
        return encoded(image * scale).repeat(enlarge, axis=0).repeat(enlarge, axis=1)

    labels = " / ".join(metric.label for metric in ranked_metrics())
    pictures = [(f"reference · {labels}", picture(truth))]
    for measurement in shown:
        row = rows.loc[measurement.key]
        errors = " / ".join(f"{row[metric.name]:.3f}" for metric in ranked_metrics())
        label = f"{measurement.sampler.label} {errors}"
        pictures.append((label, picture(read_radiance(image_path(folder, measurement)))))
    path = (
        folder / "montages" / f"{case.scene}_{case.environment.name}_{measurements[0].budget}.png"
    )
    write_png(path, contact_sheet(pictures, min(COLUMNS, len(pictures))))
    return path
