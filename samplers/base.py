"""The interface that every sampler implements, and the registry that finds samplers by name.

A new sampler is one file: a frozen dataclass that derives from `LightSampler`, implements
`_prepare`, and is decorated with `register("its-name")`. Modules of this package are found by
themselves; other packages announce theirs through the entry-point group `envlight.samplers`.
"""

import difflib
import importlib
import math
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from importlib.metadata import entry_points
from types import UnionType
from typing import Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import Lighting

ENTRY_POINT_GROUP = "envlight.samplers"
_registry: dict[str, type["LightSampler"]] = {}


@dataclass(frozen=True)
class LightSampler(ABC):
    """From an environment map to a lighting.

    The dataclass fields are the method's parameters, with the paper's defaults. A sampler keeps no
    state, does no I/O and prints nothing.

    name : set by `register`
    stochastic : whether the lighting depends on the random generator; such samplers are measured
        with several seeds
    minimum_count : smallest budget that the method can meet
    """

    name: ClassVar[str] = ""
    stochastic: ClassVar[bool] = False
    minimum_count: ClassVar[int] = 1

    def prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> Lighting:
        """The lighting that stands for `environment` at `count` lights per shading point.

        count : budget, lights or samples evaluated per shading point. A method may return fewer
            lights where it says so, never more.
        rng : the only source of randomness; the same seed gives the same bits.

        Raises EnvlightError for a budget below `minimum_count`.
        """
        if count < self.minimum_count:
            raise EnvlightError(
                f"{self.name}: a budget of {count}; use at least {self.minimum_count}"
            )
        return self._prepare(environment, int(count), rng)

    @abstractmethod
    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> Lighting: ...


def register(name: str) -> Callable[[type[LightSampler]], type[LightSampler]]:
    """Class decorator: make a sampler known under `name`."""

    def add(cls: type[LightSampler]) -> type[LightSampler]:
        known = _registry.get(name)
        if known is not None and known.__qualname__ != cls.__qualname__:
            raise EnvlightError(f"two samplers are called '{name}': {known!r} and {cls!r}")
        cls.name = name
        _registry[name] = cls
        return cls

    return add


@cache
def _load_all() -> None:
    package = importlib.import_module("samplers")
    for module in pkgutil.iter_modules(package.__path__, "samplers."):
        importlib.import_module(module.name)
    for point in entry_points(group=ENTRY_POINT_GROUP):
        register(point.name)(point.load())


def sampler_names() -> list[str]:
    """The names of all registered samplers, sorted."""
    _load_all()
    return sorted(_registry)


def sampler_class(name: str) -> type[LightSampler]:
    """The class registered under `name`; EnvlightError with the nearest names otherwise."""
    _load_all()
    if name not in _registry:
        near = difflib.get_close_matches(name, _registry, n=3, cutoff=0.4) or sampler_names()
        raise EnvlightError(f"no sampler is called '{name}'; did you mean {', '.join(near)}?")
    return _registry[name]


def make_sampler(name: str, **parameters: Any) -> LightSampler:
    """The sampler registered under `name` with the given parameters, the paper's otherwise."""
    cls = sampler_class(name)
    known = [field.name for field in fields(cls)]
    unknown = [key for key in parameters if key not in known]
    if unknown:
        raise EnvlightError(
            f"sampler '{name}' has no parameter '{unknown[0]}'; "
            f"it has {', '.join(known) if known else 'none'}"
        )
    hints = get_type_hints(cls)
    return cls(**{key: _fitted(name, key, value, hints[key]) for key, value in parameters.items()})


def _fitted(sampler: str, parameter: str, value: Any, hint: Any) -> Any:
    """`value` where it is of the parameter's type, whole numbers as floats where those are wanted.

    Raises EnvlightError with what the parameter takes. Ranges are the sampler's own to check.
    """
    value = value.item() if isinstance(value, np.generic) else value
    kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    for kind in kinds:
        if get_origin(kind) is Literal:
            if any(value == choice and type(value) is type(choice) for choice in get_args(kind)):
                return value
        elif kind is float and type(value) in (int, float):
            if math.isfinite(value):
                return float(value)
        elif not isinstance(kind, type) or type(value) is kind:
            return value
    raise EnvlightError(
        f"sampler '{sampler}': {parameter}={value!r}; use {' or '.join(map(_wanted, kinds))}"
    )


def _wanted(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return ", ".join(map(str, get_args(kind)))
    names = {int: "a whole number", float: "a number", bool: "True or False", type(None): "None"}
    return names.get(kind, getattr(kind, "__name__", str(kind)))
