"""Every open choice of every sampler, one at a time: which reading of a paper has the least error?

Where a paper leaves a choice open, the default is to be the reading that a careful author of it
would ship: the one with the least error over 8 to 64 lights on photographed maps, unless the
paper's words exclude it. A choice that changes what an image costs, such as the size of a smaller
image, is compared at equal rays and in equal time besides, and time decides: at equal lights a
saving can only lose. Of a hundred that are alike some five lie outside of a 95 % interval.

A sampler's own file says what is open (`samplers.base.LightSampler`): its class lists readings that
have words of their own; of other parameters every value of a `Literal` or `bool` is one, and those
of the field's metadata `readings`, unless the metadata say why it is `fixed`.

--samplers 'fhis*' takes the readings of one sampler.
"""

from collections.abc import Iterator
from dataclasses import Field, dataclass, fields, replace
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pandas as pd

from experiments.questions.comparison import (
    MARGIN,
    Comparison,
    beaten_defaults,
    comparisons,
    deciding,
)
from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.suite import together
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, budgets_of, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import QUICK, Scale
from metrics.registry import NEAR, Metric, ranked_metrics
from samplers import LightSampler, sampler_class, sampler_names
from samplers.lighting import LightExtent

SCENES = ("rubiks-cube", "birdcage")
"""Gaps and gloss; thin wires and leaves over a ground."""
LIGHTS = {QUICK: (8, 32), "medium": (8, 16, 32, 64)}
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
        budgets=budgets_of(LIGHTS),
        also=equal_costs,
        seeds=1,  # the same time for more maps tells more
        quick_scenes=1,
        quick_maps=1,
    )


def equal_costs(scale: Scale) -> tuple[tuple[SamplerSpec, Budget], ...]:
    """Choices that change what an image costs, and their defaults, at equal rays and time."""
    costs = COSTS[::2] if scale.name == QUICK else COSTS
    return tuple((one, Budget.parse(text)) for text in costs for one in costly_samplers())


@cache
def found_in(run: Run) -> list[Comparison]:
    """All comparisons of one run, by the ranked metrics, the leading one first."""
    metrics = [metric for metric in reversed(ranked_metrics()) if metric.name in run.rows]
    # In the order in which the samplers were planned, not that of their labels.
    order = run.rows["sampler"].map({label: k for k, label in enumerate(run.samplers)})
    rows = run.rows.iloc[order.argsort(kind="stable")]
    baselines = {label: sampler for label, (sampler, _) in READ_AS.items()}
    found = [one for metric in metrics for one in comparisons(rows, metric, baselines)]
    return [replace(one, size=run.size) for one in (*found, *_of_all(found))]


def _of_all(found: list[Comparison]) -> Iterator[Comparison]:
    """A choice that samplers share, in words, beside the default: each map's mean over samplers."""
    alike: dict[tuple[str, Metric, str], list[Comparison]] = {}
    shared = _shared()
    for one in (one for one in found if one.reading in shared):
        alike.setdefault((shared[one.reading], one.metric, one.equal), []).append(one)
    for (reading, metric, equal), those in alike.items():
        logs = pd.concat([one.logs for one in those]).groupby(level=0).mean()
        errors, near = sum(one.errors for one in those), sum(one.near for one in those)
        yield Comparison(ALL, reading, metric, equal, {}, {}, logs, errors, near)


def findings(run: Run) -> list[str]:
    """Which defaults are beaten, and what became of them; of all parts of a run."""
    return _beaten(_deciding(together(run)))


def _deciding(runs: list[Run]) -> list[Comparison]:
    return deciding([one for run in runs for one in found_in(run)], changes_cost)


def _beaten(found: list[Comparison]) -> list[str]:
    """What is told of choices; of those that samplers share, what all samplers together say."""
    shared, words = _shared(), choices_in_words()
    return beaten_defaults([one for one in found if one.reading not in shared], words, ruled_out())


def by_choice(run: Run) -> Iterator[Part]:
    """Which defaults are beaten; then the comparisons that decide, sampler by sampler, each within
    one part of the run: what was timed is compared with what was timed beside it.
    """
    choices, parts = choices_in_words(), [found_in(part) for part in together(run)]
    decisive, kept = _deciding(together(run)), ruled_out()
    yield Heading(BEATEN)
    yield Items(tuple(_beaten(decisive)))
    apart = (one for part in together(run) for one in _deciding([part]) if one not in decisive)
    if others := [one for one in apart if one.reading not in kept]:
        where = "In smaller images, or at equal lights or rays where time decides"
        yield Text(f"{where}, leaving out what stays for a reason:")
        yield Items(tuple(_beaten(others)))
    samplers = dict.fromkeys(one.sampler for found in parts for one in found)
    of_each = [[one for one in f if one.sampler == sampler] for sampler in samplers for f in parts]
    yield Heading("All choices")
    yield decided_table([[one for one in found if one in decisive] for found in of_each], choices)
    for found in of_each:
        for metric, equal in dict.fromkeys((one.metric, one.equal) for one in found):
            alike = [one for one in found if (one.metric, one.equal) == (metric, equal)]
            yield reading_table(alike, choices)
    yield Text(
        "A ratio is the geometric mean over maps of a reading's error to the default's, over all "
        "budgets of its kind together, whose logarithms are averaged on each map first, with the "
        "95 % interval of a bootstrap over maps; `wins` counts the maps with the smaller error. An "
        f"error within {NEAR:g}× of what the references' own noise gives counts as {NEAR:g}× that. "
        "Every budget, and comparisons that do not decide, are in `readings.csv`."
    )


def decided_table(parts: list[list[Comparison]], choices: dict[str, str]) -> Table:
    """Comparisons of readings, a line each, by all metrics. parts : of a sampler and a run"""
    lines: dict[tuple[int, str, str], dict[str, object]] = {}
    formats = {"sampler": "s", "choice": "s", "images": "s", "equal": "s", "maps": "d"}
    headings: dict[str, str] = {}
    for part, found in enumerate(parts):
        for one in found:
            name, whole, reading = one.metric.name, one.overall, one.reading
            line = lines.setdefault((part, reading, one.equal), {
                "sampler": one.sampler, "label": reading, "choice": choices.get(reading, reading),
                "images": "{}×{}".format(*one.size), "equal": one.equal, "maps": whole.maps,
            })  # fmt: skip
            line |= {name: whole.text, f"{name}_wins": str(whole.wins)}
            formats |= {name: "s", f"{name}_wins": "s"}
            headings |= {name: f"{one.metric.label} ×", f"{name}_wins": "wins" + " " * len(name)}
    return Table("decided", pd.DataFrame(list(lines.values())), formats, headings)


def reading_table(found: list[Comparison], choices: dict[str, str]) -> Table:
    """The default and its other readings by one metric, for other programs."""
    first, size = found[0], "{}×{}".format(*found[0].size)
    default = {k: error for one in reversed(found) for k, error in one.default_error.items()}
    alike = {"sampler": first.sampler, "images": size, "metric": first.metric.name}
    budgets = dict.fromkeys(budget for one in found for budget in one.error)
    of_default = {"label": first.sampler, "choice": "default", **{b: default[b] for b in budgets}}
    lines: list[dict[str, object]] = [
        *([{**alike, **of_default}] if budgets else ()),
        *(
            {
                **alike, "label": one.reading, "choice": choices.get(one.reading, one.reading),
                **one.error,
                **{f"{budget}_ratio": ratio.text for budget, ratio in one.ratios.items()},
                "all": one.overall.text, "ratio": one.overall.ratio, "low": one.overall.low,
                "high": one.overall.high, "wins": f"{one.overall.wins} of {one.overall.maps}",
            }
            for one in found
        ),
    ]  # fmt: skip
    return Table("readings", pd.DataFrame(lines), {}, shown=False)


@dataclass(frozen=True)
class Choice:
    """A reading of a sampler.

    sampler : as registered; choice : in words; parameters : what it sets, by name
    ruled_out : why it cannot be the default, however small its error
    """

    sampler: str
    choice: str
    parameters: tuple[tuple[str, Any], ...]
    ruled_out: str = ""

    @property
    def spec(self) -> SamplerSpec:
        """The sampler, its defaults left out."""
        default = {field.name: field.default for field in fields(sampler_class(self.sampler))}
        changed = ((k, v) for k, v in self.parameters if k not in default or default[k] != v)
        return SamplerSpec(self.sampler, tuple(changed))


EXTENT, SETS = "light_extent", "sets"
ALL = "Every set of lights"
SHARED: dict[tuple[str, Any], tuple[str, str]] = {
    (SETS, "perturbed"): ("one set, perturbed", ""),
    (SETS, "independent"): (
        "eight independent sets",
        "no sampler has sets of its own where its rivals are perturbed",
    ),
    **{(EXTENT, one): (f"perturbed by the {one} angle", "") for one in get_args(LightExtent)},
}
"""Of parameters that many samplers have, by value: words, and why it cannot be the default."""
READ_AS = {"mis-compensated": ("mis", "compensation for BRDF sampling")}
"""Samplers that are a reading of another one: which, and the choice in words."""
OWN_SAMPLER = "a sampler of its own; its paper is later than what `mis` stands for"


def same_as(sampler: str) -> str:
    """The sampler that it is a variant of, whose choices are measured for both; else itself."""
    kind = sampler_class(sampler)
    parent: type[LightSampler] = kind.__mro__[1]
    return sampler if not parent.name or "readings" in vars(kind) else parent.name


def every_reading() -> tuple[Choice, ...]:
    """The readings of all samplers but variants, one family after another."""
    samplers = (sampler for sampler in sampler_names() if same_as(sampler) == sampler)
    return tuple(choice for sampler in samplers for choice in _choices_of(sampler))


def _choices_of(sampler: str) -> Iterator[Choice]:
    """Those that have words of their own, then those of other parameters, value by value."""
    kind = sampler_class(sampler)
    for one in kind.readings:
        yield Choice(sampler, one.choice, tuple(one.parameters.items()), one.ruled_out)
    named = {name for one in kind.readings for name in one.parameters}
    for parameter in sorted(fields(kind), key=_place):
        name = parameter.name
        for value in () if name in named else _values_of(kind, parameter):
            why = parameter.metadata.get("ruled_out", {}).get(value, "")
            plain = f"{name.replace('_', ' ')} {value}", why
            words, why = SHARED.get((name, value), plain)
            yield Choice(sampler, words, ((name, value),), why)


def _place(parameter: Field) -> int:
    """Those that many samplers share come last."""
    return (SETS, EXTENT).index(parameter.name) + 1 if parameter.name in (SETS, EXTENT) else 0


def _values_of(kind: type, parameter: Field) -> tuple[Any, ...]:
    """The values of a parameter that are read, its default among them; none where it is fixed."""
    if parameter.metadata.get("fixed"):
        return ()
    hint = get_type_hints(kind)[parameter.name]
    if get_origin(hint) is Literal:
        return get_args(hint)
    read = (False, True) if hint is bool else tuple(parameter.metadata.get("readings", ()))
    return read if parameter.default in read or not read else (parameter.default, *read)


@cache
def by_label() -> dict[str, Choice]:
    """Every choice of every sampler that is not the default, variants' too."""
    found = (choice for sampler in sampler_names() for choice in _choices_of(sampler))
    return {one.spec.label: one for one in found if one.spec.parameters}


def _shared() -> dict[str, str]:
    """Choices that samplers share, in words, by label."""
    return {k: one.choice for k, one in by_label().items() if one.parameters[0] in SHARED}


def ruled_out() -> dict[str, str]:
    """Readings that cannot be the default however small their error: why, by label, or by the words
    of what samplers share.
    """
    told = {label: one.ruled_out for label, one in by_label().items() if one.ruled_out}
    shared = {words: why for words, why in SHARED.values() if why}
    return told | shared | dict.fromkeys(READ_AS, OWN_SAMPLER)


def costly(sampler: str) -> tuple[str, ...]:
    """Parameters that change what an image costs, how many discs there are, too.

    They are judged at equal cost: at equal lights a saving can only lose.
    """
    shared = [SETS] if any(one.name == SETS for one in fields(sampler_class(sampler))) else []
    return tuple(dict.fromkeys([*shared, *sampler_class(sampler).costly]))


@cache
def changes_cost(label: str) -> bool:
    """Whether a reading sets a parameter that changes what an image costs."""
    one = by_label().get(label)
    if one is None:
        return label == SHARED[SETS, "independent"][0]
    return any(name in costly(one.sampler) for name, _ in one.parameters)


def costly_samplers() -> tuple[SamplerSpec, ...]:
    """The readings that change what an image costs, with the defaults beside them."""
    return tuple(
        one
        for one in measured_samplers()
        if (costly(one.name) and not one.parameters) or changes_cost(one.label)
    )


def measured_samplers() -> tuple[SamplerSpec, ...]:
    """Every sampler with an open choice at its defaults, followed by its other readings."""
    pairs = ((SamplerSpec(one.sampler), one.spec) for one in every_reading())
    return tuple(dict.fromkeys(spec for pair in pairs for spec in pair))


def choices_in_words() -> dict[str, str]:
    """The choices that are not the default, by the labels of their samplers."""
    words = {label: one.choice for label, one in by_label().items()}
    return words | {label: choice for label, (_, choice) in READ_AS.items()}
