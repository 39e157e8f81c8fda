"""A sampler as a run names it, small enough to be sent to another process, and as it is chosen.

ours,mis                          names; a comma or a second --samplers adds more
'm*'                              a shell pattern over the registered names
ours[upsampling=2]                a sampler with parameters of its own
./my_sampler.py:MySampler         a class in a file
./my_sampler.py:MySampler[a=1,b=2]
"""

import ast
import re
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

from experiments.maps.patterns import select, split_list
from experiments.run.identity import Shared, library_versions, programs, source_digest
from samplers import EnvlightError, LightSampler, make_sampler, sampler_class, sampler_names
from samplers.conformance.lighting_check import contained
from samplers.files.from_file import content_digest, is_file_reference, split_reference


def family_of(label: str) -> str:
    """The sampler's name in a label, which may have parameters in brackets behind it."""
    return label.partition("[")[0]


@dataclass(frozen=True)
class SamplerSpec:
    """A sampler's name and the parameters that differ from the paper's.

    name : as registered, or FILE:CLASS, which another process loads again by its path
    content : hash of that file; source : of all that the sampler depends on where it was sent from,
        so that no process goes on with an edited one
    """

    name: str
    parameters: tuple[tuple[str, Any], ...] = ()
    content: str = field(default="", repr=False)
    source: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        if is_file_reference(self.name):
            path, name = split_reference(self.name)
            object.__setattr__(self, "name", f"{path}:{name}")
            object.__setattr__(self, "content", self.content or content_digest(path))

    def __reduce__(self) -> tuple:
        source = source_digest(type(self.sampler).__module__) if self.content else ""
        return SamplerSpec, (self.name, self.parameters, self.content, source)

    @cached_property
    def sampler(self) -> LightSampler:
        if self.content and content_digest(split_reference(self.name)[0]) != self.content:
            raise EnvlightError(f"{self.name}: the file has changed since the start; start again")
        sampler = make_sampler(self.name, **dict(self.parameters))
        if self.source and source_digest(type(sampler).__module__) != self.source:
            raise EnvlightError(
                f"{self.name}: a file that it uses has changed since the start; start again"
            )
        return sampler

    @cached_property
    def label(self) -> str:
        """What tables call it: the name, and parameters in brackets where some are set."""
        inside = ", ".join(f"{key}={value}" for key, value in self.parameters)
        return f"{self.sampler.name}[{inside}]" if inside else self.sampler.name

    @cached_property
    def identity(self) -> dict[str, Any]:
        module = type(self.sampler).__module__
        return {
            "name": self.sampler.name,
            "parameters": {key: repr(value) for key, value in asdict(self.sampler).items()},
            "programs": programs(module),
            "libraries": library_versions(module),
        }

    @cached_property
    def shared(self) -> Shared:
        """The identity, as part of others."""
        return Shared(self.identity)


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
    name, inside = match.groups() if match else (text, "")
    with contained():
        return _fitted(SamplerSpec(name, parse_parameters(split_list([inside]))))


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
    if not isinstance(sampler.label, str) or not sampler.label.isprintable():
        raise EnvlightError(f"sampler '{spec.name}': its label is no line of text; give it one")
    chosen = ((name, getattr(sampler, name)) for name, _ in spec.parameters)
    return SamplerSpec(
        spec.name, tuple((name, value) for name, value in chosen if value != defaults[name])
    )
