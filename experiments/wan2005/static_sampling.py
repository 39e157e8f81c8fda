"""Patterns of 300 lights on a map, and how good the images are that they give.

Reproduces Figures 7 and 9 of Wan 2005: where each method puts 300 directional lights, and the PSNR
of images lit by them. All samplers take part that make one global set of lights. As in the paper
all pixels have the same set: none are interleaved, otherwise than elsewhere in this benchmark. PSNR
is of 8-bit sRGB images at the reference's exposure, over all pixels.
"""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps import places
from experiments.maps.sources import EnvironmentSource
from experiments.report.case_figures import Tile, sheet
from experiments.report.figures import dot_plot
from experiments.report.map_picture import draw_pattern
from experiments.report.parts import Heading, Part, Plot, Table, Text, counted
from experiments.report.style import label_of
from experiments.run.budget import Budget
from experiments.run.experiment import (
    GridExperiment,
    PaperFigure,
    Published,
    all_samplers,
    answer,
    experiment,
)
from experiments.run.kept_images import budget_in_file_name
from experiments.run.loaded_run import Run
from experiments.run.rendering import rehearse_lights
from experiments.run.sampler_spec import SamplerSpec, choose_samplers, single_sampler
from experiments.run.scale import QUICK, find_scale, references_to, without_interleaving
from metrics.registry import find_metric
from samplers import DirectionalLights, EnvironmentMap, EnvlightError, LayeredLights

REFERENCE_NOISE = {QUICK: 0.0004, "medium": 0.001, "standard": 0.0025}
"""Of the mean luminance, by scale: less than a scale's, as 300 lights come closer to the truth."""
FIGURE9 = Published(
    "Fig. 9 of Wan 2005, as on its project page",
    {
        name: {"psnr": (value, math.nan)}
        for name, value in {
            "q2-tree": 33.9, "structured": 33.9, "fhis": 33.3, "lightgen": 31.9,
        }.items()
    },
)  # fmt: skip
"""PSNR in dB of one scene under one map by 300 lights, against 100,000 uniform ones."""
OWN = "q2-tree"
PRINTED = {name: values["psnr"][0] for name, values in FIGURE9.values.items()}
FORMATS = {
    "sampler": "s", "lights": ".0f", "psnr": ".2f", "psnr_least": ".2f", "psnr_most": ".2f",
    "rank": ".2f", "published": ".1f",
}  # fmt: skip
COUNT = 300
"""The paper's number of lights."""


@experiment("static-sampling")
def static_sampling() -> GridExperiment:
    """PSNR of images lit by fixed patterns of 300 lights."""
    return GridExperiment(
        title="Images lit by fixed patterns of lights (Wan, Wong and Leung 2005, Fig. 9)",
        scenes=("insect", "teapot"),
        samplers=fixed_sets,
        budgets=lambda scale: (Budget(COUNT),),
        scale=without_interleaving(references_to(REFERENCE_NOISE)),
        quick_scenes=1,
        quick_maps=1,
        sections=(by_method, values_by_case, patterns),
        published=FIGURE9,
        figures=(
            PaperFigure("Fig. 7", "patterns of 300 lights", patterns_shown),
            PaperFigure("Fig. 9", "PSNR by 300 lights", order),
        ),
    )


def patterns_shown(run: Run) -> tuple[str, str]:
    """How many methods and maps there are pictures of."""
    methods, maps = run.rows["sampler"].nunique(), run.rows["environment"].nunique()
    return (
        f"shown: {counted(methods, 'method')} on {counted(maps, 'map')}",
        f"Each puts {COUNT} lights on a map, the first seed.",
    )


def order(run: Run) -> tuple[str, str]:
    """How many pairs of the paper's methods stand in its order, and their PSNR."""
    psnr = summary_of(run.at(run.budgets[0])).set_index("sampler")["psnr"]
    alike, of = FIGURE9.ordered_alike("psnr", psnr.to_dict())
    told = ", ".join(
        f"{label_of(name)} {psnr[name]:.1f} ({PRINTED[name]:.1f})"
        for name in PRINTED
        if name in psnr
    )
    return (
        f"{answer(alike, of)}: {alike} of {of} pairs ordered alike",
        f"PSNR in dB, in brackets the paper's of another scene and map: {told}.",
    )


def by_method(run: Run) -> Iterator[Part]:
    """PSNR by sampler over all cases, beside the paper's."""
    sets = run.record["scale"]["sets"]
    lit = "one set of lights for all pixels" if sets == 1 else f"{sets} interleaved sets of lights"
    for budget in run.budgets:
        rows = run.at(budget)
        table = summary_of(rows)
        yield Heading(f"PSNR at {budget}")
        yield Table(
            "psnr", table.assign(budget=budget), FORMATS, {"published": "published (dB)"},
            {"psnr": "more", "rank": "less"},
            f"PSNR in dB over {table['cases'].iloc[0]} pairs of scene and map, {lit}; `rank` is by "
            "PSNR within a pair. The last column is the paper's "
            f"({FIGURE9.source}; another scene and map).",
        )  # fmt: skip
        per_case = rows.groupby(["scene", "environment", "sampler"], as_index=False)["psnr"].mean()
        order = per_case.set_index("sampler").loc[list(table["sampler"])].reset_index()
        draw = partial(dot_plot, order, "psnr", "sampler", "PSNR in dB", PRINTED)
        yield Plot(f"psnr_{budget_in_file_name(budget)}", draw, f"PSNR by case at {budget}.")


def summary_of(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per sampler: PSNR over scenes and maps, and the mean rank by it; the best first."""
    case = ["scene", "environment"]
    values = rows.groupby([*case, "sampler"])["psnr"].mean().unstack("sampler")
    whole = values.dropna()
    table = pd.DataFrame(
        {
            "lights": rows.groupby("sampler")["lights"].mean(),
            "psnr": whole.mean(), "psnr_least": whole.min(), "psnr_most": whole.max(),
            "rank": whole.rank(axis=1, ascending=False).mean(),
            "cases": len(whole),
        }
    )  # fmt: skip
    table["published"] = table.index.map(PRINTED)
    return table.rename_axis("sampler").reset_index().sort_values("rank", kind="stable")


def patterns(run: Run) -> Iterator[Part]:
    """Where each sampler puts its lights, map by map; drawn while the run's images are there."""
    yield Heading("Patterns of lights")
    yield Text("The lights of the first seed, found anew; maps from files are not drawn.")
    present = (run.folder / "images").is_dir()
    for budget in run.budgets:
        rows = run.at(budget).groupby(["environment", "sampler"], sort=False)["count"].first()
        for environment, counts in rows.groupby("environment", sort=False):
            name = str(environment)
            tiles = _tiles(run, name, counts.droplevel("environment")) if present else []
            file = f"patterns_{name}_{budget_in_file_name(budget)}.webp"
            yield sheet(file, f"{name}, {budget}", tiles, 2)


def _tiles(run: Run, name: str, counts: pd.Series) -> list[tuple[str, Tile | None]]:
    if name not in places.names():
        return []
    source = EnvironmentSource(name, height=find_scale(run.record["scale"]["name"]).map_height)
    load = cache(source.load)
    labels = [label for label in run.samplers if label in counts]
    return [(label, partial(_pattern, label, load, int(counts[label]))) for label in labels]


def _pattern(label: str, load: Callable[[], EnvironmentMap], count: int) -> NDArray[np.uint8]:
    lighting = single_sampler(label).sampler.prepare(load(), count, np.random.default_rng(0))
    return draw_pattern(load(), lighting)


def values_by_case(run: Run) -> Iterator[Part]:
    """A line per budget, scene and map, a column per sampler."""
    case = ["budget", "scene", "environment"]
    values = run.rows.groupby([*case, "sampler"], sort=False)["psnr"].mean().unstack("sampler")
    samplers = [label for label in run.samplers if label in values]
    metric = find_metric("psnr")
    formats = dict.fromkeys(case, "s") | dict.fromkeys(samplers, f".{metric.digits}f")
    text = f"{metric.label} by case; means over seeds."
    rows = values[samplers].reset_index()
    yield Table("psnr_by_case", rows, formats, caption=text)


def fixed_sets() -> tuple[SamplerSpec, ...]:
    """All registered samplers that make one global set of lights, the same at all shading points.

    Others draw at each point, or choose their own number.
    """
    return tuple(spec for spec in all_samplers() if makes_fixed_set(spec))


def makes_fixed_set(spec: SamplerSpec) -> bool:
    """Whether a sampler makes one, by what it makes of a small map."""
    return isinstance(rehearse_lights(spec), DirectionalLights | LayeredLights)


def chosen_fixed_sets(texts: list[str], count: int) -> tuple[SamplerSpec, ...]:
    """The samplers that the texts name, all of `fixed_sets` without any, that can make so many.

    Raises EnvlightError for one that makes no fixed set.
    """
    specs = choose_samplers(texts) if texts else fixed_sets()
    other = next((spec.label for spec in specs if not makes_fixed_set(spec)), None)
    if other is not None:
        raise EnvlightError(
            f"sampler '{other}': it makes no fixed set of lights for a map; leave it out here"
        )
    return tuple(spec for spec in specs if count >= spec.sampler.minimum_count)
