"""Experiments by their names; what they are made of is loaded with the first that is used."""

import difflib
import importlib
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from samplers.errors import EnvlightError

if TYPE_CHECKING:
    from experiments.run.experiment import Experiment

ROOMS = ("wu2025", "ergun2012", "arbree2005", "wan2005", "questions")
"""The packages whose modules are read for experiments, in the order of `envlight list`."""
Kind = TypeVar("Kind", bound="Experiment")
_registry: dict[str, Callable[[], Any]] = {}


def experiment(name: str) -> Callable[[Callable[[], Kind]], Callable[[], Kind]]:
    """Register a function that gives an experiment; its docstring's first line describes it.

    The function is called when the experiment is first asked for, so that it may stand before what
    it names.
    """

    def register(make: Callable[[], Kind]) -> Callable[[], Kind]:
        known = _registry.get(name)
        if known is not None and known.__module__ != make.__module__:
            raise EnvlightError(f"two experiments are called '{name}'; rename one")

        @cache
        @wraps(make)
        def made() -> Kind:
            summary = (make.__doc__ or "").strip().partition("\n")[0]
            return replace(make(), name=name, summary=summary)

        _registry[name] = made
        return made

    return register


DECLARED = re.compile(r'@experiment\(("?)([\w-]+)\1\)\ndef \w+\(\)[^\n]*:\n    """([^\n"]*)')
FIGURE = re.compile(r'PaperFigure\(\s*"([^"]+)"')


@cache
def _declared() -> dict[str, tuple[str, str, list[str]]]:
    """Module, summary and papers' figures of the experiments in the rooms, as their sources say:
    they are known without loading what all of them need.
    """
    root = Path(__file__).parents[1]
    found: dict[str, tuple[str, str, list[str]]] = {}
    for path in (path for room in ROOMS for path in sorted((root / room).rglob("*.py"))):
        text = path.read_text(encoding="utf-8")
        module = ".".join(path.relative_to(root.parent).with_suffix("").parts)
        figures = FIGURE.findall(text)
        for quote, name, summary in DECLARED.findall(text):
            constant = re.search(rf'^{name} = "([^"]+)"', text, re.MULTILINE)
            found[name if quote or constant is None else constant[1]] = module, summary, figures
    return found


def experiment_names() -> list[str]:
    """All names, room by room."""
    return list(dict.fromkeys((*_declared(), *_registry)))


def summary_of(name: str) -> str:
    """What an experiment is about, as `envlight list` prints it."""
    return _declared()[name][1] if name in _declared() else find_experiment(name).summary


def figures_of(name: str) -> list[str]:
    """The numbers of the tables and figures of its paper that an experiment makes."""
    if name in _declared():
        return _declared()[name][2]
    return [one.number for one in find_experiment(name).figures]


def experiments_in(room: str) -> list[str]:
    """The experiments of one of `ROOMS`."""
    return [name for name, (module, *_) in _declared().items() if module.split(".")[1] == room]


def find_experiment(name: str) -> "Experiment":
    """The experiment called `name`; EnvlightError with the nearest names for an unknown one."""
    if name in _declared():
        importlib.import_module(_declared()[name][0])
    if name not in _registry:
        known = experiment_names()
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.4) or known
        raise EnvlightError(f"no experiment is called '{name}'; did you mean {', '.join(near)}?")
    return _registry[name]()


def room_of(name: str) -> str:
    """The room of an experiment that is known: one of `ROOMS`."""
    if name in _declared():
        return _declared()[name][0].split(".")[1]
    find_experiment(name)
    return _registry[name].__module__.split(".")[1]
