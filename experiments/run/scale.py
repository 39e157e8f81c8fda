"""Scales: how large and how exact an experiment is."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

from samplers import EnvlightError

QUICK = "quick"
Entry = TypeVar("Entry")


@dataclass(frozen=True)
class Scale:
    """Image size, reference quality and map size of a run.

    noise_target : reference RMSE in units of the foreground's mean luminance
    max_samples : reference samples per shading point at most
    map_height : rows of maps that are made from code
    sets : interleaved sets of global lights that pixels use in turn, 1 for the same at all of them
    """

    name: str
    width: int
    height: int
    subpixels: int
    noise_target: float
    max_samples: int
    map_height: int
    budgets: tuple[int, ...]
    sets: int = 8

    def with_noise(self, target: float) -> "Scale":
        """The same with references to another noise, and as many more samples as that takes."""
        more = max(1.0, (self.noise_target / target) ** 2)
        return replace(self, noise_target=target, max_samples=math.ceil(self.max_samples * more))


SCALES = {
    scale.name: scale
    for scale in (
        Scale(QUICK, 160, 120, 4, 0.02, 1024, 256, (16,)),
        Scale("medium", 320, 240, 4, 0.01, 4096, 512, (8, 16, 32, 64)),
        Scale("standard", 640, 480, 4, 0.01, 4096, 512, (8, 16, 32, 64)),
        Scale("paper", 1600, 1200, 4, 0.01, 8192, 1024, (8, 16, 32, 64)),
    )
}


def find_scale(name: str) -> Scale:
    """The scale called `name`; EnvlightError with the known names otherwise."""
    if name not in SCALES:
        raise EnvlightError(f"no scale is called '{name}'; use {', '.join(SCALES)}")
    return SCALES[name]


def references_to(noises: Mapping[str, float]) -> Callable[[Scale], Scale]:
    """Scales with references to the noise that `noises` has for them, in units of the mean."""
    return lambda scale: scale.with_noise(of_scale(noises, scale.name))


def without_interleaving(change: Callable[[Scale], Scale]) -> Callable[[Scale], Scale]:
    """Scales as `change` makes them, with one set of global lights for all pixels."""
    return lambda scale: replace(change(scale), sets=1)


def of_scale(table: Mapping[str, Entry], name: str) -> Entry:
    """The entry of a scale, or of the next smaller one that the table has."""
    names = list(SCALES)
    smaller = names[: names.index(find_scale(name).name) + 1]
    return table[next(one for one in reversed(smaller) if one in table)]
