"""Finding samplers by name, and making one with parameters.

Modules of this package are found by themselves; other packages announce theirs through the
entry-point group `envlight.samplers`; a class in a file of the user's own goes by FILE:CLASS
wherever a name does.
"""

import difflib
import importlib
import importlib.util
import math
import pkgutil
from dataclasses import MISSING, Field, fields
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from samplers.base import LABELS, REGISTERED, LightSampler, register
from samplers.errors import EnvlightError
from samplers.files.from_file import is_file_reference, load_class
from samplers.files.plug_in_files import watch

ENTRY_POINT_GROUP = "envlight.samplers"


@cache
def _load_all() -> None:
    package = importlib.import_module("samplers")
    for module in pkgutil.iter_modules(package.__path__, "samplers."):
        importlib.import_module(module.name)
    for point in entry_points(group=ENTRY_POINT_GROUP):
        try:
            _watch_package(point.module)
            found = point.load()
        except (Exception, SystemExit) as error:  # whatever another package's import may raise
            raise EnvlightError(
                f"sampler '{point.name}': {point.value} cannot be loaded "
                f"({type(error).__name__}: {error}); mend or uninstall the package"
            ) from error
        if not (isinstance(found, type) and issubclass(found, LightSampler)):
            raise EnvlightError(
                f"sampler '{point.name}': {point.value} is not a LightSampler; mend the entry point"
            )
        register(point.name)(found)


def _watch_package(module: str) -> None:
    spec = importlib.util.find_spec(module.partition(".")[0])
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        watch(Path(folder))


def sampler_names() -> list[str]:
    """The names of all registered samplers, sorted."""
    _load_all()
    return sorted(REGISTERED)


def sampler_labels() -> dict[str, str]:
    """All labels that are known here, by name."""
    _load_all()
    return LABELS


def sampler_class(name: str) -> type[LightSampler]:
    """The class registered under `name`, or the one that FILE:CLASS names.

    Raises EnvlightError with the nearest names where there is none, or with what is wrong with the
    file.
    """
    _load_all()
    if is_file_reference(name):
        return load_class(name)
    if name not in REGISTERED:
        near = difflib.get_close_matches(name, REGISTERED, n=3, cutoff=0.4) or sampler_names()
        raise EnvlightError(f"no sampler is called '{name}'; did you mean {', '.join(near)}?")
    return REGISTERED[name]


def make_sampler(name: str, **parameters: Any) -> LightSampler:
    """The sampler called `name`, or FILE:CLASS, with the given parameters, the paper's otherwise.

    Raises EnvlightError where there is no such sampler or parameter, or a value does not fit.
    """
    cls = sampler_class(name)
    known = [field.name for field in fields(cls)]
    unknown = [key for key in parameters if key not in known]
    if unknown:
        raise EnvlightError(
            f"sampler '{name}' has no parameter '{unknown[0]}'; "
            f"it has {', '.join(known) if known else 'none'}"
        )
    needed = [field.name for field in fields(cls) if _has_no_default(field)]
    missing = [key for key in needed if key not in parameters]
    if missing:
        raise EnvlightError(f"sampler '{name}': parameter '{missing[0]}' has no default; give one")
    hints = get_type_hints(cls)
    given = {key: _fitted(name, key, value, hints[key]) for key, value in parameters.items()}
    sampler = cls(**given)
    if not isinstance(sampler.minimum_count, int | np.integer):
        raise EnvlightError(f"sampler '{name}': its minimum_count is no whole number; give one")
    return sampler


def _has_no_default(field: Field) -> bool:
    return field.init and field.default is MISSING and field.default_factory is MISSING


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
