"""Samplers as chosen on the command line: names, patterns, files and parameters.

ours,mis                          names; a comma or a second --samplers adds more
'm*'                              a shell pattern over the registered names
ours[upsampling=2]                a sampler with parameters of its own
./my_sampler.py:MySampler         a class in a file
./my_sampler.py:MySampler[a=1,b=2]
"""

import ast
import re
from dataclasses import fields
from typing import Any

from experiments.maps.patterns import select, split_list
from experiments.run.sampler_spec import SamplerSpec
from samplers import EnvlightError, sampler_class, sampler_names
from samplers.files.from_file import is_file_reference

WITH_PARAMETERS = re.compile(r"(?P<name>[^\[\]]+)\[(?P<inside>.*=.*)\]")


def choose_samplers(texts: list[str], own: tuple[SamplerSpec, ...] = ()) -> tuple[SamplerSpec, ...]:
    """The samplers that the texts name, each once, in their order; all where there is no text.

    own : an experiment's, which texts may name by their labels, beside those that are registered
    Raises EnvlightError for whatever names no sampler, and for two samplers of one name.
    """
    specs: dict[str, SamplerSpec] = {}
    named = {spec.label: spec for spec in own}
    named |= {name: SamplerSpec(name) for name in sampler_names() if name not in named}
    for text in split_list(texts) or list(named):
        for spec in _specs(text, named):
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
    return _fitted(SamplerSpec(match["name"], parse_parameters(split_list([match["inside"]]))))


def parse_parameters(texts: list[str]) -> tuple[tuple[str, Any], ...]:
    """From ["order=rounds", "cases=64"] to (("order", "rounds"), ("cases", 64)).

    Raises EnvlightError for what is not name=value, and for a name that is given twice.
    """
    result: dict[str, Any] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator or not name.isidentifier():
            raise EnvlightError(f"parameter '{text}': write it as name=value")
        if name in result:
            raise EnvlightError(f"parameter '{name}': it is given twice; give one value")
        result[name] = _value(value)
    return tuple(result.items())


def _value(text: str) -> Any:
    """A Python literal as what it is, anything else as text."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text


def _specs(text: str, named: dict[str, SamplerSpec]) -> list[SamplerSpec]:
    if text in named:
        return [named[text]]
    if WITH_PARAMETERS.fullmatch(text) or is_file_reference(text):
        return [single_sampler(text)]
    return [named[label] for label in select(list(named), [text], "sampler")]


def _fitted(spec: SamplerSpec) -> SamplerSpec:
    """The same with values as the sampler takes them, those left out that are its defaults."""
    defaults = {f.name: f.default for f in fields(sampler_class(spec.name))}
    sampler = spec.sampler  # raises for what does not fit
    chosen = ((name, getattr(sampler, name)) for name, _ in spec.parameters)
    return SamplerSpec(
        spec.name, tuple((name, value) for name, value in chosen if value != defaults[name])
    )
