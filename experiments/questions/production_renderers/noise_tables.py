"""The report's part on noise: errors, times and efficiencies, made from the rows."""

import json
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from experiments.questions.production_renderers.shots import CONVERGED_BY, OWN
from experiments.questions.production_renderers.to_mitsuba import LLVM, NO_LLVM, SCALAR
from experiments.report.figures import line_plot
from experiments.report.parts import Heading, Items, Part, Plot, Table, Text
from experiments.run.bench import noise_sentence
from experiments.run.loaded_run import Run
from experiments.run.study import NOTE
from metrics.registry import NEAR, ranked_metrics

CASE = ["materials", "scene", "environment"]
BASE = f"{OWN} {CONVERGED_BY}"
"""Efficiencies are told as multiples of its."""
NOISE_FORMATS = {
    "materials": "s", "samples": "d", "renderer": "s", "cases": "d", "ms": ".1f",
    **{metric.name: f".{metric.digits}f" for metric in ranked_metrics()},
    "times": ".2f", "low": ".2f", "high": ".2f",
}  # fmt: skip
HEADINGS = {
    **{metric.name: metric.label for metric in ranked_metrics()},
    "times": f"efficiency × {BASE}", "low": "least", "high": "most",
}  # fmt: skip
SPEED_FORMATS = {
    "materials": "s", "renderer": "s", "cases": "d", "per_sample_ms": ".2f", "million": ".2f",
    "fixed_ms": ".1f",
}  # fmt: skip
SPEED_HEADINGS = {
    "per_sample_ms": "ms per further sample", "million": "million samples a second",
    "fixed_ms": "ms besides",
}  # fmt: skip


def measured(run: Run) -> pd.DataFrame:
    """The rows that have a result."""
    rows = run.rows
    return rows[rows["seconds"].notna()] if "seconds" in rows else rows.iloc[:0]


def noise(run: Run) -> Iterator[Part]:
    """Error, time and efficiency by renderer and samples, and what was left out."""
    rows = measured(run)
    left_out = list(run.rows[NOTE].dropna().unique()) if NOTE in run.rows else []
    if left_out:
        yield Items(tuple(f"Left out: {sentence}." for sentence in left_out))
    if rows.empty:
        return
    slower = slower_variants(rows)
    if slower:
        yield Items(tuple(slower))
    yield Heading("Noise and time")
    best = {metric.name: metric.better for metric in ranked_metrics()}
    table = by_renderer(rows)
    for (materials, samples), part in table.groupby(["materials", "samples"], sort=False):
        caption = f"{materials}, {samples} samples a pixel."
        yield Table("noise", part, NOISE_FORMATS, HEADINGS, best, caption)
    near = [
        f"{metric.label} in {int(rows[metric.near_column].astype(bool).sum())}"
        for metric in ranked_metrics()
        if metric.near_column in rows
    ]
    yield Text(
        f"{rows['width'].iloc[0]}×{rows['height'].iloc[0]} pixels. Times are geometric means over "
        "cases of rendering alone, with scene, hierarchy and the map's table in memory; errors "
        "are means over cases, against a renderer's own converged mean, exposed, and without that "
        "mean's own noise. Efficiency is 1 / (squared error · seconds); its ratio is a geometric "
        "mean over cases, with the least and the most of any case. Within "
        f"{NEAR:g}× of what the converged mean's noise gives: {', '.join(near)} of {len(rows)} "
        "rows."
    )
    yield Text(noise_sentence(rows))
    for materials in map(str, table["materials"].unique()):
        part = table[table["materials"] == materials]
        for metric in ranked_metrics():
            shown = part.assign(seconds=part["ms"] / 1e3)
            axes = ("seconds an image", metric.label)
            draw = partial(line_plot, shown, "seconds", metric.name, "renderer", axes)
            title = f"{metric.label} against time, {materials}: 1 to 64 samples a pixel."
            yield Plot(f"{metric.name}_seconds_{materials}", draw, title)
    yield from speed(rows)
    by_map = efficiency_by_map(rows)
    names = [str(column) for column in by_map if column not in ("materials", "environment")]
    formats = {"materials": "s", "environment": "s", **dict.fromkeys(names, ".2f")}
    most = int(rows["samples"].max())
    yield Heading("Efficiency by map")
    yield Table(
        "efficiency_by_map", by_map, formats, {name: name for name in names},
        caption=f"Efficiency as a multiple of that of {BASE}, at {most} samples a pixel; geometric "
        "means over scenes.",
    )  # fmt: skip


def reported_settings(rows: pd.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """What each renderer's program said of itself, each answer once."""
    return {
        str(renderer): [json.loads(text) for text in part["settings"].unique()]
        for renderer, part in rows.groupby("renderer", sort=False)
    }


def slower_variants(rows: pd.DataFrame) -> list[str]:
    """One sentence on renderers that were not timed at their best: Mitsuba without LLVM."""
    named = [
        renderer
        for renderer, found in reported_settings(rows).items()
        if any(facts.get("variant") == SCALAR for facts in found)
    ]
    return [without_llvm(named)] if named else []


def without_llvm(renderers: Sequence[str]) -> str:
    """What is to be said of renderers that use Mitsuba's scalar variant."""
    return (
        f"{' and '.join(renderers)}: variant {SCALAR}, since {NO_LLVM}; {LLVM} is Mitsuba's "
        "variant for speed, so these times are not its best. Install such a library, or name it by "
        "DRJIT_LIBLLVM_PATH."
    )


def geometric(values: pd.Series) -> float:
    """The geometric mean of what is known; NaN where nothing is."""
    return float(np.exp(np.log(values.dropna()).mean()))


def relative_efficiency(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with `times`, their efficiency over that of BASE in the same case."""
    keys = [*CASE, "samples"]
    base = rows.loc[rows["renderer"] == BASE, [*keys, "efficiency"]]
    merged = rows.merge(base.rename(columns={"efficiency": "base"}), on=keys, how="left")
    return merged.assign(times=merged["efficiency"] / merged["base"])


def by_renderer(rows: pd.DataFrame) -> pd.DataFrame:
    """A line per materials, samples and renderer."""
    found = []
    keys = ["materials", "samples", "renderer"]
    for names, part in relative_efficiency(rows).groupby(keys, sort=False):
        line = dict(zip(keys, names, strict=True)) | {
            "cases": len(part),
            "ms": 1e3 * geometric(part["seconds"]),
            **{metric.name: part[metric.name].mean() for metric in ranked_metrics()},
            "times": geometric(part["times"]),
            "low": part["times"].min(),
            "high": part["times"].max(),
        }
        found.append(line)
    return pd.DataFrame(found).sort_values(["materials", "samples"], kind="stable", key=_in_order)


def efficiency_sentences(rows: pd.DataFrame) -> list[str]:
    """Per materials, every renderer's efficiency at the most samples, the highest first."""
    if rows.empty:
        return []
    found, most = [], int(rows["samples"].max())
    table = by_renderer(rows[rows["samples"] == most])
    for materials, part in table.groupby("materials", sort=False):
        others = part[part["renderer"] != BASE].sort_values("times", ascending=False)
        each = ", ".join(
            f"{line['renderer']} {line['times']:.2f} ({line['low']:.2f} to {line['high']:.2f})"
            for line in others.to_dict("records")
        )
        found.append(
            f"{materials}, {most} samples a pixel: efficiency, 1 / (squared error · seconds), over "
            f"that of {BASE}, the geometric mean and the range over {part['cases'].max()} cases: "
            f"{each}."
        )
    return found


def _in_order(column: pd.Series) -> pd.Series:
    """Order of appearance for names, that of numbers for numbers."""
    if pd.api.types.is_numeric_dtype(column):
        return column
    place = {name: k for k, name in enumerate(column.unique())}
    return column.map(place)


def efficiency_by_map(rows: pd.DataFrame) -> pd.DataFrame:
    """A line per materials and map, a column per renderer, at the most samples."""
    most = relative_efficiency(rows[rows["samples"] == rows["samples"].max()])
    means = most.groupby(["materials", "environment", "renderer"], sort=False)["times"]
    table = means.agg(geometric).unstack("renderer")
    order = [name for name in dict.fromkeys(rows["renderer"]) if name in table and name != BASE]
    return table[order].reset_index()


def speed(rows: pd.DataFrame) -> Iterator[Part]:
    """What a sample costs, and what an image costs besides."""
    table = speeds(rows)
    if len(table):
        yield Heading("What a sample costs")
        yield Table("speed", table, SPEED_FORMATS, SPEED_HEADINGS, caption=
            "From the times of the two largest numbers of samples: a line through both. What a "
            "renderer takes for an image besides is told by where that line meets zero samples; "
            "geometric means, and for the rest a median, over cases.")  # fmt: skip


def speeds(rows: pd.DataFrame) -> pd.DataFrame:
    """Milliseconds per further sample a pixel, samples a second, and milliseconds besides."""
    counts = sorted(rows["samples"].unique())
    if len(counts) < 2:
        return pd.DataFrame()
    few, many = counts[-2:]
    wide = rows.pivot_table(
        index=["materials", "renderer", "scene", "environment"], columns="samples",
        values=["seconds", "mean_samples"], sort=False,
    )  # fmt: skip
    times, taken = wide["seconds"], wide["mean_samples"]
    slope = (times[many] - times[few]) / (taken[many] - taken[few])
    slope = slope.where(slope > 0.0)
    pixels = int(rows["width"].iloc[0]) * int(rows["height"].iloc[0])
    cases = pd.DataFrame({"slope": slope, "fixed": times[few] - slope * taken[few]})
    found = []
    for (materials, renderer), part in cases.groupby(["materials", "renderer"], sort=False):
        each = geometric(part["slope"])
        found.append(
            {
                "materials": materials, "renderer": renderer, "cases": len(part),
                "per_sample_ms": 1e3 * each, "million": pixels / each / 1e6,
                "fixed_ms": 1e3 * part["fixed"].median(),
            }
        )  # fmt: skip
    return pd.DataFrame(found)
