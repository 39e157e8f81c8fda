"""A measurement: one measurement, described by all that determines its result."""

from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import Budget
from experiments.run.identity import digest, file_digest, library_versions, source_digest
from experiments.run.machine import machine_identity
from experiments.run.scale import Scale
from experiments.run.scene_choice import scene_file_digests
from samplers import EnvlightError, LightSampler, make_sampler
from samplers.files.from_file import content_digest, is_file_reference, split_reference

METRICS = ("metrics.errors", "metrics.flip")
MEASUREMENT = Path(__file__).with_name("measure.py")
"""Counts by itself: what it imports stands in the identities under names of its own."""
TIMING = tuple(
    Path(__file__).with_name(f"{name}.py") for name in ("timed", "count_search", "bench")
)
"""Decide about measurements with a budget of seconds; so does the machine."""


@dataclass(frozen=True)
class SamplerSpec:
    """A sampler's name and the parameters that differ from the paper's.

    name : as registered, or FILE:CLASS, which another process loads again by its path
    content : hash of that file, so that no process goes on with an edited one
    """

    name: str
    parameters: tuple[tuple[str, Any], ...] = ()
    content: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        if is_file_reference(self.name):
            path, name = split_reference(self.name)
            object.__setattr__(self, "name", f"{path}:{name}")
            object.__setattr__(self, "content", self.content or content_digest(path))

    def __reduce__(self) -> tuple:
        return SamplerSpec, (self.name, self.parameters, self.content)

    @cached_property
    def sampler(self) -> LightSampler:
        if self.content and content_digest(split_reference(self.name)[0]) != self.content:
            raise EnvlightError(f"{self.name}: the file has changed since the start; start again")
        return make_sampler(self.name, **dict(self.parameters))

    @property
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


@dataclass(frozen=True)
class Case:
    """A scene under an environment at a scale: what all samplers share, reference included.

    scene_file : path of a scene's TOML file, or empty for a built-in scene
    """

    scene: str
    environment: EnvironmentSource
    scale: Scale
    scene_file: str = ""

    @cached_property
    def identity(self) -> dict[str, Any]:
        scene = f"renderer.scenes.{self.scene.replace('-', '_')}"
        files = {}
        if self.scene_file:
            scene, files = (
                "renderer.scene.scene_file",
                {"files": scene_file_digests(self.scene_file)},
            )
        embedded = () if self.environment.path else ("experiments.maps.places",)
        return {
            "scene": self.scene,
            "scene_source": source_digest(scene),
            **files,
            "environment": self.environment.identity,
            "view": [self.scale.width, self.scale.height, self.scale.subpixels],
            "reference": [self.scale.noise_target, self.scale.max_samples],
            "reference_source": source_digest("renderer.reference"),
            "measurement_source": file_digest(MEASUREMENT),
            "libraries": library_versions(scene, "renderer.reference", *embedded),
        }

    @cached_property
    def key(self) -> str:
        """Identifies the reference image."""
        return digest(self.identity)

    def __str__(self) -> str:
        return f"{self.scene} · {self.environment.name}"


@dataclass(frozen=True)
class Measurement:
    """One sampler at one budget with one seed on one case."""

    case: Case
    sampler: SamplerSpec
    budget: Budget
    seed: int

    @cached_property
    def identity(self) -> dict[str, Any]:
        return {
            "case": self.case.identity,
            "sampler": self.sampler.identity,
            "budget": str(self.budget),
            "seed": self.seed,
            "renderer_source": source_digest("renderer.render"),
            "metric_source": source_digest(*METRICS),
            "libraries": library_versions("renderer.render", *METRICS),
            **self._budget_identity(),
        }

    def _budget_identity(self) -> dict[str, Any]:
        """How a count is found that no budget of lights gives."""
        if self.budget.timed:
            sources = [file_digest(path) for path in TIMING]
            return {"budget_source": sources, "machine": machine_identity()}
        if self.budget.kind == "rays":
            return {"budget_source": source_digest("experiments.run.ray_budget")}
        return {}

    @cached_property
    def key(self) -> str:
        """Hash of the identity: a result is found again by it, and by nothing else."""
        return digest(self.identity)

    def __str__(self) -> str:
        return f"{self.case} · {self.sampler.label} · {self.budget} · seed {self.seed}"
