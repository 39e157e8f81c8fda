"""Mean error and mean rank of every sampler over all maps and scenes.

Reproduces Table 1 of Wu 2025: errors averaged over maps and scenes, and the rank of each method per
map, averaged over maps. Beside it stands, from the images of several seeds, what of a sampler's
squared error is bias and what is variance.

The expected squared error of a pixel is the square of its bias plus its variance. The variance is
estimated without bias by that of the seeds' images, and the rest of the squared error, of which the
reference's own noise is taken off, is bias. More samples make only the variance smaller. A sampler
of one seed has bias alone and stands in no line there; in that of a stochastic set of lights the
variance is what another draw of the lights changes.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sections.ranks import pairwise, ranked
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.loaded_run import Run, found_or_kept
from experiments.wu2025.published import TABLE1

CASE = ["scene", "environment", "budget"]
FILE = "bias_and_variance.csv"
FORMATS = {
    "budget": "s", "sampler": "s", "rmse": ".4f", "bias": ".4f", "deviation": ".4f",
    "share": ".0%", "mostly": "d", "cases": "d",
}  # fmt: skip
HEADINGS = {
    "rmse": "RMSE", "bias": "√bias²", "deviation": "√variance", "share": "bias² of the whole",
    "mostly": "cases with more bias² than variance",
}  # fmt: skip


@experiment("table1")
def table1() -> GridExperiment:
    """Mean errors with mean ranks over maps and scenes."""
    return GridExperiment(
        title="Table 1",
        sections=(ranked(TABLE1, leagues=True), pairwise, bias_and_variance),
        published=TABLE1,
    )


def bias_and_variance(run: Run) -> Iterator[Part]:
    """The table; nothing where no images are kept and none were when the report was made before."""
    split = found_or_kept(run.folder / FILE, squared_errors(run))
    if split.empty:
        return
    yield Heading("Bias and variance")
    yield Table("bias_and_variance_means", means(split, run), FORMATS, HEADINGS)
    yield Text(
        "Roots of means over cases of the squared error, of its bias² and of its variance, in "
        "units of the exposed image, for the samplers that several seeds were measured of. An "
        "estimate of bias² near zero can be negative on a case; where the mean is, its root is 0."
    )


def squared_errors(run: Run) -> pd.DataFrame:
    """Per case, budget and sampler with several kept images: `error`, the squared error without the
    reference's noise, and of it `bias` and `variance`.
    """
    groups = run.rows.groupby([*CASE, "sampler"], sort=False)
    parts = (_squared_error(run, rows) for _, rows in groups)
    return pd.DataFrame([part for part in parts if part is not None])


def _squared_error(run: Run, rows: pd.DataFrame) -> dict[str, Any] | None:
    """The line of one sampler in one case; None where seeds or images are missing."""
    if len(rows) < 2:
        return None
    found = [run.read(run.kept_image(row)) for _, row in rows.iterrows()]
    kept = [image for image in found if image is not None]
    if len(kept) < len(rows):
        return None
    exposure = rows["exposure"].to_numpy(np.float64)[:, None, None, None]
    images = np.stack(kept) * exposure
    variance = float(images.var(axis=0, ddof=1).mean())
    error = float((rows["rmse_measured"] ** 2 - rows["rmse_floor"] ** 2).mean())
    named = {name: rows[name].iloc[0] for name in (*CASE, "sampler")}
    return {**named, "error": error, "bias": error - variance, "variance": variance}


def means(split: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Over cases, a line for each budget and sampler in the run's order, least bias first."""
    lines = []
    for (budget, sampler), rows in split.groupby(["budget", "sampler"], sort=False):
        error, bias, variance = (
            max(0.0, float(rows[name].mean())) for name in ("error", "bias", "variance")
        )
        lines.append({
            "budget": budget, "sampler": sampler, "rmse": np.sqrt(error), "bias": np.sqrt(bias),
            "deviation": np.sqrt(variance), "share": bias / max(bias + variance, 1e-300),
            "mostly": int((rows["bias"] > rows["variance"]).sum()), "cases": len(rows),
        })  # fmt: skip
    table = pd.DataFrame(lines)
    places = {budget: place for place, budget in enumerate(run.budgets)}
    return table.assign(place=table["budget"].map(places)).sort_values(
        ["place", "share", "sampler"], ignore_index=True
    )
