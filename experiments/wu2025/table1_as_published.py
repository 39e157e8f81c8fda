"""Table 1 under the conditions of its own paper, and what changes it from there to today.

Wu 2025 gives every method the same time in pbrt-v3, whose rays cost so much that time is rays.
Here every method has the rays that median cut traces with eight lights, about what four seconds
allowed, and is run as the paper probably ran it (`AS_PUBLISHED`). What stands beside a method in
`VARIANTS` shows what its difference from the paper rests on. The last tables go from the paper's
conditions to today's, one change at a time: the default reading of each method, time in this
renderer instead of rays, images of another size, each scene alone.

Figures are those that the paper prints: means over maps and scenes, as multiples of median cut's,
with the 95 % interval of a bootstrap over maps.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.report.parts import Heading, Items, Part, Table, Text, counted, listed
from experiments.report.sections.ranks import order_agreement
from experiments.report.style import label_of
from experiments.report.suite import together
from experiments.report.summary import compared, errors_per_map, interval, overspent
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, PaperFigure, Row, experiment
from experiments.run.loaded_run import RECORD, Run, read_record
from experiments.run.sampler_spec import SamplerSpec, single_sampler
from experiments.run.scale import Scale
from experiments.wu2025.published import TABLE1
from metrics.ranking import mean_ranks, middle, resampled
from metrics.registry import find_metric
from samplers import EnvlightError

NAME = "table1-as-published"
FULL, WITHOUT, MEASURE = "ours", "ours-no-upsampling", "median-cut"
RAYS, TIME = f"rays={MEASURE}:8", f"time={MEASURE}:8"
SHARED, BETWEEN = f"lights={FULL}@{RAYS}", f"rays={MEASURE}:12"
ROUNDED = f"{MEASURE}[order=rounds]", "lights=12"
"""Eight lights where there would be time for twelve: its rounds double them."""
METRICS = ("rmse", "flip")
STEPS = "as published, then each method by its default, then in median cut's time, not its rays."
MOST_TOLD = 3
"""Methods of least error that a sentence names."""
NEAR = 0.1
"""A ratio this near to the paper's, as a share of it, is said to agree."""
ORDER = 0.75
"""Least correlation of an order that is said to be the paper's."""


@dataclass(frozen=True)
class Entry:
    """A method as it was run: label and budget, in words, and those of the median cut beside it."""

    label: str
    budget: str = RAYS
    words: str = ""
    beside: tuple[str, str] = (MEASURE, RAYS)


AS_PUBLISHED = {name: Entry(name) for name in TABLE1.values} | {
    "mis": Entry("mis[numbers=independent]"),
    "fhis": Entry("fhis[light=point]"),
    "tmms": Entry("tmms[useful_solid_angle=0.01, widest=None]"),
}
UNROUNDED = "at the rays of 12 lights, which median cut rounds down to 8"
VARIANTS = {
    "mis": (Entry("mis", RAYS, "with low-discrepancy numbers"),),
    "fhis": (
        Entry("fhis", RAYS, "with lights at the centroids of cells"),
        Entry("fhis[sets=shifted]", RAYS, "with eight tilings besides"),
    ),
    "variance-minimization": (
        Entry("variance-minimization[light_extent=full]", RAYS, "perturbed by the full angle"),
        Entry("variance-minimization[light_extent=mean]", RAYS, "perturbed by the mean angle"),
    ),
    "tmms": (Entry("tmms", RAYS, "with all solid angle counted and no wide regions"),),
    WITHOUT: (
        Entry(WITHOUT, SHARED, "with the lights of the whole method"),
        Entry(WITHOUT, BETWEEN, UNROUNDED, ROUNDED),
    ),
    FULL: (
        Entry(f"{FULL}[upsampling=2]", RAYS, "upsampled by 2"),
        Entry(FULL, BETWEEN, UNROUNDED, ROUNDED),
    ),
}
"""What else a method might have been, one change at a time."""


@experiment(NAME)
def table1_as_published() -> GridExperiment:
    """Table 1 at equal rays, each method as its paper ran it, and what changes it from there."""
    return GridExperiment(
        title="Table 1 as published",
        sections=(of_each_size, steps),
        opening=opening,
        samplers=published_samplers,
        budgets=lambda scale: (Budget.parse(RAYS),),
        also=others,
        seeds=1,
        findings=found_here,
        figures=(PaperFigure("Table 1", "mean errors and ranks in equal time", in_short),),
    )


def _variants() -> list[Entry]:
    return [one for ones in VARIANTS.values() for one in ones]


def published_samplers() -> tuple[SamplerSpec, ...]:
    """Every method as published, and what else has the same rays."""
    labels = (one.label for one in [*AS_PUBLISHED.values(), *_variants()] if one.budget == RAYS)
    return tuple(map(single_sampler, dict.fromkeys(labels)))


def others(scale: Scale) -> tuple[tuple[SamplerSpec, Budget], ...]:
    """Variants at other budgets with the median cut beside them, and the defaults at equal time."""
    variants = [one for one in _variants() if one.budget != RAYS]
    pairs = [(one.label, one.budget) for one in variants]
    pairs += [one.beside for one in variants if one.beside == ROUNDED]
    pairs += [(name, TIME) for name in TABLE1.values]
    return tuple((single_sampler(label), Budget.parse(b)) for label, b in dict.fromkeys(pairs))


class Ratio(NamedTuple):
    """A method's mean error over median cut's, with the interval of a bootstrap over maps."""

    value: float
    low: float
    high: float


def errors(run: Run, metric: str, label: str, budget: str) -> pd.Series:
    """A method's error on each case of scene and map, the mean over seeds."""
    rows = run.rows[(run.rows["sampler"] == label) & (run.rows["budget"] == budget)]
    return rows.groupby(["scene", "environment"])[metric].mean()


def ratio(run: Run, metric: str, one: Entry) -> Ratio | None:
    """The method's mean over that of the median cut beside it; None where neither is there."""
    pair = pd.concat(
        [errors(run, metric, one.label, one.budget), errors(run, metric, *one.beside)],
        axis=1,
        join="inner",
    )
    if pair.empty:
        return None
    per_map = pair.groupby(level="environment").sum().to_numpy(np.float64)
    drawn = resampled(per_map)
    low, high = middle(drawn[:, 0] / drawn[:, 1])
    above, below = per_map.sum(axis=0)
    return Ratio(float(above / below), float(low), float(high))


def printed(name: str, metric: str) -> float:
    """The paper's ratio of a method's mean error to median cut's."""
    return TABLE1.values[name][metric][0] / TABLE1.values[MEASURE][metric][0]


def per_map(run: Run, metric: str) -> pd.DataFrame:
    """Errors as published (maps × methods of the paper), means over scenes."""
    found = {name: errors(run, metric, one.label, one.budget) for name, one in AS_PUBLISHED.items()}
    return pd.DataFrame(found).dropna().groupby(level="environment").mean()


def _means(run: Run) -> pd.DataFrame:
    """Mean errors as published (metrics × methods)."""
    return pd.DataFrame({metric: per_map(run, metric).mean() for metric in METRICS}).T


def agreements(run: Run) -> dict[str, float]:
    """Spearman's correlation with the paper's order by metric."""
    return {metric: order_agreement(per_map(run, metric), TABLE1, metric) for metric in METRICS}


def findings(run: Run) -> Sequence[str]:
    """What the paper claims, what comes out under its conditions, and what in equal time here."""
    if not all(len(per_map(run, metric)) for metric in METRICS):
        return [f"The run has not all {len(AS_PUBLISHED)} methods on any map; give --samplers '*'."]
    return [claim(), under_its_conditions(run), *in_equal_time(run)]


def found_here(run: Run) -> Sequence[str]:
    """The findings without the paper's own claim."""
    told = findings(run)
    return told[1:] or told


def claim() -> str:
    """The paper's own figures."""
    figures = (f"{printed(FULL, metric):.2f} times the {_label(metric)}" for metric in METRICS)
    errors = {name: {m: one[m][0] for m in METRICS} for name, one in TABLE1.values.items()}
    return (
        f"{TABLE1.paper} gives every method the same time: {label_of(FULL)} has "
        f"{' and '.join(figures)} of {label_of(MEASURE)}. {_first_sentence(pd.DataFrame(errors))}"
    )


def under_its_conditions(run: Run) -> str:
    """A verdict; ratios and order at equal rays, each method as its paper ran it."""
    found = [
        (here, printed(name, metric))
        for metric in METRICS
        for name, one in AS_PUBLISHED.items()
        if name != MEASURE and (here := ratio(run, metric, one)) is not None
    ]
    near = sum(_agrees(here, paper) for here, paper in found)
    order = " and ".join(f"{value:.2f} by {_label(m)}" for m, value in agreements(run).items())
    means = _means(run)
    maps, scenes = run.rows["environment"].nunique(), run.rows["scene"].nunique()
    return (
        f"{_verdict(run, means)}. Under its conditions, the rays of median cut with 8 lights and "
        f"each method as its paper ran it ({counted(maps, 'map')}, {counted(scenes, 'scene')}, "
        f"{run.image_size}): {_ours(run, AS_PUBLISHED[FULL])}. {_first_sentence(means)} "
        f"Of {len(found)} ratios to median cut, {near} have the paper's in their 95 % interval or "
        f"within {100 * NEAR:.0f} % of it; Spearman's correlation with its order is {order}."
    )


def _verdict(run: Run, means: pd.DataFrame) -> str:
    """Yes where ours is first by both metrics, its ratios to median cut are the paper's, and so is
    the order of all by `ORDER`; in part where ours is first. means : (metrics × methods)
    """
    if set(means.idxmin(axis="columns")) != {FULL}:
        return "No"
    ours = {metric: ratio(run, metric, AS_PUBLISHED[FULL]) for metric in METRICS}
    alike = all(one and _agrees(one, printed(FULL, metric)) for metric, one in ours.items())
    return "Yes" if alike and min(agreements(run).values()) >= ORDER else "In part"


def in_short(run: Run) -> tuple[str, str]:
    """The verdict in a few words, and ours over median cut."""
    means = _means(run)
    if means.dropna().empty:
        return "no: methods are missing", "The run has not all methods on any map."
    first = " and ".join(dict.fromkeys(map(label_of, means.idxmin(axis="columns"))))
    paper = " and ".join(f"{printed(FULL, metric):.2f}" for metric in METRICS)
    return (
        f"{_verdict(run, means).lower()}: {first} first of {means.shape[1]}",
        f"{_ours(run, AS_PUBLISHED[FULL])}; the paper's are {paper}.",
    )


def in_equal_time(run: Run) -> Iterator[str]:
    """In equal time, each method by its default: ours over median cut, and the methods of least
    mean error as multiples of median cut's.
    """
    run = _timed_run(run)
    rows = compared(run.at(TIME))
    rows = rows[~rows["sampler"].isin(overspent(rows))]
    if not {FULL, MEASURE} <= set(rows["sampler"]):
        return
    least = []
    for metric in METRICS:
        means = errors_per_map(rows, metric).mean().sort_values()
        times = means.drop(MEASURE, errors="ignore").head(MOST_TOLD) / means[MEASURE]
        told = listed([f"{label_of(name)} {value:.2f}" for name, value in times.items()])
        least.append(f"least {_label(metric)} {told}")
    maps, scenes = rows["environment"].nunique(), rows["scene"].nunique()
    yield (
        f"In the time of median cut with 8 lights, {rows['sampler'].nunique()} methods by their "
        f"defaults ({counted(maps, 'map')}, {counted(scenes, 'scene')}, {run.image_size}): "
        f"{_ours(run, _timed(FULL))}; as multiples of its error, {'; '.join(least)}."
    )


def _ours(run: Run, one: Entry) -> str:
    """Ours beside median cut, by both metrics."""
    found = ((metric, ratio(run, metric, one)) for metric in METRICS)
    told = (f"{interval(*here)} times the {_label(m)}" for m, here in found if here is not None)
    return f"{label_of(FULL)} has {' and '.join(told)} of {label_of(MEASURE)}"


def _first_sentence(means: pd.DataFrame) -> str:
    """Who has the least mean error. means : (metrics × methods)"""
    first = means.idxmin(axis="columns").map(str).map(label_of)
    told = [f"{first[metric]} is first by {_label(metric)}" for metric in METRICS]
    if first.nunique() == 1:
        told = [f"{first.iloc[0]} is first of {means.shape[1]} by both"]
    return f"{' and '.join(told)}."


def _label(metric: str) -> str:
    return find_metric(metric).label


def _agrees(here: Ratio, paper: float) -> bool:
    return here.low <= paper <= here.high or abs(here.value / paper - 1.0) <= NEAR


def opening(run: Run) -> Iterator[Part]:
    """What the page of all runs says first."""
    yield Heading(f"Is {TABLE1.paper} reproduced?")
    yield from map(Text, findings(run))
    tables = [part for part in steps(run) if isinstance(part, Table)]
    rows, formats, headings = pd.DataFrame({"method": AS_PUBLISHED.keys()}), {"method": "s"}, {}
    for metric, table in zip(METRICS, tables, strict=True):
        for column in table.rows.columns.drop(["metric", "method"]):
            rows[f"{metric} {column}"] = table.rows[column]
            formats[f"{metric} {column}"] = ".2f"
            headings[f"{metric} {column}"] = f"{_label(metric)}, {column}"
    yield Table("opening", rows, formats, headings, caption=f"Errors over median cut's: {STEPS}")


def of_each_size(run: Run) -> Iterator[Part]:
    """What a run and those inside it say, each by itself; tables have their size of images.

    A report begins with the verdict of its own run.
    """
    for one in together(run):
        told = found_here(one)
        told = [claim(), *told[1:]] if one is run else told
        for part in (Items(tuple(told)), *beside_paper(one), *differences(one), *by_scene(one)):
            if isinstance(part, Table):
                rows = part.rows.assign(images=one.image_size)
                part = replace(part, rows=rows, caption=f"{one.image_size}: {part.caption}")
            yield part


def beside_paper(run: Run) -> Iterator[Part]:
    """Ratios, mean errors and mean ranks of the seven methods, the paper's beside them."""
    rows = pd.DataFrame({"method": AS_PUBLISHED.keys()})
    rows["run as"] = [one.label for one in AS_PUBLISHED.values()]
    formats = {"method": "s", "run as": "s"}
    headings: dict[str, str] = {}
    for space, metric in enumerate(METRICS):
        table, label, pad = per_map(run, metric), _label(metric), " " * space
        rows[f"{metric}_paper"] = [printed(name, metric) for name in AS_PUBLISHED]
        here = [ratio(run, metric, one) for one in AS_PUBLISHED.values()]
        rows[metric] = ["–" if one is None else interval(*one) for one in here]
        rows[f"{metric}_mean"] = table.mean().reindex(rows["method"]).to_numpy()
        ranks = pd.Series(mean_ranks(table) if len(table) else np.nan, table.columns)
        rows[f"{metric}_rank_paper"] = [TABLE1.values[name][metric][1] for name in AS_PUBLISHED]
        rows[f"{metric}_rank"] = ranks.reindex(rows["method"]).to_numpy()
        formats |= {
            f"{metric}_paper": ".2f", metric: "s", f"{metric}_mean": ".4f",
            f"{metric}_rank_paper": ".2f", f"{metric}_rank": ".2f",
        }  # fmt: skip
        headings |= {
            f"{metric}_paper": f"{label} × median cut, paper", metric: f"{label}, here",
            f"{metric}_mean": f"mean{pad}", f"{metric}_rank_paper": f"rank, paper{pad}",
            f"{metric}_rank": f"rank{pad}",
        }  # fmt: skip
    yield Table("as_published", rows, formats, headings, caption=f"{TABLE1.paper}, and here.")


def differences(run: Run) -> Iterator[Part]:
    """What a method's difference from the paper rests on, one change at a time."""
    lines = []
    for name in (one for one in AS_PUBLISHED if one != MEASURE):
        for one in (AS_PUBLISHED[name], *VARIANTS.get(name, ())):
            line: Row = {"method": name, "run": one.words or "as published"}
            for metric in METRICS:
                line[f"{metric}_paper"] = printed(name, metric)
                line[metric] = _value(ratio(run, metric, one))
            lines.append(line)
    headings = {metric: _label(metric) for metric in METRICS}
    headings |= {f"{metric}_paper": f"{_label(metric)}, paper" for metric in METRICS}
    formats = {"method": "s", "run": "s", **dict.fromkeys(list(lines[0])[2:], ".2f")}
    yield Heading("What differs")
    caption = "Mean errors over median cut's."
    yield Table("variants", pd.DataFrame(lines), formats, headings, caption=caption)


def steps(run: Run) -> Iterator[Part]:
    """From the paper's conditions to today's, one change at a time."""
    yield Heading("From there to here")
    entries = list(AS_PUBLISHED.values())
    taken = [(f"as published, {one.image_size}", one, entries) for one in (*together(run)[1:], run)]
    taken += [
        ("default readings", run, [Entry(name) for name in AS_PUBLISHED]),
        ("equal time", _timed_run(run), [_timed(name) for name in AS_PUBLISHED]),
    ]
    for metric in METRICS:
        columns = {"paper": [printed(name, metric) for name in AS_PUBLISHED]}
        for name, of, ones in taken:
            columns[name] = [_value(ratio(of, metric, one)) for one in ones]
        rows = pd.DataFrame({"metric": metric, "method": AS_PUBLISHED.keys(), **columns})
        yield Table(
            "steps", rows, {"method": "s", **dict.fromkeys(columns, ".2f")},
            caption=f"{_label(metric)} over median cut's: {STEPS}",
        )  # fmt: skip


def _timed_run(run: Run) -> Run:
    """The run of Table 1 in a folder beside this one's that has more methods in equal time."""
    found = [run]
    for place in sorted(one.parent for one in run.folder.parent.glob(f"table1*/{RECORD}")):
        facts = read_record(place)
        if facts.get("experiment") == "table1" and TIME in facts["budgets"]:
            with suppress(EnvlightError):  # not finished
                found.append(Run.load(place))
    alike = (one for one in found if one.image_size == run.image_size)
    return max(alike, key=lambda one: one.at(TIME)["sampler"].nunique())


def _timed(name: str) -> Entry:
    return Entry(name, TIME, beside=(MEASURE, TIME))


def by_scene(run: Run) -> Iterator[Part]:
    """Ratios as published on each scene alone."""
    scenes = list(dict.fromkeys(run.rows["scene"]))
    if len(scenes) < 2:
        return
    for metric in METRICS:
        rows = pd.DataFrame({"metric": metric, "method": AS_PUBLISHED.keys()})
        for scene in scenes:
            part = Run(run.folder, run.rows[run.rows["scene"] == scene], run.record)
            found = (ratio(part, metric, one) for one in AS_PUBLISHED.values())
            rows[scene] = [_value(one) for one in found]
        yield Table(
            "by_scene", rows, {"method": "s", **dict.fromkeys(scenes, ".2f")},
            caption=f"{_label(metric)} over median cut's as published, on each scene alone.",
        )  # fmt: skip


def _value(found: Ratio | None) -> float:
    return float("nan") if found is None else found.value
