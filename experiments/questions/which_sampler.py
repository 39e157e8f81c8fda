"""Which sampler for which map, and how many lights: error as a function of what a map shows.

Every method at 4 to 128 lights on many maps, with one seed each: maps, not seeds, are what errors
differ by, and whoever takes a method's lights takes those of one seed. What can be measured on the
map and on the scene stands in every row (`maps/features.py`, `run/scene_features.py`); rays and
seconds do, too. `envlight advice-table` gathers from such rows what `envlight advise` reads.

Meant for photographed maps, by --environments; the embedded ones are the default.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from experiments.maps.features import FEATURES
from experiments.maps.features import PREFIX as OF_MAP
from experiments.questions.advice.expected import SURE, Wish
from experiments.questions.advice.gathered import gathered, has_enough
from experiments.questions.advice.measured import Measured
from experiments.questions.advice.worth import RAYS, worth
from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sections.ranks import ranked
from experiments.report.summary import errors_in
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.loaded_run import Run
from experiments.run.scale import QUICK, Scale, references_to
from experiments.run.scene_features import FEATURES as SCENE_FEATURES
from experiments.run.scene_features import PREFIX as OF_SCENE
from metrics.registry import find_metric

QUICK_LIGHTS = (4, 16, 64)
LIGHTS = (4, 8, 16, 32, 64, 128)
REFERENCE_NOISE = {QUICK: 0.004, "medium": 0.005}
"""Of the mean luminance, by scale: a third of the least errors at 128 lights, or less."""


@experiment("which-sampler")
def which_sampler() -> GridExperiment:
    """Which sampler for which map, and how many lights."""
    return GridExperiment(
        title="Which sampler for which map",
        sections=(what_advice_is_worth, features_of_maps, features_of_scenes, ranked()),
        budgets=light_budgets,
        scale=references_to(REFERENCE_NOISE),
        seeds=1,
        quick_scenes=2,
        findings=findings,
    )


def light_budgets(scale: Scale) -> tuple[Budget, ...]:
    """Powers of two, at scale quick every second."""
    return tuple(Budget(count) for count in (QUICK_LIGHTS if scale.name == QUICK else LIGHTS))


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
    means = rows.groupby(place, sort=False)[["choice", "always", "random"]].agg(geometric_mean)
    means[["inside", "maps"]] = rows.groupby(place).agg({"inside": "mean", "maps": "max"})
    means = means.reset_index().assign(budget=ALL_BUDGETS, average="")
    whole = pd.concat([rows, means[list(REGRET)]], ignore_index=True)
    order = whole.groupby(place, sort=False).ngroup()
    whole = whole.iloc[order.argsort(kind="stable")].reset_index(drop=True)
    return Table("regret", whole, REGRET, HEADINGS)


def geometric_mean(values: pd.Series) -> float:
    return float(np.exp(np.log(values).mean()))


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
