"""What does my renderer's table cost me? The tables of today's renderers at equal work.

pbrt-v4, Mitsuba 3, Cycles, Falcor and LuxCore draw directions towards a map by a table each, all
beside BRDF sampling; they differ in its size, in what weighs a texel, and in whether what BRDF
sampling covers is taken off. Each renders as it ships and with compensation the other way, beside
the exact table of `mis` and `mis-compensated`: at equal numbers of samples, of rays and, but at
scale quick, of seconds. What the tables take to build and to hold is told by `renderer-tables`.
"""

from collections.abc import Iterator
from dataclasses import fields

import pandas as pd

from experiments.questions.readings.comparison import compare, comparisons, verdict
from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.sections.ranks import ranked
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import QUICK, Scale
from experiments.wu2025.published import seconds_budget
from metrics.registry import NEAR, ranked_metrics
from samplers import sampler_class, sampler_names

EXACT = "mis"
"""What every table is compared with."""
RENDERERS = ("pbrt-v4", "mitsuba-3", "cycles", "falcor", "luxcore")
SWITCH = "compensation"
SAMPLES, RAYS = (8, 32), 16
COST_FORMATS = {"sampler": "s", "error": ".4f", "ratio": "s", "wins": "s"}


@experiment("renderers")
def renderers() -> GridExperiment:
    """What the tables of today's renderers cost in error, at equal samples, rays and time."""
    return GridExperiment(
        title="Tables of today's renderers",
        sections=(beside_exact, with_and_without, ranked()),
        samplers=table_samplers,
        budgets=equal_work,
        quick_scenes=2,
        quick_maps=1,
    )


def equal_work(scale: Scale) -> tuple[Budget, ...]:
    """Samples and rays, and the paper's seconds per pixel where there is time for them."""
    free = (*map(Budget, SAMPLES), Budget(RAYS, "rays"))
    return free if scale.name == QUICK else (*free, *seconds_budget(scale))


def table_samplers() -> tuple[SamplerSpec, ...]:
    """The exact tables, then each renderer's as it ships and with compensation the other way."""
    known = sampler_names()
    exact = [name for name in (EXACT, "mis-compensated") if name in known]
    found = [SamplerSpec(name) for name in exact]
    for name in (name for name in RENDERERS if name in known):
        ships = next(f.default for f in fields(sampler_class(name)) if f.name == SWITCH)
        found += [SamplerSpec(name), SamplerSpec(name, ((SWITCH, not ships),))]
    return tuple(found)


def beside_exact(run: Run) -> Iterator[Part]:
    """Errors and their ratios to those of the exact table, at each budget."""
    if EXACT not in run.samplers:
        return
    yield Heading(f"Beside the exact table of {EXACT}")
    if any(Budget.parse(budget).timed for budget in run.budgets):
        yield Text(
            f"Equal seconds are those of this project's code, which draws, looks up and traces "
            f"samples of {EXACT}'s kind of table in one pass, and those of the others in several: "
            "they tell of this code first. `renderer-tables` tells how fast each table is alone."
        )
    for budget in run.budgets:
        rows = run.at(budget)
        for metric in reversed(ranked_metrics()):
            if metric.name not in rows or EXACT not in set(rows["sampler"]):
                continue
            lines = []
            for label in run.samplers:
                if label == EXACT or label not in set(rows["sampler"]):
                    continue
                one = compare(rows, EXACT, label, metric)
                lines.append(
                    {
                        "budget": budget, "metric": metric.name, "sampler": label,
                        "error": one.error.get(budget, float("nan")), "ratio": one.overall.text,
                        "times": one.overall.ratio, "low": one.overall.low,
                        "high": one.overall.high,
                        "wins": f"{one.overall.wins} of {one.overall.maps}",
                    }
                )  # fmt: skip
            headings = {"error": metric.label, "ratio": f"× {EXACT}"}
            table = pd.DataFrame(lines)
            if len(table):
                caption = f"{metric.label} at {budget}."
                best = {"error": metric.better}
                yield Table("beside_exact", table, COST_FORMATS, headings, best, caption)
    yield Text(
        "Errors are means over maps; ratios are geometric means over maps with the 95 % interval "
        "of a bootstrap over them; `wins` counts maps with less error than that of the exact "
        f"table. An error within {NEAR:g}× of what the references' own noise gives counts as "
        f"{NEAR:g}× that in ratios and wins."
    )


def with_and_without(run: Run) -> Iterator[Part]:
    """What compensation changes, renderer by renderer, over all budgets."""
    found = [
        verdict(one, f"{one.sampler} {in_words(one.reading)}")
        for metric in reversed(ranked_metrics())
        if metric.name in run.rows
        for one in comparisons(run.rows, metric)
    ]
    if found:
        yield Heading("Compensation the other way, over all budgets")
        yield Items(tuple(found))


def in_words(label: str) -> str:
    """What the brackets of a label say of compensation."""
    words = {f"{SWITCH}=True": "with compensation", f"{SWITCH}=False": "without compensation"}
    inside = label.partition("[")[2].rstrip("]")
    return words.get(inside, inside)
