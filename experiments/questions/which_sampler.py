"""Which sampler for which map, and how many lights: error as a function of what a map shows.

Every method at 4 to 128 lights on many maps, with one seed each: maps, not seeds, are what errors
differ by, and whoever takes a method's lights takes those of one seed. What can be measured on the
map and on the scene stands in every row (`maps/features.py`, `run/scene_features.py`); rays and
seconds do, too. `envlight advice-table` gathers from such rows what `envlight advise` reads.

Errors at so many rays or seconds are interpolated; of a map in several runs the last one's count.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from experiments.maps import places
from experiments.maps.classes import without_resolution
from experiments.maps.features import FEATURES
from experiments.maps.features import PREFIX as OF_MAP
from experiments.questions.advice.expected import RAYS, SURE, Array, Wish, worth
from experiments.questions.advice.measured import Measured
from experiments.questions.comparison import geometric
from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sections.ranks import ranked
from experiments.report.summary import (
    LEAGUE,
    errors_in,
    errors_per_map,
    floors_per_map,
    leagues_of,
    resolved,
)
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, budgets_of, experiment
from experiments.run.loaded_run import Run
from experiments.run.scale import QUICK, references_to
from experiments.run.scene_features import FEATURES as SCENE_FEATURES
from experiments.run.scene_features import PREFIX as OF_SCENE
from metrics.registry import find_metric, ranked_metrics
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import EnvlightError, make_sampler

LIGHTS = {QUICK: (4, 16, 64), "medium": (4, 8, 16, 32, 64, 128), "standard": (4, 8, 16, 32)}
REFERENCE_NOISE = {QUICK: 0.004, "medium": 0.005, "standard": 0.01}
"""Of the mean luminance, by scale: a third of the least errors at the most lights, or less."""


@experiment("which-sampler")
def which_sampler() -> GridExperiment:
    """Which sampler for which map, and how many lights."""
    return GridExperiment(
        title="Which sampler for which map",
        sections=(what_advice_is_worth, features_of_maps, features_of_scenes, ranked()),
        budgets=budgets_of(LIGHTS),
        scale=references_to(REFERENCE_NOISE),
        seeds=1,
        quick_scenes=2,
        findings=findings,
    )


REGRET = {
    "metric": "s", "league": "s", "budget": "s", "average": "s", "choice": ".3f", "always": ".3f",
    "random": ".3f", "inside": ".2f", "maps": "d",
}  # fmt: skip
HEADINGS = {
    "average": "best on average",
    "choice": "× by advice",
    "always": "× always the best",
    "random": "× any",
    "inside": f"in the {100 * SURE:.0f} % interval",
}
ALL_BUDGETS = "all"


def features_of_maps(run: Run) -> Iterator[Part]:
    """What can be measured on each map."""
    meanings = {name: f"{found.meaning} ({found.unit})" for name, found in FEATURES.items()}
    yield from _features(run, "environment", OF_MAP, "maps", meanings)


def features_of_scenes(run: Run) -> Iterator[Part]:
    """What can be measured on each scene, and how large errors are there."""
    yield from _features(run, "scene", OF_SCENE, "scenes", SCENE_FEATURES)
    errors = errors_in(run.rows)
    if run.rows["scene"].nunique() < 2:
        return
    place = [run.rows[name] for name in ("environment", "sampler", "budget", "seed")]
    ratios = {
        name: (run.rows[name] / run.rows[name].groupby(place).transform("mean"))
        .groupby(run.rows["scene"])
        .median()
        for name in errors
    }
    table = pd.DataFrame(ratios).reset_index()
    yield Text("Errors on each scene over their means over the scenes, the median of all:")
    headings = {name: find_metric(name).label for name in errors}
    formats = {"scene": "s", **dict.fromkeys(errors, ".2f")}
    yield Table("errors_by_scene", table, formats, headings)


def _features(
    run: Run, of: str, prefix: str, what: str, meanings: dict[str, str]
) -> Iterator[Part]:
    """A table of what rows tell; nothing where they are older than it."""
    columns = [prefix + name for name in meanings if prefix + name in run.rows]
    if not columns:
        return
    table: pd.DataFrame = run.rows.groupby(of)[columns].first().reset_index()
    table.columns = pd.Index([name.removeprefix(prefix) for name in table.columns])
    yield Heading(f"What the {what} are like")
    yield Table(f"features_of_{what}", table, {of: "s", **dict.fromkeys(table.columns[1:], ".3g")})
    yield Text("; ".join(f"`{name}`: {meaning}" for name, meaning in meanings.items()) + ".")


def what_advice_is_worth(run: Run) -> Iterator[Part]:
    """Regret on maps that were kept aside; nothing where there are too few maps."""
    if not has_enough(run.rows):
        return
    yield Heading("Which sampler, by what a map is like")
    yield Text(
        "What is expected of a sampler on a map is what was measured on the maps that are like it; "
        "each map is asked about with its own rows left out. Regret is the error of the chosen "
        "sampler over that of the best one on a map, in the geometric mean over maps: of the least "
        "expected error, of whoever is best on average over the other maps, and of any sampler."
    )
    yield regret_table(gathered([run]))


def findings(run: Run) -> Sequence[str]:
    """What advice is worth, in a sentence for each metric and league, for the results page."""
    return tuple(sentences(regret_table(gathered([run])))) if has_enough(run.rows) else ()


def regret_table(table: Measured) -> Table:
    """A line per metric, league and budget, and one for all budgets of these together."""
    lines = []
    for metric, label in table.labels.items():
        wishes = [Wish("lights", float(count), metric) for count in table.counts]
        wishes += [Wish("rays", amount, metric) for amount in RAYS]
        for wish in wishes:
            budget = f"{wish.kind}={wish.amount:g}"
            lines += [
                {"metric": label, "budget": budget, **vars(one)} for one in worth(table, wish)
            ]
    rows = pd.DataFrame(lines, columns=list(REGRET))
    place = ["metric", "league"]
    means = rows.groupby(place, sort=False)[["choice", "always", "random"]].agg(geometric)
    means[["inside", "maps"]] = rows.groupby(place).agg({"inside": "mean", "maps": "max"})
    means = means.reset_index().assign(budget=ALL_BUDGETS, average="")
    whole = pd.concat([rows, means[list(REGRET)]], ignore_index=True)
    order = whole.groupby(place, sort=False).ngroup()
    whole = whole.iloc[order.argsort(kind="stable")].reset_index(drop=True)
    return Table("regret", whole, REGRET, HEADINGS)


def sentences(table: Table) -> Iterator[str]:
    """The lines of all budgets, in words."""
    whole = table.rows[table.rows["budget"] == ALL_BUDGETS]
    for line in whole.to_dict("records"):
        yield (
            f"By {line['metric']}, league {line['league']}: on maps kept aside, whom advice "
            f"chooses errs {line['choice']:.3f} times as much as the best one there, always the "
            f"best on average {line['always']:.3f}, any {line['random']:.2f}; intervals for "
            f"{100 * SURE:.0f} % hold {100 * line['inside']:.0f} % of the errors."
        )


REFERENCE = "median-cut"
"""The sampler in whose seconds per ray a machine's speed is told."""
MAP, MAP_HEIGHT, SCENE, SIZE, COUNT, ROUNDS = "noon-desert", 64, "vase", (640, 480, 4), 16, 2
"""Of the images by it that tell this machine's speed; smaller ones take longer for each ray."""
LEAST_MAPS = 6
"""Fewer do not tell what an error depends on."""


def has_enough(rows: pd.DataFrame) -> bool:
    """Whether rows have features of maps, and enough maps and numbers of lights."""
    known = all(OF_MAP + name in rows for name in FEATURES)
    counts = sum(Budget.parse(text).kind == "lights" for text in rows["budget"].unique())
    return known and counts > 1 and rows["environment"].nunique() >= LEAST_MAPS


def gathered(runs: Sequence[Run]) -> Measured:
    """What runs have measured at numbers of lights.

    Raises EnvlightError where the rows have no features of maps, or too few maps or budgets.
    """
    rows = pd.concat([_at_lights(run) for run in runs], ignore_index=True)
    rows = rows[rows["run"] == rows.groupby("environment")["run"].transform("last")]
    columns = [OF_MAP + name for name in FEATURES]
    missing = [name for name in columns if name not in rows or rows[name].isna().any()]
    folders = ", ".join(str(run.folder) for run in runs)
    if missing:
        raise EnvlightError(
            f"{folders}: rows without features of the maps ({', '.join(missing)}); measure "
            "which-sampler anew"
        )
    maps, samplers, counts = (
        sorted(rows[name].unique()) for name in ("environment", "sampler", "allowed")
    )
    if len(maps) < LEAST_MAPS or len(counts) < 2:
        raise EnvlightError(
            f"{folders}: {len(maps)} maps were measured at {len(counts)} numbers of lights; advice "
            f"needs {LEAST_MAPS} maps at 2"
        )
    index = pd.MultiIndex.from_product([maps, samplers, counts])

    def cube(values: pd.Series) -> Array:
        found = values.groupby(level=["environment", "sampler", "allowed"]).mean()
        return found.reindex(index).to_numpy(np.float64).reshape(len(maps), len(samplers), -1)

    names = [metric.name for metric in ranked_metrics() if metric.name in rows]
    times = rows.groupby(["sampler", "allowed"])["seconds_lights"].median().unstack()
    traced = rows["seconds_render"] / (rows["rays"] * rows["rays_primary"])
    per_ray = traced.where(rows["rays"] > 0.0).groupby(rows["sampler"]).median().reindex(samplers)
    leagues = leagues_of(rows) if LEAGUE in rows else {}
    machines = [run.record["machine"] for run in runs]
    return Measured(
        tuple(map(str, maps)),
        tuple(map(str, samplers)),
        tuple(leagues.get(name, "") for name in samplers),
        tuple(map(int, counts)),
        rows.groupby("environment")[columns].first().loc[maps].to_numpy(np.float64),
        {name: find_metric(name).label for name in names},
        {name: cube(_ranked_errors(rows, name)) for name in names},
        cube(rows.groupby(["environment", "scene", "sampler", "allowed"])["rays"].mean()),
        times.reindex(index=samplers, columns=counts).to_numpy(np.float64),
        per_ray.to_numpy(np.float64),
        float(per_ray[REFERENCE if REFERENCE in samplers else samplers[0]]),
        {
            "runs": [run.folder.name for run in runs],
            "commits": list(dict.fromkeys(one for run in runs for one in run.commits)),
            "scenes": sorted(map(str, rows["scene"].unique())),
            "images": sorted(rows["size"].unique()),
            "one_scene": {name: _on_one_scene(rows, name) for name in names},
            "machine": machines[0].get("processor", ""),
        },
    )


def _at_lights(run: Run) -> pd.DataFrame:
    """The rows with budgets of lights, and how many those allow."""
    budgets = {text: Budget.parse(text) for text in run.rows["budget"].unique()}
    lights = {text: found.lights for text, found in budgets.items() if found.kind == "lights"}
    rows = run.rows[run.rows["budget"].isin(lights)]
    if rows.empty:
        raise EnvlightError(f"{run.folder}: it has no budgets of lights; measure which-sampler")
    scale = run.record.get("scale", {})
    return rows.assign(
        allowed=rows["budget"].map(lights),
        environment=rows["environment"].map(lambda name: without_resolution(str(name))),
        size=f"{scale.get('width')}×{scale.get('height')}",
        run=str(run.folder),
    )


def _ranked_errors(rows: pd.DataFrame, name: str) -> pd.Series:
    """Errors of maps as they are ranked, by map, number of lights and sampler; none that are 0."""
    metric = find_metric(name)
    tables = {
        allowed: resolved(errors_per_map(part, name), floors_per_map(part, metric).fillna(0.0))
        for allowed, part in rows.groupby("allowed")
    }
    whole = pd.concat(tables, names=["allowed"]).melt(ignore_index=False, var_name="sampler")
    errors: pd.Series = whole.set_index("sampler", append=True)["value"]
    return errors[errors > 0.0]


def _on_one_scene(rows: pd.DataFrame, name: str) -> list[float]:
    """Quantiles of errors on one scene over their means over the scenes of a map."""
    case = ["environment", "sampler", "allowed"]
    errors = rows.groupby([*case, "scene"])[name].mean()
    ratio = (errors / errors.groupby(case).transform("mean")).dropna()
    outside = 0.5 * (1.0 - SURE)
    return [round(float(ratio.quantile(part)), 3) for part in (outside, 1.0 - outside)]


def speed_here(table: Measured) -> float:
    """Seconds for a ray on this machine over those on the table's."""
    return probe() / table.machine_seconds


def probe() -> float:
    """Seconds for a ray: the least over a few images, since whatever else runs only adds,
    after one that is thrown away.
    """
    environment = places.make(MAP, MAP_HEIGHT)
    lighting = make_sampler(REFERENCE).prepare(environment, COUNT, np.random.default_rng(0))
    view = make_view(load_scene(SCENE), *SIZE)
    shots = [render(view, lighting, environment) for _ in range(ROUNDS + 1)][1:]
    return min(shot.seconds / shot.rays.traced for shot in shots)
