"""Samples per second: kd-tree against tabulated inversion, over map size and over maps.

Reproduces the claim of Ergun 2012, Figures 3 to 5: sampling by the kd-tree takes the same time
whatever the map, and is 3.8 times as fast as inversion by binary search (72 against 19 frames per
second on their GPU). Four ways to draw a direction with its density are timed on the same random
numbers: the kd-tree's law; an alias table over the same blocks; inversion by binary search of whole
rows; and inversion whose searches start from a table of cut points. Interleaved rounds.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.ergun2012 import FRAMES_INVERSION, FRAMES_KD_TREE
from experiments.maps.sources import EMBEDDED, EnvironmentSource, find_environments
from experiments.report.figures import line_plot
from experiments.report.parts import Part, Plot, Table, Text
from experiments.report.style import label_of
from experiments.run.bench import interleaved, noise_sentence, over_baseline
from experiments.run.case import environment_identity
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    answer,
    experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from samplers.kd_tree import KdTreeDistribution
from samplers.lighting import LightDistribution, TabulatedLight
from samplers.threads import for_blocks, set_thread_count, thread_count

METHODS = {
    "kd-tree": SamplerSpec("kd-tree"),
    "alias table": SamplerSpec("kd-tree", (("pdf_form", "exact"),)),
    "binary search": SamplerSpec("mis", (("guided", False),)),
    "guided search": SamplerSpec("mis", (("guided", True),)),
}
BASELINE = "binary search"
PAPER_RATIO = FRAMES_KD_TREE / FRAMES_INVERSION
KINDS = ["noon-desert", "overcast-moor", "starry-desert", "room-one-window", "constant"]
HEIGHTS = {
    "quick": (256, 512, 1024),
    "standard": (256, 512, 1024, 2048),
    "paper": (256, 512, 1024, 2048, 4096),
}
KIND_HEIGHT = {"quick": 256, "standard": 1024, "paper": 1024}
SAMPLES = {"quick": 1 << 18, "standard": 1 << 20, "paper": 1 << 21}
ROUNDS = {"quick": 7, "standard": 15, "paper": 15}
THREADS = (1, 2)
BLOCK = 1 << 13
COUNTED = 1 << 14
"""Samples over which the lookups of a search are averaged."""
FORMATS = {
    "environment": "s", "width": "d", "method": "s", "threads": "d", "million_per_second": ".2f",
    "lower": ".2f", "upper": ".2f", "ratio": ".2f", "lookups": ".2f", "table_mib": ".2f",
}  # fmt: skip


@experiment("kd-tree-throughput")
def kd_tree_throughput() -> Study:
    """Samples per second by kd-tree, alias table and inversion."""
    return Study(
        title="Samples per second (Ergun, Kurt and Öztürk 2012, Fig. 3-5)",
        sections=(rates_section,),
        groups=groups,
        sources=(__name__,),
        figures=(PaperFigure("Fig. 3 and 4", "frames a second by map", faster),),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per set of maps that are measured side by side."""
    samples, rounds = of_scale(SAMPLES, request.scale), of_scale(ROUNDS, request.scale)
    return [_group(sources, samples, rounds) for sources in _sources(request)]


def _sources(request: RunRequest) -> list[list[EnvironmentSource]]:
    """Maps that are measured side by side: one embedded map at each size; several kinds at one.

    Files are all measured side by side.
    """
    if request.environments != EMBEDDED:
        return [study_environments(request, [], 0)]
    patterns, height = request.maps or KINDS, of_scale(KIND_HEIGHT, request.scale)
    kinds = find_environments(EMBEDDED, patterns, height)
    others = [h for h in of_scale(HEIGHTS, request.scale) if h != height]
    return [kinds, *([replace(kinds[0], height=h)] for h in others)]


def _group(sources: list[EnvironmentSource], samples: int, rounds: int) -> Group:
    asked = (
        (
            {"environment": source.name, "method": method, "threads": threads},
            {"map": environment_identity(source), "sampler": spec.identity},
            (source, method, threads),
        )
        for source in sources
        for method, spec in METHODS.items()
        for threads in THREADS
    )
    rows = f", {sources[0].height} rows" if sources[0].height else ""
    label = ", ".join(source.name for source in sources) + rows
    measure = partial(_measured, samples=samples, rounds=rounds)
    return Group(label, asked, measure, {}, {"samples": samples, "rounds": rounds})


def _measured(
    work: list[tuple[EnvironmentSource, str, int]], samples: int, rounds: int
) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    u = rng.random((samples, 3), np.float32)
    width: dict[EnvironmentSource, int] = {}
    made: dict[tuple[EnvironmentSource, str], LightDistribution] = {}
    for source in dict.fromkeys(source for source, _, _ in work):
        environment = source.load()
        width[source] = environment.width
        for method in {m for s, m, _ in work if s == source}:
            lighting = METHODS[method].sampler.prepare(environment, 1, rng)
            assert isinstance(lighting, LightDistribution)
            made[source, method] = lighting
    tasks = {
        str(k): partial(on_threads, threads, in_blocks, made[source, method].sample, u)
        for k, (source, method, threads) in enumerate(work)
    }
    for timing, (source, method, _) in zip(interleaved(tasks, rounds).values(), work, strict=True):
        yield {
            "width": width[source],
            "samples": samples,
            **timing.columns(),
            "lookups": lookups(made[source, method], u[:COUNTED]),
            "table_mib": table_bytes(made[source, method]) / 2**20,
        }


def on_threads(count: int, function: Callable[..., Any], *args: Any) -> Any:
    """What a function returns that is called on so many threads."""
    before = thread_count()
    set_thread_count(count)
    try:
        return function(*args)
    finally:
        set_thread_count(before)


def in_blocks(function: Callable[[NDArray], Any], numbers: NDArray[np.float32]) -> None:
    """Call a function, such as one that draws directions, on all of the numbers (n, …)."""
    for_blocks(lambda start, stop: function(numbers[start:stop]), len(numbers), BLOCK)


def lookups(lighting: LightDistribution, u: NDArray[np.float32]) -> float:
    """Mean number of table entries that a sample reads to find its block or texel.

    A search among k + 1 cells reads at most as many as k has binary digits; both searches of an
    inversion count, and with a guide the two entries of each guide too.
    """
    if isinstance(lighting, KdTreeDistribution):
        if not len(lighting.threshold):
            return 0.0
        place = np.minimum(
            (u[:, 0] * len(lighting.threshold)).astype(np.int64), len(lighting.threshold) - 1
        )
        # The threshold, and the alias where the block itself is not kept.
        return 1.0 + float((u[:, 2] >= lighting.threshold[place]).mean())
    if not isinstance(lighting, TabulatedLight):
        return 0.0
    table, height = lighting.table, len(lighting.weight)
    row = np.searchsorted(table.marginal, u[:, 1] * table.marginal[-1], "right")
    row = np.minimum(row, height - 1)
    total = np.zeros(len(u))
    for guide, share in (
        (np.broadcast_to(table.marginal_guide, (len(u), len(table.marginal_guide))), u[:, 1]),
        (table.guide.reshape(height, -1)[row], u[:, 0]),
    ):
        step = (share.astype(np.float64) * (guide.shape[1] - 1)).astype(np.int64)
        here = np.arange(len(u))
        reach = guide[here, step + 1] - guide[here, step]
        total += np.frexp(reach.astype(np.float64))[1] + (2.0 if guide.shape[1] > 2 else 0.0)
    return float(total.mean())


def table_bytes(lighting: LightDistribution) -> int:
    """Bytes of what sampling reads, without what only the density of a direction needs."""
    if isinstance(lighting, TabulatedLight):
        read = lighting.table._replace(row_sum=np.empty(0))
        return lighting.weight.nbytes + sum(array.nbytes for array in read)
    if isinstance(lighting, KdTreeDistribution):
        return lighting.record.nbytes + lighting.threshold.nbytes + lighting.alias.nbytes
    return 0


def with_rates(rows: pd.DataFrame) -> pd.DataFrame:
    """Rates with their quartiles, and their ratio to binary search on the same map and threads."""
    rates = rows.assign(
        million_per_second=rows["samples"] / rows["seconds"] / 1e6,
        lower=rows["samples"] / rows["seconds_upper"] / 1e6,
        upper=rows["samples"] / rows["seconds_lower"] / 1e6,
    )
    case = ["environment", "width", "threads"]
    ratio = over_baseline(rates, "million_per_second", "method", BASELINE, case)
    return rates.assign(ratio=ratio)


def rates_section(run: Run) -> Iterator[Part]:
    """The rates, and against map size on one thread."""
    rates = with_rates(run.rows)
    caption = (
        "`ratio` is the rate over that of binary search on the same map and threads; the paper's "
        f"is {PAPER_RATIO:.1f} ({FRAMES_KD_TREE:.0f} against "
        f"{FRAMES_INVERSION:.0f} frames per second, on a GPU). `lookups` are table entries read "
        "per sample to find the block or texel, before the one that is found. Rate on the slowest "
        f"map over rate on the fastest, one size, one thread: {_evenness(rates)}."
    )
    yield Table("rates", rates, FORMATS, caption=caption)
    yield Text(noise_sentence(run.rows))
    one = rates[rates["threads"] == 1].rename(
        columns={"lower": "million_per_second_lower", "upper": "million_per_second_upper"}
    )
    axes = ("map width in texels", "million samples per second, one thread")
    for environment, part in one.groupby("environment", sort=False):
        if part["width"].nunique() > 1:
            draw = partial(
                line_plot, part, "width", "million_per_second", "method", axes, log_y=False
            )
            yield Plot(f"rates_{environment}", draw, f"{environment}: {axes[1]}.")


def faster(run: Run) -> tuple[str, str]:
    """How much faster the kd-tree draws than binary search, and how much both depend on the map."""
    rates = with_rates(run.rows)
    ratio = rates.loc[rates["method"] == "kd-tree", "ratio"]
    more = int((ratio > 1.0).sum())
    return (
        f"{answer(more, len(ratio))}: {ratio.min():.1f}× to {ratio.max():.1f}× as fast",
        f"Samples a second over binary search's; the paper's frames {PAPER_RATIO:.1f}×, the "
        f"kd-tree's whatever the map. Slowest map over fastest: {_evenness(rates)}.",
    )


def _evenness(rates: pd.DataFrame) -> str:
    """How much a method's rate depends on the map, at the size that most maps have."""
    one = rates[rates["threads"] == 1]
    width = one["width"].mode().iloc[0]
    same = one[one["width"] == width].groupby("method", sort=False)["million_per_second"]
    return ", ".join(
        f"{label_of(str(name))} {low:.2f}" for name, low in (same.min() / same.max()).items()
    )
