"""Eight sets of a method's own for interleaved sampling, in place of one set that is perturbed.

Kollig and Keller, "Efficient illumination by high dynamic range images", EGSR 2003, use several
independent sets in turn over a pattern of pixels; Wu, "Efficient environment map rendering based on
decomposition", 2025, 3.5, perturbs one. Here each set has random numbers of its own, where a
method draws any, and is made from the map turned about the vertical by another angle, whose lights
are turned back, so that regions lie elsewhere.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from samplers.environment import EnvironmentMap
from samplers.lighting import SETS, DirectionalLights, LayeredLights

Lights = DirectionalLights | LayeredLights
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""Turns of so much of a circle lie evenly and repeat nowhere: no symmetry of a method's regions,
halves of the map above all, comes back."""


def independent_sets(
    prepare: Callable[[EnvironmentMap], Lights], environment: EnvironmentMap
) -> Lights:
    """The lighting of `prepare`, with those of seven calls more as its further sets."""
    found = [prepare(environment)]
    for k in range(1, SETS):
        columns = round(k * environment.width * GOLDEN) % environment.width
        turned = replace(environment, radiance=np.roll(environment.radiance, columns, axis=1))
        back = -2.0 * math.pi * columns / environment.width
        found.append(_by_layer(partial(_rotated, angle=back), prepare(turned)))
    return _by_layer(_joined, *found)


def _by_layer(change: Callable[..., DirectionalLights], first: Lights, *others: Any) -> Lights:
    """What `change` makes of lightings of one kind, or of each of their layers."""
    if isinstance(first, DirectionalLights):
        return change(first, *others)
    return replace(
        first,
        direct=change(first.direct, *(one.direct for one in others)),
        indirect=change(first.indirect, *(one.indirect for one in others)),
    )


def _rotated(lights: DirectionalLights, angle: float) -> DirectionalLights:
    """The lights at an azimuth larger by `angle` (φ = atan2(x, −z))."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y, z = lights.direction.T
    direction = np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=1)
    return replace(lights, direction=direction)


def _joined(first: DirectionalLights, *others: DirectionalLights) -> DirectionalLights:
    return replace(first, further_sets=others)
