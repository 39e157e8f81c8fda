"""Where each method puts its lights: the map's emissive region and the lights, side by side.

Reproduces Fig. 4 and 5 of Wu, "Efficient environment map rendering based on decomposition", 2025:
a picture per map, first its emissive (red) and non-emissive (blue) texels, then every method's
lights as circles, EnvIndirects and draws in colours of their own; and how the lights lie to the
emissive region. The paper prints no such numbers; what it says of its picture stands beside ours.

A row is a method's lights on a map at seed 0. Embedded maps at scale quick: one or two of every
kind. All samplers but ours-no-upsampling, whose lights are those of ours; --samplers chooses.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.maps.classes import representatives
from experiments.maps.sources import EnvironmentSource
from experiments.report.map_picture import Circle, draw_circles, draw_regions, halved
from experiments.report.parts import Items, Part, Picture, Table
from experiments.report.preview import contact_sheet
from experiments.run.budget import Budget
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Job, Row, Study, all_samplers, experiment
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import QUICK, find_scale
from experiments.run.study import study_environments
from experiments.run.trial import trial_lighting
from experiments.wu2025.light_statistics import CIRCLES, lights_row
from renderer.image import write_jpeg
from samplers import EnvlightError, SurfaceDistribution

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
        sources=("experiments.wu2025.light_statistics",),
        timed=False,
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map."""
    specs = choose_samplers(request.samplers) if request.samplers else _with_lights()
    counts = [Budget.parse(text).lights for text in request.budgets] or [COUNT]
    return [_group(source, specs, counts) for source in _sources(request)]


def _with_lights() -> tuple[SamplerSpec, ...]:
    """All methods but those that draw by a surface, which have no lights on a map."""
    own = (spec for spec in all_samplers() if spec.name != SAME_LIGHTS)
    return tuple(spec for spec in own if not isinstance(trial_lighting(spec), SurfaceDistribution))


def _sources(request: RunRequest) -> list[EnvironmentSource]:
    own = representatives(2) if request.scale == QUICK else []
    return study_environments(request, own, find_scale(request.scale).map_height)


def _group(source: EnvironmentSource, specs: Sequence[SamplerSpec], counts: Sequence[int]) -> Group:
    pairs = ((spec, count) for spec in specs for count in counts)
    work = {
        f"{spec.label} at {count}": (spec, count)
        for spec, count in pairs
        if count >= spec.sampler.minimum_count
    }
    jobs = {
        name: Job(
            {"environment": source.name, "sampler": spec.label, "count": count},
            {"map": environment_identity(source), "sampler": spec.identity},
        )
        for name, (spec, count) in work.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        environment = source.load()
        return {name: lights_row(environment, work[name][0].sampler, work[name][1])
                for name in names}  # fmt: skip

    return Group(source.name, jobs, measure)


def findings(run: Run) -> list[str]:
    """Who puts how much on the emissive region, by number of lights."""
    return [told for _, part in carried(run.rows).groupby("count") for told in _told(part)]


def _told(part: pd.DataFrame) -> tuple[str, ...]:
    """What is said of one number of lights."""
    return tuple(filter(None, (share_sentence(part), claim_sentence(part))))


def distribution(run: Run) -> Iterator[Part]:
    """How the lights lie to the emissive region: means over maps in words, and all rows."""
    rows = carried(run.rows)
    for _, part in rows.groupby("count"):
        yield Items(_told(part))
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


def share_sentence(rows: pd.DataFrame) -> str:
    """Whose lights carry most and least of the emissive energy, at one count."""
    table, count = means(rows), rows["count"].iloc[0]
    if table.empty:
        return f"At {count} lights no map has an emissive region."
    shares = 100.0 * table.set_index("sampler")["carried"]
    return (
        f"Of the emissive region's energy, lights on emissive texels carry at {count} lights most "
        f"with {shares.idxmax()}, {shares.max():.0f} %, and least with {shares.idxmin()}, "
        f"{shares.min():.0f} % (mean over {table['maps'].max()} maps)."
    )


def claim_sentence(rows: pd.DataFrame) -> str:
    """How often the paper's lights lie on the bright texels more than its rivals' do."""
    shares = rows.pivot_table(index="environment", columns="sampler", values="carried").dropna()
    rivals = [name for name in RIVALS if name in shares]
    if OURS not in shares or not rivals or shares.empty:
        return ""
    counts = [f"{name} on {(shares[OURS] > shares[name]).sum()}" for name in rivals]
    direct = rows.loc[rows["sampler"] == OURS, "direct_on_emissive"].mean()
    return (
        "Wu 2025 says of its Fig. 5, one map with median cut, variance minimization and TMMS, that "
        "its EnvDirects are on the bright pixels more than the others' lights. Here "
        f"{100.0 * direct:.0f} % of the EnvDirects' energy lies on emissive texels, and ours "
        f"carries more of the emissive energy than {', than '.join(counts)} of {len(shares)} maps."
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
        yield Picture(f"maps/{name}_lights={count}.jpg", f"{name}, {count} lights", draw)


def _draw(source: EnvironmentSource, rows: pd.DataFrame, path: Path) -> None:
    environment = source.load()
    shown = [(f"{source.name}: emissive red, other blue", halved(draw_regions(environment)))]
    for _, row in rows.iterrows():
        drawn = draw_circles(environment, [Circle(*values) for values in json.loads(row[CIRCLES])])
        share = f"{100.0 * row['energy_on_emissive']:.0f} % of energy on emissive"
        shown.append((f"{row['sampler']}: {row['lights']} lights, {share}", halved(drawn)))
    write_jpeg(path, contact_sheet(shown, 3))
