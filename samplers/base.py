"""The interface that every sampler implements, and the decorator that gives it a name.

A new sampler is one file: a frozen dataclass that derives from `LightSampler`, implements
`_prepare`, and is decorated with `register("its-name")`.
"""

import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.independent_sets import independent_sets
from samplers.lighting import Lighting
from samplers.reference import Reference

NAME = r"[A-Za-z0-9][\w.-]*"
REGISTERED: dict[str, type["LightSampler"]] = {}
"""The classes that are known by name; `samplers.registry` finds them."""
LABELS: dict[str, str] = {}
"""By name the labels of these, of classes in files that were named, and what runs recorded."""


@dataclass(frozen=True)
class Reading:
    """One way to read what a method's paper leaves open.

    choice : in words
    parameters : what it sets, by name; those of the default among them
    ruled_out : why it cannot be the default, however small its error
    """

    choice: str
    parameters: Mapping[str, Any]
    ruled_out: str = ""


@dataclass(frozen=True)
class LightSampler(ABC):
    """From an environment map to a lighting.

    The dataclass fields are the method's parameters, with the paper's defaults. A sampler keeps no
    state, does no I/O and prints nothing. One of fixed lights that has a field `sets`, "perturbed"
    or "independent", says by it where interleaved sampling's sets come from
    (`samplers.independent_sets`).

    A field's metadata say what the experiment `readings` makes of it: `readings`, values that are
    compared with its default, `ruled_out`, by value why it cannot be the default however small its
    error, or `fixed`, why it is no open choice.

    name : set by `register`
    label : what tables and plots call it, with author and year; the name where a class has none
    references : what it is cited by, the method's own first
    stochastic : whether the lighting depends on the random generator; such samplers are measured
        with several seeds
    minimum_count : smallest budget that the method can meet; parameters may raise an object's own
    in_all_tables : whether comparisons of all methods have it; not so for one that varies another,
        as renderers' tables do, which a comparison of their own has
    readings : those with words of their own, or of several parameters, that of the default among
        them; of a `Literal` or `bool` that none names, every value is one
    costly : parameters that change what an image costs; they are compared at equal cost
    """

    name: ClassVar[str] = ""
    label: ClassVar[str] = ""
    references: ClassVar[tuple[Reference, ...]] = ()
    stochastic: ClassVar[bool] = False
    minimum_count: ClassVar[int] = 1
    in_all_tables: ClassVar[bool] = True
    readings: ClassVar[tuple[Reading, ...]] = ()
    costly: ClassVar[tuple[str, ...]] = ()

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
        if getattr(self, "sets", "perturbed") != "independent":
            return self._prepare(environment, int(count), rng)
        return independent_sets(
            lambda turned: self._prepare(turned, int(count), rng),  # type: ignore[arg-type, return-value]
            environment,
        )

    @abstractmethod
    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> Lighting: ...


def register(name: str) -> Callable[[type[LightSampler]], type[LightSampler]]:
    """Class decorator: make a sampler known under `name`.

    Raises EnvlightError for a name that is taken, or that could not stand in a file's name.
    """
    if not re.fullmatch(NAME, name):
        raise EnvlightError(
            f"'{name}' cannot be a sampler's name; use letters, digits, '-', '_' and '.'"
        )

    def add(cls: type[LightSampler]) -> type[LightSampler]:
        known = REGISTERED.get(name)
        if known is not None and _place(known) != _place(cls):
            raise EnvlightError(
                f"two samplers are called '{name}': {' and '.join(map(_place, (known, cls)))}; "
                "register one under another name"
            )
        cls.name, cls.label = name, vars(cls).get("label", name)
        REGISTERED[name], LABELS[name] = cls, cls.label
        return cls

    return add


def _place(cls: type[LightSampler]) -> str:
    return f"{cls.__qualname__} in {getattr(sys.modules.get(cls.__module__), '__file__', '?')}"
