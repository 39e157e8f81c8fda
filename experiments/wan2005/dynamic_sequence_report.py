"""Tables, plots and strips of pictures of the experiment `dynamic-sequence`."""

from pathlib import Path

import numpy as np
import pandas as pd

from experiments.report.frames import present
from experiments.report.light_pattern import write_sheet
from experiments.report.line_plot import write_lines
from experiments.run.bench import noise_sentence
from experiments.run.record import write_csv
from experiments.run.study import NOTE
from experiments.wan2005.dynamic_sequence import SHOWN, TIMING, tile

STEM = "dynamic_sequence"
TITLE = "Change between frames of a fire (Wan, Wong and Leung 2005, section 6)"
TIME_TITLE = "Q²-tree: a frame alone and from the frame before"
STRIP_METHODS = ("reference", "q2-tree", "fhis", "median-cut")
"""Methods of the strip of pictures: the paper's own, its "Penrose-based", and a third."""
FORMATS = {
    "method": "s", "lights": ".0f", "lights_change": ".3f", "map_change": ".3f",
    "unburnt_change": ".3f", "unburnt_kept": ".3f", "noise_ratio": ".3f",
    "temporal_noise": ".5f", "most_noise": ".5f", "image_change": ".5f", "true_change": ".5f",
    "error": ".4f",
}  # fmt: skip
TIME_FORMATS = {
    "environment": "s", "scene": "s", "frames": "d", "ms_alone": ".2f", "ms_coherent": ".2f",
    "ms_reading": ".2f", "speed_up": ".2f", "speed_up_lower": ".2f", "speed_up_upper": ".2f",
    "quads_changed": ".1f", "identical": "d", "published": "s",
}  # fmt: skip


def summary_of(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per method: means over pairs of frames, the calmest images first.

    Temporal noise is the root of the mean square, and so is what it is compared with.
    """
    squared = ["temporal_noise", "image_change", "true_change", "error"]
    plain = ["lights", "lights_change", "map_change", "unburnt_change", "unburnt_kept"]
    grouped = rows.groupby("method", sort=False)
    table = grouped[plain].mean()
    for column in squared:
        table[column] = grouped[column].agg(lambda v: float(np.sqrt(np.mean(np.square(v)))))
    table["most_noise"] = grouped["temporal_noise"].max()
    table["noise_ratio"] = table["temporal_noise"] / table["true_change"]
    return table.reset_index().sort_values("noise_ratio", kind="stable").reset_index(drop=True)


def time_summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per scene and place: medians over frames of times and of their ratio."""
    found = []
    for case, part in rows.groupby(["environment", "scene"], sort=False):
        environment, scene = map(str, case)
        ratio = part["seconds_alone"] / part["seconds_coherent"]
        lower, middle, upper = np.percentile(ratio, [25.0, 50.0, 75.0])
        found.append(
            {
                "environment": environment, "scene": scene, "frames": len(part),
                **{
                    f"ms_{name}": 1e3 * part[f"seconds_{name}"].median()
                    for name in ("alone", "coherent", "reading")
                },
                "speed_up": middle, "speed_up_lower": lower, "speed_up_upper": upper,
                "quads_changed": part["quads_changed"].mean(),
                "identical": int(part["identical"].sum()),
                "published": "0.70 s, 0.41 s: 1.7",
            }
        )  # fmt: skip
    return pd.DataFrame(found)


def report(rows: pd.DataFrame, folder: Path, count: int) -> list[Path]:
    """Tables of changes and of times, plots over frames, strips of frames."""
    left_out = sorted(set(rows[NOTE].dropna())) if NOTE in rows else []
    rows = rows[rows[NOTE].isna()].drop(columns=NOTE) if NOTE in rows else rows
    timing = rows[rows["method"] == TIMING].dropna(axis=1, how="all")
    rows = rows[rows["method"] != TIMING].dropna(axis=1, how="all")
    files: list[Path] = []
    if len(rows):
        files += _report_changes(rows, folder, count, left_out)
    if len(timing):
        table = time_summary(timing)
        notes = [
            "Medians over frames, interleaved rounds, 300 lights if not said otherwise; `speed "
            "up` is the median of the frames' ratios with its quartiles, `identical` how many "
            "frames have the same lights, bit for bit, either way, `quads changed` how many "
            "leaves differ from the frame before. `ms reading` is the pass over the map, a part "
            "of both. The last column is the paper's, on its machine and maps.",
            noise_sentence(timing),
        ]
        files += present(folder, f"{STEM}_times", table, TIME_FORMATS, TIME_TITLE, notes)
    return files


def _report_changes(
    rows: pd.DataFrame, folder: Path, count: int, left_out: list[str]
) -> list[Path]:
    table = summary_of(rows)
    pairs = len(rows[["scene", "environment", "frame"]].drop_duplicates())
    notes = [
        f"Means over {pairs} pairs of consecutive frames, {count} lights. `lights change` is "
        "light energy × angle moved, in degrees per unit of energy; energy that goes out or is "
        "lit counts as moved by half a radian. `map change` is that of the maps themselves, on a "
        "grid of 64 × 32 cells. `unburnt` is where no flame ever is: there the true change is 0, "
        "and `kept` is the share of energy in lights that stay exactly as they are. `temporal "
        "noise` is the RMSE of the images' change against the references' change, `noise ratio` "
        "that over the true change, `error` the RMSE of the images. One exposure for all frames; "
        f"the references' changes have a noise floor of at most {rows['noise_floor'].max():.5f}.",
        *[f"{sentence}." for sentence in left_out],
    ]
    files = present(folder, STEM, table, FORMATS, TITLE, notes)
    by_frame = folder / f"{STEM}_frames.csv"
    write_csv(by_frame, rows)
    files.append(by_frame)
    order = list(table["method"])
    for case, part in rows.groupby(["scene", "environment"], sort=False):
        scene, environment = map(str, case)
        files += _plots(part, order, folder, f"{scene}_{environment}")
        files += _strip(folder, scene, environment)
    return files


def _plots(part: pd.DataFrame, order: list[str], folder: Path, where: str) -> list[Path]:
    lines = [part[part["method"] == method] for method in order]
    one = part[part["method"] == part["method"].iloc[0]]
    curves = {
        "lights": ("lights_change", "map_change", "lights moved: degrees per unit of energy"),
        "images": ("temporal_noise", "true_change", "RMSE of the change from the frame before"),
    }
    files = []
    for name, (column, truth, axis) in curves.items():
        label = "true change (of the map)" if name == "lights" else "true change (for scale)"
        true = one.assign(method=label, **{column: one[truth]})
        files += write_lines(
            folder, f"{STEM}_{name}_{where}", pd.concat([*lines, true]), "frame", column, "method",
            ("frame", axis), log_x=False,
        )  # fmt: skip
    return files


def _strip(folder: Path, scene: str, environment: str) -> list[Path]:
    """Three consecutive frames, a row of images and a row of patterns for each method."""
    files = []
    for kind in ("image", "pattern"):
        tiles = {
            f"{method}, frame {frame}": tile(folder, scene, environment, kind, method, frame)
            for method in STRIP_METHODS
            for frame in SHOWN
        }
        path = folder / f"{STEM}_{kind}s_{scene}_{environment}.jpg"
        files += write_sheet(path, tiles, len(SHOWN))
    return files
