"""Where each method puts its lights: the map's emissive region and the lights, side by side.

Reproduces Fig. 4 and 5 of Wu 2025: a picture per map, first its emissive (red) and non-emissive
(blue) texels, then every method's lights as circles, EnvIndirects and draws in colours of their
own; and how the lights lie to the emissive region. The paper prints no such numbers; what it says
of its picture stands beside ours.

A row is a method's lights on a map at seed 0. Embedded maps at scale quick: one or two of every
kind. All samplers but ours-no-upsampling, whose lights are those of ours; --samplers chooses.
"""

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.classes import representatives
from experiments.maps.sources import EnvironmentSource
from experiments.report.map_picture import Circle, circles, draw_circles, draw_regions, halved
from experiments.report.parts import Items, Part, Picture, Table
from experiments.report.style import label_of
from experiments.run.budget import Budget
from experiments.run.case import environment_identity
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    all_samplers,
    answer,
    experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.rendering import rehearse_lights
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import QUICK, find_scale
from experiments.run.study import study_environments
from renderer.image import write_webp
from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    EnvlightError,
    LayeredLights,
    LightDistribution,
    Lighting,
    LightSampler,
    SurfaceDistribution,
)
from samplers.conformance.suite import parts_of
from samplers.decomposition.emissive import classify
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.preview import contact_sheet
from samplers.sphere import pixel_directions, pixel_of_direction

COUNT = 16
OURS, SAME_LIGHTS = "ours", "ours-no-upsampling"
RIVALS = ("median-cut", "variance-minimization", "tmms")
"""With which the paper compares its own in Fig. 5."""
FORMATS = {
    "environment": "s", "sampler": "s", "count": "d", "lights": "d", "direct": ".0f",
    "indirect": ".0f", "emissive_energy": ".3f", "carried": ".3f", "energy_on_emissive": ".3f",
    "direct_on_emissive": ".3f", "lights_on_emissive": ".3f", "emissive_degrees": ".2f",
    "emissive_degrees_far": ".2f", "sphere_degrees": ".1f", "least_degrees": ".2f",
}  # fmt: skip
MEANS = {
    "sampler": "s", "count": "d", "carried": ".3f", "direct_on_emissive": ".3f",
    "lights_on_emissive": ".3f", "emissive_degrees": ".2f", "maps": "d",
}  # fmt: skip


@experiment("light-distribution")
def light_distribution() -> Study:
    """Where each method puts its lights, and how they lie to the emissive region."""
    return Study(
        title="Lights and the emissive region (Wu 2025, Fig. 4 and 5)",
        sections=(distribution, pictures),
        groups=groups,
        sources=(__name__,),
        timed=False,
        figures=(
            PaperFigure("Fig. 4", "emissive and other texels", emissive_maps),
            PaperFigure("Fig. 5", "lights of four methods on a map", on_bright_texels),
        ),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map."""
    specs = choose_samplers(request.samplers) if request.samplers else _with_lights()
    counts = [Budget.parse(text).lights for text in request.budgets] or [COUNT]
    return [_group(source, specs, counts) for source in _sources(request)]


def _with_lights() -> tuple[SamplerSpec, ...]:
    """All methods but those that draw by a surface, which have no lights on a map."""
    own = (spec for spec in all_samplers() if spec.name != SAME_LIGHTS)
    return tuple(spec for spec in own if not isinstance(rehearse_lights(spec), SurfaceDistribution))


def _sources(request: RunRequest) -> list[EnvironmentSource]:
    own = representatives(2) if request.scale == QUICK else []
    return study_environments(request, own, find_scale(request.scale).map_height)


def _group(source: EnvironmentSource, specs: Sequence[SamplerSpec], counts: Sequence[int]) -> Group:
    depends = {"map": environment_identity(source)}
    asked = (
        ({"sampler": spec.label, "count": count}, {"sampler": spec.identity}, (spec.sampler, count))
        for spec in specs
        for count in counts
        if count >= spec.sampler.minimum_count
    )

    def measure(work: list[tuple[LightSampler, int]]) -> Iterator[Row]:
        environment = source.load()
        return (lights_row(environment, *one) for one in work)

    return Group(source.name, asked, measure, {"environment": source.name}, depends)


def distribution(run: Run) -> Iterator[Part]:
    """How the lights lie to the emissive region: means over maps in words, and all rows."""
    rows = carried(run.rows)
    said = (claim_sentence(part) for _, part in rows.groupby("count"))
    yield Items(tuple(filter(None, said)))
    yield Table(
        "light_distribution_means", means(rows), MEANS,
        caption="Means over the maps that have an emissive region, most carried first.",
    )  # fmt: skip
    yield Table(
        "light_distribution", rows.drop(columns=CIRCLES), FORMATS,
        caption="`emissive energy` is the emissive region's part of the map's energy, `energy on "
        "emissive` and `lights on emissive` the parts of the lights' energy and number that lie on "
        "it, `direct on emissive` that of the EnvDirects' energy. `carried` is `energy on "
        "emissive` over `emissive energy`: above 1 where lights on emissive texels stand for other "
        "texels too. `emissive degrees` (mean) and `emissive degrees far` (95 % quantile), both by "
        "energy, are the distances from emissive texels to the nearest light, `sphere degrees` the "
        "mean distance of any direction, `least degrees` the smallest between two lights. For "
        "distributions, as many draws as lights stand for them; their energy share is of 4096 "
        "draws.",
    )  # fmt: skip


def carried(rows: pd.DataFrame) -> pd.DataFrame:
    """With the share of the emissive energy that lights on emissive texels carry; else NaN."""
    emissive = rows["emissive_energy"]
    return rows.assign(carried=rows["energy_on_emissive"] / emissive.where(emissive > 0.0))


def means(rows: pd.DataFrame) -> pd.DataFrame:
    """Means by sampler and count over maps that have an emissive region, most carried first."""
    groups = rows[rows["carried"].notna()].groupby(["count", "sampler"])
    columns = [name for name in MEANS if name in rows and name not in ("count", "sampler")]
    table = groups[columns].mean().assign(maps=groups.size()).reset_index()
    return table.sort_values(["count", "carried"], ascending=[True, False], kind="stable")


def claim_sentence(rows: pd.DataFrame) -> str:
    """How often the paper's lights lie on the bright texels more than its rivals' do."""
    shares = rows.pivot_table(index="environment", columns="sampler", values="carried").dropna()
    rivals = [name for name in RIVALS if name in shares]
    if OURS not in shares or not rivals or shares.empty:
        return ""
    counts = [f"{label_of(name)} on {(shares[OURS] > shares[name]).sum()}" for name in rivals]
    direct = rows.loc[rows["sampler"] == OURS, "direct_on_emissive"].mean()
    return (
        "Wu 2025 says of its Fig. 5, one map with median cut, variance minimization and TMMS, that "
        "its EnvDirects are on the bright pixels more than the others' lights. Here "
        f"{100.0 * direct:.0f} % of the EnvDirects' energy lies on emissive texels, and "
        f"{label_of(OURS)} carries more of the emissive energy than "
        f"{', than '.join(counts)} of {len(shares)} maps."
    )


def emissive_maps(run: Run) -> tuple[str, str]:
    """How many maps have an emissive region, and how much of their energy it holds."""
    share = run.rows.groupby("environment")["emissive_energy"].first()
    lit = share[share > 0.0]
    return (
        f"shown: emissive on {len(lit)} of {len(share)} maps",
        f"There the region holds {lit.min():.0%} to {lit.max():.0%} of the map's energy.".replace(
            "%", " %"
        ),
    )


def on_bright_texels(run: Run) -> tuple[str, str]:
    """How often the paper's lights carry more of the emissive energy than a rival's."""
    rows = carried(run.rows)
    shares = rows.pivot_table(index="environment", columns="sampler", values="carried").dropna()
    more = [int((shares[OURS] > shares[name]).sum()) for name in RIVALS if name in shares]
    of = len(more) * len(shares)
    return (
        f"{answer(sum(more), of)}: more in {sum(more)} of {of}",
        claim_sentence(rows).partition("Here ")[2] or "Not all methods were run.",
    )


def pictures(run: Run) -> Iterator[Part]:
    """A picture per map and number of lights; drawn where the map is at hand."""
    sources: dict[str, EnvironmentSource] = {}
    with suppress(EnvlightError):
        request = RunRequest(**run.record["request"], output=None)
        sources = {source.name: source for source in _sources(request)}
    for (name, count), rows in run.rows.groupby(["environment", "count"], sort=False):
        source = sources.get(str(name))
        draw = partial(_draw, source, rows) if source else None
        yield Picture(f"maps/{name}_lights={count}.webp", f"{name}, {count} lights", draw)


def _draw(source: EnvironmentSource, rows: pd.DataFrame, path: Path) -> None:
    environment = source.load()
    shown = [(f"{source.name}: emissive red, other blue", halved(draw_regions(environment)))]
    for _, row in rows.iterrows():
        drawn = draw_circles(environment, [Circle(*values) for values in json.loads(row[CIRCLES])])
        share = f"{100.0 * row['energy_on_emissive']:.0f} % of energy on emissive"
        shown.append((f"{row['sampler']}: {row['lights']} lights, {share}", halved(drawn)))
    write_webp(path, contact_sheet(shown, 3))


DRAWS = 4096
FAR = 0.95
"""Quantile of the distances to the nearest light, by energy."""
CIRCLES = "circles"


def lights_row(environment: EnvironmentMap, sampler: LightSampler, count: int) -> dict[str, Any]:
    """The statistics of a sampler's lights at seed 0, and where they lie on a picture, as JSON."""
    lighting = sampler.prepare(environment, count, np.random.default_rng(0))
    drawn = [astuple(circle) for circle in circles(lighting)]
    return {**light_statistics(environment, lighting), CIRCLES: json.dumps(drawn)}


def light_statistics(environment: EnvironmentMap, lighting: Lighting) -> dict[str, Any]:
    """How many lights there are, and how they lie to the map's emissive region.

    lights, direct, indirect : numbers of lights; None where there are no such layers
    emissive_energy : the emissive region's part of the map's luminous energy
    energy_on_emissive : the part of the lights' energy whose lights lie on emissive texels
    direct_on_emissive : the same of the EnvDirects alone; None where there are none
    lights_on_emissive : the part of the lights that do
    emissive_degrees, emissive_degrees_far : mean and 95 % quantile, by energy, of the distance
        from an emissive texel to the nearest light; NaN without emissive texels
    sphere_degrees : the mean distance of any direction to the nearest light
    least_degrees : the smallest distance between two lights; NaN with fewer than two
    """
    direction, energy = _lights(lighting)
    emissive = classify(environment).emissive
    flux = environment.flux
    total = float(flux.sum(dtype=np.float64))
    on = emissive[pixel_of_direction(direction, environment.height)]
    sum_energy = float(energy.sum())
    layers = lighting if isinstance(lighting, LayeredLights) else None
    direct = slice(0, len(layers.direct) if layers else 0)
    sum_direct = float(energy[direct].sum())
    fixed = isinstance(lighting, (LayeredLights, DirectionalLights, DiscLights))
    near = direction if fixed else direction[: lighting.count]  # type: ignore[union-attr]
    return {
        "lights": len(near),
        "direct": len(layers.direct) if layers else None,
        "indirect": len(layers.indirect) if layers else None,
        "emissive_energy": float(flux[emissive].sum(dtype=np.float64)) / total if total else 0.0,
        "energy_on_emissive": float(energy[on].sum()) / sum_energy if sum_energy else 0.0,
        "direct_on_emissive": (
            float(energy[direct][on[direct]].sum()) / sum_direct if sum_direct else None
        ),
        "lights_on_emissive": float(on.mean()) if len(on) else 0.0,
        **_distances(environment, emissive, near),
        "least_degrees": _least(near),
    }


def _lights(lighting: Lighting) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions (n, 3) and luminous energy (n,); none of what sees the surface."""
    if isinstance(lighting, LightDistribution):
        drawn, pdf = lighting.sample(np.random.default_rng(0).random((DRAWS, 3), np.float32))
        direction = drawn[pdf > 0.0].astype(np.float64)
        return direction, np.full(len(direction), 1.0)
    parts = parts_of(lighting) or [(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))]
    directions, irradiances, _ = zip(*parts, strict=True)
    return np.concatenate(directions), np.concatenate(irradiances) @ LUMINANCE_WEIGHTS


def _distances(
    environment: EnvironmentMap, emissive: NDArray[np.bool_], lights: NDArray[np.float64]
) -> dict[str, float]:
    names = ("emissive_degrees", "emissive_degrees_far", "sphere_degrees")
    if not len(lights):
        return dict.fromkeys(names, math.nan)
    from scipy.spatial import cKDTree

    chord, _ = cKDTree(lights).query(pixel_directions(environment.height).reshape(-1, 3))
    angle = _degrees(chord).reshape(emissive.shape)
    solid_angle = np.broadcast_to(environment.row_solid_angle[:, None], emissive.shape)
    sphere = float(np.average(angle, weights=solid_angle))
    weight = environment.flux[emissive].astype(np.float64)
    if not weight.sum() > 0.0:
        return dict(zip(names, (math.nan, math.nan, sphere), strict=True))
    inside = angle[emissive]
    order = np.argsort(inside, kind="stable")
    running = np.cumsum(weight[order])
    far = inside[order][np.searchsorted(running, FAR * running[-1])]
    return dict(
        zip(names, (float(np.average(inside, weights=weight)), float(far), sphere), strict=True)
    )


def _least(lights: NDArray[np.float64]) -> float:
    if len(lights) < 2:
        return math.nan
    from scipy.spatial import cKDTree

    chord, _ = cKDTree(lights).query(lights, k=2)
    return float(_degrees(chord[:, 1]).min())


def _degrees(chord: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.degrees(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))
