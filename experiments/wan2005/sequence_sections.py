"""Tables, plots and rows of pictures of a dynamic sequence."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pandas as pd

from experiments.report.line_plot import line_plot
from experiments.report.parts import Heading, Part, Plot, Table, Text
from experiments.report.sheets import kept_tile, sheet, tile_path
from experiments.run.bench import noise_sentence
from experiments.run.loaded_run import Run
from experiments.wan2005.published import SECONDS_ALONE, SECONDS_COHERENT
from metrics.registry import ranked_metrics

OWN, TIMING, REFERENCE = "q2-tree", "timing", "reference"
"""The paper's method; in the column `method`, what a row of times is; a tile of the reference."""
SHOWN = (89, 90, 91)
"""The paper's frames."""
STRIP_METHODS = (REFERENCE, OWN, "fhis", "median-cut")
"""Methods of the row of pictures: the paper's own, its "Penrose-based", and a third."""
FORMATS = {
    "method": "s", "lights": ".0f", "lights_change": ".3f", "map_change": ".3f",
    "unburnt_change": ".3f", "unburnt_kept": ".3f", "noise_ratio": ".3f",
    "temporal_noise": ".5f", "most_noise": ".5f", "image_change": ".5f", "true_change": ".5f",
}  # fmt: skip
TIMED = ("alone", "coherent", "reading", "tree_alone", "tree_coherent")
TIME_FORMATS = {
    "environment": "s", "scene": "s", "frames": "d", **{f"ms_{name}": ".2f" for name in TIMED},
    "speed_up": ".2f", "speed_up_lower": ".2f", "speed_up_upper": ".2f", "tree_speed_up": ".2f",
    "quads_changed": ".1f", "identical": "d", "published_speed_up": ".2f",
}  # fmt: skip


def changes_section(run: Run) -> Iterator[Part]:
    """Changes by method, over frames, and three frames as pictures."""
    rows = run.rows[run.rows["method"] != TIMING].dropna(axis=1, how="all")
    if rows.empty:
        return
    table = summary_of(rows)
    errors = [metric for metric in ranked_metrics() if metric.name in table]
    formats = FORMATS | {metric.name: f".{metric.digits}f" for metric in errors}
    headings = {metric.name: metric.label for metric in errors}
    pairs = len(rows[["scene", "environment", "frame"]].drop_duplicates())
    caption = (
        f"Means over {pairs} pairs of consecutive frames. `lights change` is light energy × angle "
        "moved, in degrees per unit of energy; energy that goes out or is lit counts as moved by "
        "half a radian. `map change` is that of the maps themselves, on a grid of 64 × 32 cells. "
        "`unburnt` is where no flame ever is: there the true change is 0, and `kept` is the share "
        "of energy in lights that stay exactly as they are. `temporal noise` is the RMSE of the "
        "images' change against the references' change, `noise ratio` that over the true change. "
        "One exposure for all frames; the references' changes have a noise floor of at most "
        f"{rows['change_floor'].max():.5f}."
    )
    yield Heading("Changes between frames")
    yield Table("changes", table, formats, headings, {"noise_ratio": "less"}, caption)
    for case, part in rows.groupby(["scene", "environment"], sort=False):
        where = "_".join(map(str, case))
        yield from _plots(part, list(table["method"]), where)
        yield from _strips(run, where)


def summary_of(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per method: means over pairs of frames, the calmest images first.

    Temporal noise is the root of the mean square, and so is what it is compared with.
    """
    squared = ["temporal_noise", "image_change", "true_change"]
    plain = ["lights", "lights_change", "map_change", "unburnt_change", "unburnt_kept"]
    plain += [metric.name for metric in ranked_metrics() if metric.name in rows]
    grouped = rows.groupby("method", sort=False)
    table = grouped[plain].mean()
    for column in squared:
        table[column] = grouped[column].agg(lambda v: float(np.sqrt(np.mean(np.square(v)))))
    table["most_noise"] = grouped["temporal_noise"].max()
    table["noise_ratio"] = table["temporal_noise"] / table["true_change"]
    return table.reset_index().sort_values("noise_ratio", kind="stable").reset_index(drop=True)


def _plots(part: pd.DataFrame, order: list[str], where: str) -> Iterator[Part]:
    lines = [part[part["method"] == method] for method in order]
    one = part[part["method"] == part["method"].iloc[0]]
    for name, column, truth, axis, of in (
        ("lights", "lights_change", "map_change", "lights moved: degrees per unit of energy",
         "of the map"),
        ("images", "temporal_noise", "true_change", "RMSE of the change from the frame before",
         "for scale"),
    ):  # fmt: skip
        true = one.assign(method=f"true change ({of})", **{column: one[truth]})
        draw = partial(
            line_plot, pd.concat([*lines, true]), "frame", column, "method", ("frame", axis),
            log_x=False,
        )  # fmt: skip
        yield Plot(f"{name}_{where}", draw, f"{where.replace('_', ' · ')}: {axis}.")


def _strips(run: Run, where: str) -> Iterator[Part]:
    """Three consecutive frames, a row of images and a row of patterns for each method."""
    for kind in ("image", "pattern"):
        tiles = [
            (f"{method}, frame {frame}", tile_path(run.folder, kind, where, method, frame))
            for method in STRIP_METHODS
            for frame in SHOWN
        ]
        kept = [(label, kept_tile(path)) for label, path in tiles]
        yield sheet(f"{kind}s_{where}.jpg", f"Three frames: {kind}s", kept, len(SHOWN))


def times_section(run: Run) -> Iterator[Part]:
    """Times of the Q²-tree from scratch and from the frame before."""
    rows = run.rows[run.rows["method"] == TIMING].dropna(axis=1, how="all")
    if rows.empty:
        return
    caption = (
        "Medians over frames, interleaved rounds; `speed up` is the median of the frames' ratios "
        "with its quartiles, `identical` how many frames have the same lights, bit for bit, either "
        "way, `quads changed` how many leaves differ from the frame before. `reading` is the pass "
        "over the map, a part of both; `tree` is what comes after it, up to the quads. The last "
        f"column is the paper's: {SECONDS_ALONE:.2f} s alone, {SECONDS_COHERENT:.2f} s coherent, "
        "on its machine and maps."
    )
    yield Heading("Q²-tree: a frame alone and from the frame before")
    yield Table("times", time_summary(rows), TIME_FORMATS, caption=caption)
    yield Text(noise_sentence(rows))


def time_summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per scene and place: medians over frames of times and of their ratio."""
    found = []
    for case, part in rows.groupby(["environment", "scene"], sort=False):
        seconds = {name: part[f"seconds_{name}"] for name in TIMED}
        ratio = seconds["alone"] / seconds["coherent"]
        lower, middle, upper = np.percentile(ratio, [25.0, 50.0, 75.0])
        found.append(
            {
                "environment": case[0], "scene": case[1], "frames": len(part),
                **{f"ms_{name}": 1e3 * values.median() for name, values in seconds.items()},
                "speed_up": middle, "speed_up_lower": lower, "speed_up_upper": upper,
                "tree_speed_up": (seconds["tree_alone"] / seconds["tree_coherent"]).median(),
                "quads_changed": part["quads_changed"].mean(),
                "identical": int(part["identical"].sum()),
                "published_speed_up": SECONDS_ALONE / SECONDS_COHERENT,
            }
        )  # fmt: skip
    return pd.DataFrame(found)
