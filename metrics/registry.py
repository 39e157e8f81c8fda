"""Metrics as data: what an image is judged by, and the registry that tables, ranks and plots ask.

A metric is one `Metric`, registered in the file that computes it:

    register(Metric("mean_error", "mean error", lambda image, truth: float(...)))

Every module of this package is read for metrics, so that adding one touches one file. Its value
stands in every row under its name; where `ranked` is set, tables, ranks, tests and plots have it.
"""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.truth import Image, Truth
from samplers.errors import EnvlightError

Better = Literal["less", "more"]


@dataclass(frozen=True)
class Metric:
    """What tells how far an image is from its reference.

    name : its column in the rows, an identifier
    label : what tables and plots call it
    function : from the exposed image, (H, W, 3) float32, the truth, and what `needs` made
    better : whether a smaller or a larger value is the better one
    needs : what is made once of the truth and kept for all images of a case
    ranked : whether samplers are ranked by it; less must be better then
    leads : whether tables are sorted by its ranks
    floor : the value that the reference's own noise has; NaN where it is not known
    facts : further columns, the same for all images of a case
    error_map : from the same as `function`, (H, W) in [0, 1], how each pixel errs
    digits : decimals that tables print
    """

    name: str
    label: str
    function: Callable[..., float]
    better: Better = "less"
    needs: tuple[Callable[[Truth], Any], ...] = ()
    ranked: bool = False
    leads: bool = False
    floor: Callable[[Truth], float] | None = None
    facts: Callable[[Truth], dict[str, Any]] | None = None
    error_map: Callable[..., NDArray[np.float32]] | None = None
    digits: int = 4

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise EnvlightError(f"metric '{self.name}': its name is a column; use an identifier")
        if self.ranked and self.better != "less":
            raise EnvlightError(
                f"metric '{self.name}': ranks are by errors, of which less is better; rank by "
                "what is left to the best value"
            )

    def __reduce__(self) -> tuple:
        """Other processes know it by its name."""
        return find_metric, (self.name,)

    @property
    def module(self) -> str:
        """The module whose source, with all that it imports, determines the values."""
        return self.function.__module__

    @property
    def floor_column(self) -> str:
        """The column of the value that the reference's own noise has."""
        return f"{self.name}_floor"

    @property
    def near_column(self) -> str:
        """The column that says whether the value lies within `NEAR` times its floor."""
        return f"{self.name}_near_floor"

    def map_of(self, image: Image, truth: Truth) -> NDArray[np.float32]:
        """The error map of an exposed image; there has to be a function for it."""
        if self.error_map is None:
            raise EnvlightError(f"metric '{self.name}': it has no error map; give it `error_map`")
        return self.error_map(image, truth, *(truth.made(need) for need in self.needs))

    def columns(self, image: Image, truth: Truth) -> dict[str, Any]:
        """What a row says of an exposed image by this metric."""
        value = self.function(image, truth, *(truth.made(need) for need in self.needs))
        found: dict[str, Any] = {self.name: value}
        if self.floor is not None:
            floor = truth.made(self.floor)
            found |= {self.floor_column: floor, self.near_column: value < NEAR * floor}
        if self.facts is not None:
            found |= truth.made(self.facts)
        return found


NEAR = 3.0
"""A value within this factor of its floor is marked: nothing is ranked by it in words."""
_registry: dict[str, Metric] = {}


def register(metric: Metric) -> Metric:
    """Make a metric known by its name; EnvlightError where another has it."""
    known = _registry.get(metric.name)
    if known is not None and known.function.__module__ != metric.function.__module__:
        raise EnvlightError(f"two metrics are called '{metric.name}'; rename one")
    _registry[metric.name] = metric
    return metric


@cache
def _load_all() -> None:
    package = importlib.import_module("metrics")
    for module in pkgutil.iter_modules(package.__path__, "metrics."):
        importlib.import_module(module.name)


def metrics() -> tuple[Metric, ...]:
    """All metrics: first those that are ranked, of which the leading one is last, then by name."""
    _load_all()
    return tuple(sorted(_registry.values(), key=lambda one: (not one.ranked, one.leads, one.name)))


def ranked_metrics() -> tuple[Metric, ...]:
    """The metrics by which samplers are ranked, in the order of a table's columns."""
    return tuple(metric for metric in metrics() if metric.ranked)


def leading_metric() -> Metric:
    """The metric by whose ranks tables are sorted."""
    return next(metric for metric in ranked_metrics() if metric.leads)


def find_metric(name: str) -> Metric:
    """The metric called `name`; EnvlightError with the known names otherwise."""
    _load_all()
    if name not in _registry:
        known = ", ".join(metric.name for metric in metrics())
        raise EnvlightError(f"no metric is called '{name}'; use {known}")
    return _registry[name]
