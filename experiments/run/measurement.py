"""A measurement: a sampler at a budget with a seed on a case, and what determines its row.

Three things are told apart, so that a change touches what depends on it and nothing else: the
reference (`Case.reference_key`), the image (`Measurement.key`), and the score of an image by one
metric (`Measurement.score_keys`). A changed sampler leaves references alone; a changed metric
renders nothing.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.identity import digest, library_versions, module_digest, source_digest
from experiments.run.machine import machine_identity
from experiments.run.sampler_choice import single_sampler
from experiments.run.sampler_spec import SamplerSpec
from metrics.registry import Metric, metrics
from samplers import EnvlightError

RENDERING, JUDGING = "experiments.run.rendering", "experiments.run.judging"
"""Their own files count; what they import stands in the identities under names of its own."""
TIMING = tuple(
    f"experiments.run.{name}" for name in ("timed", "cost_model", "count_search", "bench")
)
"""Decide about measurements with a budget of seconds; so does the machine."""


@dataclass(frozen=True)
class Measurement:
    """One sampler at one budget with one seed on one case."""

    case: Case
    sampler: SamplerSpec
    budget: Budget
    seed: int

    @cached_property
    def identity(self) -> dict[str, Any]:
        """What determines the image."""
        return self.identity_on(self.case.identity)

    def identity_on(self, case: dict[str, Any]) -> dict[str, Any]:
        """The same on a case of this identity."""
        return {
            "case": case,
            "sampler": self.sampler.identity,
            "budget": str(self.budget),
            "seed": self.seed,
            "sets": self.case.scale.sets,
            "renderer_source": source_digest("renderer.render"),
            "rendering_source": module_digest(RENDERING),
            "libraries": library_versions("renderer.render"),
            **self._budget_identity(),
            **({"like": self.like.key} if self.budget.like else {}),
        }

    @cached_property
    def like(self) -> "Measurement":
        """The measurement of the same case whose spending the budget is; its seed is 0."""
        if self.budget.at is None:
            raise EnvlightError(f"budget '{self.budget}': it is not what a sampler spends")
        return Measurement(self.case, single_sampler(self.budget.like), self.budget.at, 0)

    def _budget_identity(self) -> dict[str, Any]:
        """How a count is found that no budget of lights gives."""
        if self.budget.timed:
            sources = [module_digest(module) for module in TIMING]
            return {"budget_source": sources, "machine": machine_identity()}
        if self.budget.kind == "rays":
            return {"budget_source": source_digest("experiments.run.ray_budget")}
        return {}

    @cached_property
    def key(self) -> str:
        """Hash of the identity: an image and its row are found again by it, and by nothing else."""
        return digest(self.identity)

    def score_identity(self, metric: Metric) -> dict[str, Any]:
        """What determines the image's value by a metric."""
        return {
            "image": self.key,
            "reference": self.case.reference_key,
            "metric": metric.name,
            "metric_source": source_digest(metric.module),
            "judging_source": module_digest(JUDGING),
            "libraries": library_versions(metric.module),
        }

    @cached_property
    def score_keys(self) -> dict[str, str]:
        """The key of the score by each metric, by the metric's name."""
        return {metric.name: digest(self.score_identity(metric)) for metric in metrics()}

    def __str__(self) -> str:
        return f"{self.case} · {self.sampler.label} · {self.budget} · seed {self.seed}"
