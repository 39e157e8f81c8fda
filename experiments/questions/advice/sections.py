"""The report of `which-sampler`: what maps and scenes are like, and what the model makes of it."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import pandas as pd

from experiments.maps.features import FEATURES
from experiments.maps.features import PREFIX as OF_MAP
from experiments.questions.advice import plots
from experiments.questions.advice.judged import REGRET, REGRET_HEADINGS, coverage, median_factor
from experiments.questions.advice.measured import LEAST_MAPS
from experiments.questions.advice.model import SURE, Model
from experiments.questions.advice.train import Trained, trained_on
from experiments.report.parts import Heading, Items, Part, Plot, Table, Text
from experiments.report.style import looks
from experiments.report.summary import errors_in
from experiments.run.loaded_run import Run
from experiments.run.scene_features import FEATURES as SCENE_FEATURES
from experiments.run.scene_features import PREFIX as OF_SCENE
from metrics.registry import find_metric

JUDGED = {**REGRET, "taken": "s", "maps": "d"}
JUDGED_HEADINGS = {**REGRET_HEADINGS, "choice": "× by features"}
SHOWN_BUDGETS = ("lights=8", "lights=16", "lights=32", "rays=4", "rays=16")


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


def what_the_model_says(run: Run) -> Iterator[Part]:
    """The model that these rows give, and what it is worth on maps that it has not seen."""
    if not has_enough(run):
        return
    trained = trained_on([run])
    model = trained.model
    yield Heading("Which sampler, by what a map is like")
    yield Text(
        "ln error of a sampler is its mean over maps at that count, and what the features, their "
        "squares and their products with the count change of it (ridge regression): of all "
        "samplers together, and of what each has beside that. Each map is predicted from all "
        "others. Regret is the error of the chosen sampler over that of the best one on a map, in "
        "the geometric mean over maps: of the least predicted error, of whoever is best on average "
        "over the other maps, and of any sampler."
    )
    yield Items(tuple(sentences(model)))
    yield from judged_tables(trained)
    styles = looks(list(model.samplers))
    for metric in model.errors:
        label = model.labels[metric]
        yield Plot(
            f"model_{metric}", partial(plots.coefficients, model, metric),
            f"{label}: by which factor an error grows with a feature, from one standard deviation "
            "below the mean of the maps to one above it, at the middle count.",
        )  # fmt: skip
        yield Plot(
            f"predicted_{metric}", partial(plots.predicted_and_measured, model, metric, styles),
            f"{label} of every map as predicted from the others, and as measured, with "
            f"{model.counts[len(model.counts) // 2]} lights or samples.",
        )  # fmt: skip
        yield Plot(
            f"winners_{metric}", partial(plots.winners, model, metric, styles),
            f"{label}: which set of lights wins where, in the plane of the two features that "
            "decide the most between them; a dot is a map, the ground is whom the model would "
            "choose.",
        )  # fmt: skip


def has_enough(run: Run) -> bool:
    """Whether a model can be made of the rows."""
    known = all(f"{OF_MAP}{name}" in run.rows for name in FEATURES)
    return known and run.rows["environment"].nunique() >= LEAST_MAPS


def findings(run: Run) -> Sequence[str]:
    """What a model of the rows is worth, for the page of all published runs."""
    return tuple(sentences(trained_on([run]).model)) if has_enough(run) else ()


def sentences(model: Model) -> Iterator[str]:
    """What the model is worth, in words."""
    for metric in model.errors:
        label, inside = model.labels[metric], coverage(model, metric)
        yield (
            f"By {label}, half of the predicted errors are off by less than a factor of "
            f"{median_factor(model, metric):.2f}; {100.0 * float(np.nanmean(inside)):.0f} % of the "
            f"errors lie in intervals that are meant for {100.0 * SURE:.0f} %."
        )
        for league in dict.fromkeys(one.league for one in model.verdicts):
            judged = [one for one in model.verdicts if (one.metric, one.league) == (metric, league)]
            worth = [f"{one.kind}={one.amount:g}" for one in judged if one.better]
            yield (
                f"By {label}, league {league}: choosing by features is better than always the best "
                f"on average at {len(worth)} of {len(judged)} budgets"
                f"{f' ({chr(44).join(worth)})' if worth else ''}."
            )


def judged_tables(trained: Trained) -> list[Table]:
    """What choosing is worth, how far predictions are off, and which terms were tried."""
    model = trained.model
    rows = pd.DataFrame(
        [
            {
                "metric": model.labels[one.metric], "league": one.league,
                "budget": f"{one.kind}={one.amount:g}", "average": one.average,
                "choice": one.choice, "always": one.always, "random": one.random,
                "taken": "by features" if one.better else "the best on average",
                "maps": one.maps,
            }
            for one in model.verdicts
        ],
        columns=list(JUDGED),
    )  # fmt: skip
    shown = rows[rows["budget"].isin(SHOWN_BUDGETS)]
    return [
        Table("regret", shown, JUDGED, JUDGED_HEADINGS),
        Table("regret_at_all_budgets", rows, JUDGED, JUDGED_HEADINGS, shown=False),
        _errors_table(model),
        _trials_table(trained),
        _coefficients_table(model),
    ]


def _errors_table(model: Model) -> Table:
    rows = []
    for metric in model.errors:
        inside, off = coverage(model, metric), np.abs(model.residuals[metric])
        for k, sampler in enumerate(model.samplers):
            if not np.isfinite(off[:, k]).any():
                continue
            rows.append(
                {
                    "metric": model.labels[metric], "sampler": sampler,
                    "factor": float(np.exp(np.nanmedian(off[:, k]))),
                    "coverage": float(np.nanmean(inside[k])),
                }
            )  # fmt: skip
    formats = {"metric": "s", "sampler": "s", "factor": ".2f", "coverage": ".2f"}
    headings = {"factor": "median factor off", "coverage": f"in the {100 * SURE:.0f} % interval"}
    return Table("predictions", pd.DataFrame(rows, columns=list(formats)), formats, headings)


def _trials_table(trained: Trained) -> Table:
    rows = pd.DataFrame([vars(one) for one in trained.trials])
    best = rows.loc[rows.groupby(["of", "part", "terms"], sort=False)["error"].idxmin()]
    formats = {"of": "s", "part": "s", "terms": "s", "ridge": "g", "error": ".3f"}
    headings = {"error": "rms of ln off"}
    return Table("terms", best[list(formats)].reset_index(drop=True), formats, headings)


def _coefficients_table(model: Model) -> Table:
    """The model, printed: means of ln error, and coefficients by each feature's spread."""
    rows = []
    for metric, found in model.errors.items():
        names = plots.term_names()
        for k, sampler in enumerate(model.samplers):
            means = {f"mean at {count}": found.mean[k, c] for c, count in enumerate(model.counts)}
            values = dict(zip(names, found.coefficient[k], strict=True))
            rows.append({"metric": metric, "sampler": sampler, **means, **values})
    table = pd.DataFrame(rows)
    return Table("model", table, dict.fromkeys(map(str, table), ""), shown=False)
