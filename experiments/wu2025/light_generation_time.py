"""How long making lights takes, per method, map, map size and number of lights.

Reproduces section 4.5 of Wu, "Efficient environment map rendering based on decomposition", 2025,
and the times that the other papers print. A row is a method on a map of a size, or a table that
methods share: the median of interleaved rounds, and the peak memory of the method in a process of
its own. See `experiments.wu2025.light_generation` for how it is measured.

Counts: 64 lights; 300 for FHIS and the Q²-tree, as in their papers; the kd-tree cuts the map into
its 6144 cases whatever the count. With --budget, that number for all. Scales standard and paper
have maps up to 8192×4096, enlarged from smaller ones.
"""

from collections.abc import Iterator
from functools import partial

import pandas as pd

from experiments.report.figures import line_plot
from experiments.report.parts import Items, Part, Plot, Table
from experiments.report.tables import with_milliseconds
from experiments.run.bench import noise_sentence
from experiments.run.experiment import Study, experiment
from experiments.run.loaded_run import Run
from experiments.wu2025.light_generation import TABLE, groups
from experiments.wu2025.published import LIGHT_GENERATION, LIGHT_GENERATION_MS

OURS = "ours"
FORMATS = {
    "environment": "s", "width": "d", "enlarged": "d", "method": "s", "count": ".0f", "ms": ".2f",
    "ms_lower": ".2f", "ms_upper": ".2f", "rounds": "d", "peak_mib": ".1f", "published": "s",
}  # fmt: skip
CAPTION = (
    "Medians and quartiles over interleaved rounds; shared tables exist before a method's clock "
    "starts and are timed apart. `peak mib` is what a method needs at its peak beyond the map and "
    "these tables, in a fresh process. The last column is what the papers print, on machines of "
    "2003 to 2025 and other maps. kd-tree: 6144 cases."
)


@experiment("light-generation-time")
def light_generation_time() -> Study:
    """How long making lights takes, per method and map size, and its peak memory."""
    return Study(
        title="Time to generate lights (Wu 2025, 4.5)",
        sections=(times, plots),
        groups=groups,
        sources=("experiments.wu2025.light_generation",),
        findings=findings,
    )


def findings(run: Run) -> list[str]:
    """The paper's order of methods, where there are rows of it."""
    return list(filter(None, [paper_sentence(with_milliseconds(run.rows))]))


def times(run: Run) -> Iterator[Part]:
    """All rows, fastest first on each map, and what the paper says of them."""
    rows = with_milliseconds(run.rows)
    rows = rows.assign(published=rows["method"].map(LIGHT_GENERATION))
    rows = rows.sort_values(["environment", "width", "ms"], kind="stable", ignore_index=True)
    yield Items(
        tuple(
            filter(
                None,
                (
                    enlarged_sentence(rows),
                    paper_sentence(rows),
                    noise_sentence(run.rows),
                ),
            )
        )
    )
    yield Table("light_generation_time", rows, FORMATS, caption=CAPTION)


def enlarged_sentence(rows: pd.DataFrame) -> str:
    """Which maps were enlarged, and how; empty where none was."""
    large = rows[rows["enlarged"] > 1][["environment", "width", "enlarged"]].drop_duplicates()
    listed = [
        f"{environment} to {width}×{width // 2} by {factor}×{factor}"
        for environment, width, factor in large.itertuples(index=False, name=None)
    ]
    return f"Enlarged maps, whose texels are repeated: {', '.join(listed)}." if listed else ""


def paper_sentence(rows: pd.DataFrame) -> str:
    """The paper's order of methods, and on how many maps and sizes it is found here."""
    found = rows.pivot_table(index=["environment", "width"], columns="method", values="ms")
    if OURS not in found:
        return ""
    found = found.dropna(subset=[OURS])
    text = (
        f"Wu 2025 prints {LIGHT_GENERATION_MS[OURS]} ms for its method, about "
        f"{LIGHT_GENERATION_MS['median-cut']:.0f} ms for median cut and variance minimization, and "
        f"that TMMS might take seconds. Here ours takes {found[OURS].min():.1f} to "
        f"{found[OURS].max():.1f} ms on {len(found)} maps and sizes"
    )
    for name in ("median-cut", "variance-minimization", "tmms"):
        if name in found:
            ratio = found[name] / found[OURS]
            text += (
                f"; {name} {ratio.min():.2f} to {ratio.max():.2f} times as long, less than ours on "
                f"{(ratio < 1.0).sum()}"
            )
    return text + "."


def plots(run: Run) -> Iterator[Part]:
    """Time and memory against map size, where a map has several."""
    methods = run.rows[~run.rows["method"].str.startswith(TABLE)]
    kinds = {
        "": ("ms", "ms to generate lights", "Time to generate lights against map size"),
        "_memory": ("peak_mib", "peak memory in MiB", "Peak memory against map size"),
    }
    for environment, part in methods.groupby("environment", sort=False):
        if part["width"].nunique() < 2:
            continue
        label = part["method"] + " at " + part["count"].map("{:.0f}".format)
        shown = part.assign(label=label, ms=1e3 * part["seconds"])
        for suffix, (column, axis, caption) in kinds.items():
            drawn = shown[shown[column] > 0.0]
            axes = ("map width in texels", axis)
            draw = partial(line_plot, drawn, "width", column, "label", axes)
            yield Plot(f"light_generation_time_{environment}{suffix}", draw,
                       f"{caption}, {environment}.")  # fmt: skip
