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

import numpy as np
from numpy.typing import NDArray

from samplers.environment import EnvironmentMap
from samplers.lighting import SETS, DirectionalLights, LayeredLights

Prepare = Callable[[EnvironmentMap], DirectionalLights | LayeredLights]


def independent_sets(
    prepare: Prepare, environment: EnvironmentMap
) -> DirectionalLights | LayeredLights:
    """The lighting of `prepare`, with those of seven calls more as its further sets."""
    found = [prepare(environment)]
    for k in range(1, SETS):
        columns = round(k * environment.width * GOLDEN) % environment.width
        found.append(_turned(prepare, environment, columns))
    first = found[0]
    if isinstance(first, DirectionalLights):
        return _joined([one for one in found if isinstance(one, DirectionalLights)])
    layers = [one for one in found if isinstance(one, LayeredLights)]
    return replace(
        first,
        direct=_joined([one.direct for one in layers]),
        indirect=_joined([one.indirect for one in layers]),
    )


GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""Turns of so much of a circle lie evenly and repeat nowhere: no symmetry of a method's regions,
halves of the map above all, comes back."""


def _turned(
    prepare: Prepare, environment: EnvironmentMap, columns: int
) -> DirectionalLights | LayeredLights:
    """The lighting of the map moved by so many columns, moved back."""
    radiance = np.roll(environment.radiance, columns, axis=1)
    lighting = prepare(replace(environment, radiance=radiance))
    angle = -2.0 * math.pi * columns / environment.width
    if isinstance(lighting, DirectionalLights):
        return _rotated(lighting, angle)
    return replace(
        lighting,
        direct=_rotated(lighting.direct, angle),
        indirect=_rotated(lighting.indirect, angle),
    )


def _rotated(lights: DirectionalLights, angle: float) -> DirectionalLights:
    """The lights at an azimuth larger by `angle` (φ = atan2(x, −z))."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y, z = lights.direction.T
    direction: NDArray[np.float64] = np.stack(
        [cosine * x - sine * z, y, sine * x + cosine * z], axis=1
    )
    return replace(lights, direction=direction)


def _joined(sets: list[DirectionalLights]) -> DirectionalLights:
    return replace(sets[0], further_sets=tuple(sets[1:]))
