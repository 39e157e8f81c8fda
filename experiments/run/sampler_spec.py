"""A sampler as a run names it: small enough to be sent to another process, with its identity."""

from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

from experiments.run.identity import Shared, library_versions, source_digest
from samplers import EnvlightError, LightSampler, make_sampler
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
        source = self.identity["source"] if self.content else ""
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
            "source": source_digest(module),
            "libraries": library_versions(module),
        }

    @cached_property
    def shared(self) -> Shared:
        """The identity, as part of others."""
        return Shared(self.identity)
