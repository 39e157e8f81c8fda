"""The report on noise (errors, times, efficiencies) and on whether converged means agree."""

import json
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import pandas as pd

from experiments.questions.comparison import geometric
from experiments.questions.production_renderers.shots import CONVERGED_BY, OWN
from experiments.questions.production_renderers.to_mitsuba import LLVM, NO_LLVM, SCALAR
from experiments.questions.production_renderers.written_scene import CONDUCTOR, LAMBERT
from experiments.report.figures import line_plot
from experiments.report.parts import Heading, Items, Part, Plot, Table, Text
from experiments.report.style import label_of
from experiments.run.bench import noise_sentence, over_baseline
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
    "low": "least",
    "high": "most",
}
SPEED_FORMATS = {
    "materials": "s", "renderer": "s", "cases": "d", "per_sample_ms": ".2f", "million": ".2f",
    "fixed_ms": ".1f",
}  # fmt: skip
SPEED_HEADINGS = {
    "per_sample_ms": "ms per further sample",
    "million": "million samples a second",
    "fixed_ms": "ms besides",
}


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
    headings = HEADINGS | {"times": f"efficiency × {label_of(BASE)}"}
    table = by_renderer(rows)
    for (materials, samples), part in table.groupby(["materials", "samples"], sort=False):
        caption = f"{materials}, {samples} samples a pixel."
        yield Table("noise", part, NOISE_FORMATS, headings, best, caption)
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
        f"mean over cases, with the least and the most of any case. Within {NEAR:g}× of what the "
        f"converged mean's noise gives: {', '.join(near)} of {len(rows)} rows."
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
        "efficiency_by_map", by_map, formats,
        caption=f"Efficiency as a multiple of that of {label_of(BASE)}, at {most} samples a pixel; "
        "geometric means over scenes.",
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


def relative_efficiency(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with `times`, their efficiency over that of BASE in the same case."""
    case = [*CASE, "samples"]
    return rows.assign(times=over_baseline(rows, "efficiency", "renderer", BASE, case))


def by_renderer(rows: pd.DataFrame) -> pd.DataFrame:
    """A line per materials, samples and renderer."""
    keys = ["materials", "samples", "renderer"]
    groups = relative_efficiency(rows).groupby(keys, sort=False)
    errors = {one.name: (one.name, lambda values: values.mean()) for one in ranked_metrics()}
    table = groups.agg(
        cases=("times", "size"), ms=("seconds", geometric), **errors, times=("times", geometric),
        low=("times", "min"), high=("times", "max"),
    ).reset_index()  # fmt: skip
    table["ms"] *= 1e3
    table = table.sort_values("samples", kind="stable")
    return table.iloc[
        pd.Index(rows["materials"].unique()).get_indexer(table["materials"]).argsort(kind="stable")
    ]


def efficiency_sentences(rows: pd.DataFrame) -> list[str]:
    """Per materials, every renderer's efficiency at the most samples, the highest first."""
    if rows.empty:
        return []
    found, most = [], int(rows["samples"].max())
    table = by_renderer(rows[rows["samples"] == most])
    for materials, part in table.groupby("materials", sort=False):
        others = part[part["renderer"] != BASE].sort_values("times", ascending=False)
        each = ", ".join(
            f"{label_of(line['renderer'])} {line['times']:.2f} "
            f"({line['low']:.2f} to {line['high']:.2f})"
            for line in others.to_dict("records")
        )
        found.append(
            f"{materials}, {most} samples a pixel: efficiency, 1 / (squared error · seconds), over "
            f"that of {label_of(BASE)}, the geometric mean and the range over "
            f"{part['cases'].max()} cases: {each}."
        )
    return found


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
    groups = cases.groupby(["materials", "renderer"], sort=False)
    table = groups.agg(
        cases=("slope", "size"), per_sample_ms=("slope", geometric), fixed_ms=("fixed", "median")
    ).reset_index()
    table.insert(4, "million", pixels / table["per_sample_ms"] / 1e6)
    return table.assign(
        per_sample_ms=1e3 * table["per_sample_ms"], fixed_ms=1e3 * table["fixed_ms"]
    )


WANTED = 2e-3
"""How far the mean of an image of diffuse surfaces may lie from this project's."""
AGREEMENT_FORMATS = {
    "materials": "s", "renderer": "s", "cases": "d", "median": ".2e", "largest": ".2e",
    "where": "s", "error": ".1e", "beyond": "d", "blocks_median": ".2e", "blocks_largest": ".2e",
}  # fmt: skip
AGREEMENT_HEADINGS = {
    "median": "median difference", "largest": "largest", "error": "its standard error",
    "beyond": f"beyond {WANTED:g} and 3 errors", "blocks_median": "blocks, median",
    "blocks_largest": "blocks, largest",
}  # fmt: skip
REASONS = (
    (
        LAMBERT,
        f"Diffuse surfaces: where a smooth normal faces away from the eye {OWN} and Cycles shade, "
        "Mitsuba 3 and LuxCore show black. Which share of the light such points carry stands in "
        "agreement_by_case.csv as turned_away.",
    ),
    (
        CONDUCTOR,
        f"Metals: {OWN} and Cycles mask by Smith's height-correlated function, Mitsuba 3 by the "
        "separable one, which is darker at grazing angles.",
    ),
    (
        CONDUCTOR,
        "Metals: LuxCore masks by Schlick's approximation, by which more leaves a surface at "
        "grazing angles than arrives, and the density of its BSDF samples lacks the cosine of the "
        "half vector, which darkens the others.",
    ),
)
"""Why means differ, by materials."""
CASE_FORMATS = {
    "materials": "s", "scene": "s", "environment": "s", "renderer": "s", "difference": "+.2e",
    "difference_error": ".1e", "block_difference": ".2e", "block_noise": ".1e", "block_z": ".2f",
}  # fmt: skip


def agreement(run: Run) -> Iterator[Part]:
    """Converged means against this project's: by renderer, then every case."""
    rows = agreeing(measured(run))
    if rows.empty:
        return
    yield Heading("Agreement of converged means")
    table = agreement_by_renderer(rows)
    yield Table("agreement", table, AGREEMENT_FORMATS, AGREEMENT_HEADINGS)
    yield Text(
        "Differences of the image's mean, over pixels and channels, from that of "
        f"{label_of(BASE)}, as shares of it. Blocks are of 8×8 pixels; theirs is the root mean "
        "square over blocks, in the same unit, without what noise alone gives. A converged mean is "
        f"that of {int(rows['runs'].iloc[0])} independent runs, whose deviation gives the "
        "standard errors. Every case stands in agreement_by_case.csv."
    )
    yield Items(tuple(told for kind, told in REASONS if kind in set(rows["materials"])))
    yield Table("agreement_by_case", rows, CASE_FORMATS, shown=False)


def agreeing(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per case and production renderer, of those that agree in all their rows."""
    if rows.empty:
        return rows
    theirs = rows[~rows["renderer"].str.startswith(f"{OWN} ")]
    return theirs.drop_duplicates([*CASE, "renderer"])


def beyond(rows: pd.DataFrame) -> pd.Series:
    """Whether a mean lies farther off than is wanted, and than three of its standard errors."""
    far = rows["difference"].abs()
    return (far > WANTED) & (far > 3.0 * rows["difference_error"])


def agreement_by_renderer(rows: pd.DataFrame) -> pd.DataFrame:
    """A line per materials and renderer."""
    far = rows.assign(far=rows["difference"].abs(), beyond=beyond(rows).astype(int))
    groups = far.groupby(["materials", "renderer"], sort=False)
    worst = far.loc[groups["far"].idxmax()].reset_index(drop=True)
    table = groups.agg(cases=("far", "size"), median=("far", "median"), largest=("far", "max"))
    return table.reset_index().assign(
        where=worst["scene"] + ", " + worst["environment"],
        error=worst["difference_error"],
        **{
            name: groups[column].agg(how).to_numpy()
            for name, column, how in (
                ("beyond", "beyond", "sum"),
                ("blocks_median", "block_difference", "median"),
                ("blocks_largest", "block_difference", "max"),
            )
        },
    )
