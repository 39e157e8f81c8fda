"""The open choices of every sampler, which are compared: as the samplers themselves tell them.

A sampler's class lists the readings of its paper, that of the default among them, parameters that
are no choice, and those that change what an image costs (`samplers.base.LightSampler`). Here stand
only the choices that all samplers of fixed lights share. A test holds every parameter of every
sampler to be one or the other.
"""

from dataclasses import dataclass, fields
from typing import Any, get_args

from experiments.run.sampler_spec import SamplerSpec
from samplers import LightSampler, sampler_class, sampler_names
from samplers.lighting import LIGHT_EXTENT, LightExtent


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

    @property
    def is_default(self) -> bool:
        """Whether it is what the sampler does anyway."""
        return not self.spec.parameters


EXTENT, SETS = "light_extent", "sets"
SETS_IN_WORDS = {"perturbed": "one set, perturbed", "independent": "eight independent sets"}
ONE_EXTENT = "one extent for all samplers"
NO_OWN_SETS = "no sampler has sets of its own where its rivals are perturbed"
READ_AS = {"mis-compensated": ("mis", "compensation for BRDF sampling")}
"""Samplers that are a reading of another one: which, and the choice in words."""
OWN_SAMPLER = "a sampler of its own; its paper is later than what `mis` stands for"


def same_as(sampler: str) -> str:
    """The sampler that it is a variant of, whose choices are measured for both; else itself."""
    kind = sampler_class(sampler)
    parent: type[LightSampler] = kind.__mro__[1]
    return sampler if parent is LightSampler or "readings" in vars(kind) else parent.name


def _choices_of(sampler: str) -> list[Choice]:
    """Those of its own, then those of all samplers whose lights interleaved sampling perturbs."""
    kind = sampler_class(sampler)
    parameters = {field.name for field in fields(kind)}
    own = [
        Choice(sampler, one.choice, tuple(one.parameters.items()), one.ruled_out)
        for one in kind.readings
    ]
    if SETS in parameters and not any(SETS in one.parameters for one in kind.readings):
        own += [
            Choice(sampler, words, ((SETS, sets),), NO_OWN_SETS if sets == "independent" else "")
            for sets, words in SETS_IN_WORDS.items()
        ]
    if EXTENT in parameters:
        own += [
            Choice(
                sampler,
                f"perturbed by the {extent} angle",
                ((EXTENT, extent),),
                "" if extent == LIGHT_EXTENT else ONE_EXTENT,
            )
            for extent in get_args(LightExtent)
        ]
    return own


READINGS = tuple(
    choice
    for sampler in sampler_names()
    if same_as(sampler) == sampler
    for choice in _choices_of(sampler)
)
RULED_OUT = {
    SamplerSpec(one.sampler, one.parameters).label: one.ruled_out
    for one in READINGS
    if one.ruled_out
} | dict.fromkeys(READ_AS, OWN_SAMPLER)
"""Readings that cannot be the default however small their error: why, by label."""


def costly(sampler: str) -> tuple[str, ...]:
    """Parameters that change what an image costs, how many discs there are, too.

    They are judged at equal cost: at equal lights a saving can only lose.
    """
    shared = [SETS] if any(one.name == SETS for one in fields(sampler_class(sampler))) else []
    return tuple(dict.fromkeys([*shared, *sampler_class(sampler).costly]))


def changes_cost(label: str) -> bool:
    """Whether a reading sets a parameter that changes what an image costs."""
    spec = next((one.spec for one in READINGS if one.spec.label == label), None)
    return spec is not None and any(name in costly(spec.name) for name, _ in spec.parameters)


def costly_samplers() -> tuple[SamplerSpec, ...]:
    """The readings that change what an image costs, with the defaults beside them."""
    return tuple(
        one
        for one in measured_samplers()
        if (costly(one.name) and not one.parameters) or changes_cost(one.label)
    )


def measured_samplers() -> tuple[SamplerSpec, ...]:
    """Every sampler with an open choice at its defaults, followed by its other readings."""
    specs: dict[str, list[SamplerSpec]] = {}
    for reading in READINGS:
        family = specs.setdefault(reading.sampler, [SamplerSpec(reading.sampler)])
        if reading.spec not in family:
            family.append(reading.spec)
    return tuple(spec for family in specs.values() for spec in family)


def choices_in_words() -> dict[str, str]:
    """The choices by the labels of their samplers, the defaults' by those they have when they are
    none: in older rows they may be so."""
    shown = {one.spec.label: one.choice for one in READINGS if not one.is_default}
    return defaults_in_words() | shown | {label: choice for label, (_, choice) in READ_AS.items()}


def defaults_in_words() -> dict[str, str]:
    """Of the choices those that are the defaults now."""
    chosen = (one for one in READINGS if one.is_default)
    return {SamplerSpec(one.sampler, one.parameters).label: one.choice for one in chosen}


def baselines() -> dict[str, str]:
    """The samplers that are a reading of another one, and which."""
    return {label: sampler for label, (sampler, _) in READ_AS.items()}
