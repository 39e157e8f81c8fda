"""Every open choice of every sampler, one at a time: which reading of a paper has the least error?

Where a paper leaves a choice open, the default is to be the reading that a careful author of it
would ship: the one with the least error over 8 to 64 lights on photographed maps, unless the
paper's words exclude it. A choice that changes what an image costs, such as the size of a smaller
image, is compared at equal rays and in equal time besides, and time decides: at equal lights a
saving can only lose. Here stand the errors of all of them, their ratios to the default's, and on
how many maps each wins; the samplers' classes list them. Each comparison is of one reading with one
default; of a hundred that are alike some five lie outside of a 95 % interval.

--samplers 'fhis*' takes the readings of one sampler.
"""

from collections.abc import Iterator

import pandas as pd

from experiments.questions.readings.choices import (
    RULED_OUT,
    baselines,
    changes_cost,
    choices_in_words,
    costly_samplers,
    defaults_in_words,
    measured_samplers,
)
from experiments.questions.readings.comparison import (
    MARGIN,
    Comparison,
    beaten_defaults,
    comparisons,
    deciding,
    verdict,
)
from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import QUICK, Scale
from metrics.registry import NEAR, ranked_metrics

SCENES = ("rubiks-cube", "birdcage")
"""Gaps and gloss; thin wires and leaves over a ground."""
LIGHTS = (8, 16, 32, 64)
QUICK_LIGHTS = (8, 32)
COSTS = ("rays=median-cut:8", "rays=median-cut:32", "time=median-cut:8", "time=median-cut:32")
"""What choices that change the cost of an image are given alike."""
BEATEN = f"Defaults that are beaten by more than {100 * MARGIN:.0f} %"


@experiment("readings")
def readings() -> GridExperiment:
    """Every open choice of every sampler beside the default."""
    return GridExperiment(
        title="Readings of the papers",
        sections=(by_choice,),
        findings=findings,
        scenes=SCENES,
        samplers=measured_samplers,
        budgets=light_budgets,
        also=equal_costs,
        seeds=1,  # the same time for more maps tells more
        quick_scenes=1,
        quick_maps=1,
    )


def light_budgets(scale: Scale) -> tuple[Budget, ...]:
    """From few lights to many."""
    return tuple(Budget(count) for count in (QUICK_LIGHTS if scale.name == QUICK else LIGHTS))


def equal_costs(scale: Scale) -> tuple[tuple[SamplerSpec, Budget], ...]:
    """Choices that change what an image costs, and their defaults, at equal rays and time."""
    costs = COSTS[::2] if scale.name == QUICK else COSTS
    return tuple((one, Budget.parse(text)) for text in costs for one in costly_samplers())


def found_in(run: Run) -> list[Comparison]:
    """All comparisons, by the ranked metrics, the leading one first."""
    metrics = [metric for metric in reversed(ranked_metrics()) if metric.name in run.rows]
    # In the order in which the samplers were planned, not that of their labels.
    order = run.rows["sampler"].map({label: k for k, label in enumerate(run.samplers)})
    rows = run.rows.iloc[order.argsort(kind="stable")]
    return [one for metric in metrics for one in comparisons(rows, metric, baselines())]


def findings(run: Run) -> list[str]:
    """Which defaults are beaten, and what became of them."""
    found = deciding(found_in(run), changes_cost)
    return beaten_defaults(found, choices_in_words(), RULED_OUT, defaults_in_words())


def by_choice(run: Run) -> Iterator[Part]:
    """Which defaults are beaten; then, sampler by sampler, verdicts and tables."""
    choices, found = choices_in_words(), found_in(run)
    yield Heading(BEATEN)
    yield Items(tuple(findings(run)))
    for sampler in dict.fromkeys(one.sampler for one in found):
        part = [one for one in found if one.sampler == sampler]
        yield Heading(sampler)
        yield Items(tuple(verdict(one, choices.get(one.reading, one.reading)) for one in part))
        for metric, equal in dict.fromkeys((one.metric, one.equal) for one in part):
            alike = [one for one in part if (one.metric, one.equal) == (metric, equal)]
            yield reading_table(alike, choices)
    yield Text(
        "Errors are means over maps; a ratio is the geometric mean over maps of a reading's error "
        "to the default's, with the 95 % interval of a bootstrap over maps. `all` is over all "
        "budgets of the table together, whose logarithms are averaged on each map first; `wins` "
        f"counts the maps with the smaller error there. An error within {NEAR:g}× of what the "
        f"references' own noise gives counts as {NEAR:g}× that in ratios and wins."
    )


def reading_table(found: list[Comparison], choices: dict[str, str]) -> Table:
    """The default and its other readings by one metric."""
    first = found[0]
    budgets, metric = list(dict.fromkeys(b for one in found for b in one.error)), first.metric
    formats: dict[str, str] = {"choice": "s"}
    headings: dict[str, str] = {}
    for place, budget in enumerate(budgets):
        formats |= {budget: f".{metric.digits}f", f"{budget}_ratio": "s"}
        headings[f"{budget}_ratio"] = "×" + " " * place  # headings must differ
    default = {budget: _default_error(found, budget) for budget in budgets}
    lines: list[dict[str, object]] = [
        {"sampler": first.sampler, "metric": metric.name, "label": first.sampler,
         "choice": "default", **default},
        *(
            {
                "sampler": one.sampler, "metric": metric.name, "label": one.reading,
                "choice": choices.get(one.reading, one.reading),
                **one.error,
                **{f"{budget}_ratio": ratio.text for budget, ratio in one.ratios.items()},
                "all": one.overall.text, "ratio": one.overall.ratio, "low": one.overall.low,
                "high": one.overall.high, "wins": f"{one.overall.wins} of {one.overall.maps}",
            }
            for one in found
        ),
    ]  # fmt: skip
    caption = (
        f"{first.sampler}: {metric.label} of its readings at equal {first.equal}, and ratios to "
        "the default."
    )
    best = dict.fromkeys(budgets, metric.better)
    return Table(
        "readings", pd.DataFrame(lines), {**formats, "all": "s", "wins": "s"}, headings, best,
        caption,
    )  # fmt: skip


def _default_error(found: list[Comparison], budget: str) -> float:
    """The default's error: that of the first reading that is compared at the budget."""
    return next((one.default_error[budget] for one in found if budget in one.default_error),
                float("nan"))  # fmt: skip
