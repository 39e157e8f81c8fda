"""Samplers as chosen on the command line: names, patterns, files and parameters.

ours,mis                          names; a comma or a second --samplers adds more
'm*'                              a shell pattern over the registered names
ours[upsampling=2]                a sampler with parameters of its own
./my_sampler.py:MySampler         a class in a file
./my_sampler.py:MySampler[a=1,b=2]
"""

import re
from collections.abc import Iterable
from dataclasses import fields

from experiments.cell import SamplerSpec
from experiments.datasets import select
from experiments.parameters import parse_parameters
from samplers import EnvlightError, sampler_class, sampler_names
from samplers.from_file import is_file_reference

WITH_PARAMETERS = re.compile(r"(?P<name>[^\[\]]+)\[(?P<inside>.*=.*)\]")


def split_list(texts: Iterable[str]) -> list[str]:
    """The items of comma-separated lists; commas in brackets belong to the item."""
    parts: list[str] = []
    for text in texts:
        depth, start = 0, 0
        for place, letter in enumerate(text):
            depth += (letter in "[(") - (letter in "])")
            if letter == "," and depth <= 0:
                parts.append(text[start:place])
                start = place + 1
        parts.append(text[start:])
    return [part.strip() for part in parts if part.strip()]


def choose_samplers(texts: list[str]) -> tuple[SamplerSpec, ...]:
    """The samplers that the texts name, each once, in their order; all where there is no text.

    Raises EnvlightError for whatever names no sampler, and for two samplers of one name.
    """
    specs: dict[str, SamplerSpec] = {}
    for text in split_list(texts) or sampler_names():
        for spec in _specs(text):
            known = specs.setdefault(spec.label, spec)
            if known != spec:
                raise EnvlightError(
                    f"two samplers are called '{spec.label}': {known.name} and {spec.name}; "
                    "register one under another name"
                )
    return tuple(specs.values())


def single_sampler(text: str) -> SamplerSpec:
    """The one sampler that a text names; patterns are not looked for."""
    match = WITH_PARAMETERS.fullmatch(text)
    if match is None:
        return _fitted(SamplerSpec(text))
    inside = parse_parameters(split_list([match["inside"]]))
    return _fitted(SamplerSpec(match["name"], tuple(inside.items())))


def _specs(text: str) -> list[SamplerSpec]:
    if WITH_PARAMETERS.fullmatch(text) or is_file_reference(text):
        return [single_sampler(text)]
    return [SamplerSpec(name) for name in select(sampler_names(), [text], "sampler")]


def _fitted(spec: SamplerSpec) -> SamplerSpec:
    """The same with values as the sampler takes them, those left out that are its defaults."""
    defaults = {f.name: f.default for f in fields(sampler_class(spec.name))}
    sampler = spec.sampler  # raises for what does not fit
    chosen = ((name, getattr(sampler, name)) for name, _ in spec.parameters)
    return SamplerSpec(
        spec.name, tuple((name, value) for name, value in chosen if value != defaults[name])
    )
