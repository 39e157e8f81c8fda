"""Checks of a lighting at the time of a run, cheap enough for every one that is measured.

Lights check themselves when they are made (`lighting.py`). What remains is whether a sampler kept
to its budget, whether it returned a lighting at all, and whether a distribution is one: of a
density that is not, the renderer would make a wrong image without a word. `conformance.py` is
stricter.
"""

import math

import numpy as np
from numpy.typing import NDArray

from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import DirectionalLights, DiscLights, LayeredLights, LightDistribution
from samplers.sphere import direction_from_uv

SAMPLES = 4096
UNIT, AGREEMENT, INTEGRAL = 1e-4, 1e-2, 0.05
"""Allowed error of a direction's length, of `pdf` against the density that comes with a sample, and
of the density's integral. Densities that are constant in each texel integrate exactly; 5 % leaves
room for others, which midpoints of texels meet less well."""
DISAGREEING = 1e-2
"""Share of samples whose densities may disagree: those that rounding puts over an edge."""
ROWS_AT_ONCE = 64


def check_lighting(lighting: object, environment: EnvironmentMap, count: int) -> None:
    """Raise EnvlightError with what is wrong with the lighting of a map at a budget of `count`."""
    match lighting:
        case LayeredLights():
            parts = (lighting.direct, lighting.indirect)
            if not all(isinstance(part, DirectionalLights) for part in parts):
                raise EnvlightError("lighting: a layer is not DirectionalLights")
            _check_number(sum(map(len, parts)), count)
        case DirectionalLights():
            _check_number(max(map(len, lighting.sets)), count)
        case DiscLights():
            _check_number(len(lighting), count)
        case LightDistribution():
            _check_number(lighting.count, count)
            _check_samples(lighting)
            _check_integral(lighting, environment)
        case _:
            raise EnvlightError(
                f"lighting: the sampler returned {type(lighting).__name__}; wanted "
                "DirectionalLights, LayeredLights, DiscLights or a LightDistribution"
            )


def _check_number(number: int, count: int) -> None:
    if number > count:
        raise EnvlightError(f"lighting: {number} lights or samples for a budget of {count}")


def _check_samples(lighting: LightDistribution) -> None:
    u = np.random.default_rng(0).random((SAMPLES, 3), np.float32)
    drawn = lighting.sample(u)
    if not isinstance(drawn, tuple) or len(drawn) != 2:
        raise EnvlightError("lighting: sample() must return directions and densities")
    direction, pdf = (np.asarray(array) for array in drawn)
    _check_shape("directions of sample()", direction, (SAMPLES, 3))
    _check_shape("densities of sample()", pdf, (SAMPLES,))
    length = np.linalg.norm(direction, axis=1)
    if not (np.abs(length - 1.0) <= UNIT).all():  # NaN is no less wrong
        raise EnvlightError("lighting: a direction of sample() is not of unit length")
    if not (np.isfinite(pdf) & (pdf > 0.0)).all():
        raise EnvlightError("lighting: a density of sample() is not a positive number")
    again = np.asarray(lighting.pdf(direction))
    _check_shape("densities of pdf()", again, (SAMPLES,))
    if (~np.isclose(again, pdf, rtol=AGREEMENT)).mean() > DISAGREEING:
        raise EnvlightError("lighting: pdf() disagrees with the densities of sample()")


def _check_shape(what: str, array: NDArray, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise EnvlightError(f"lighting: {what} have shape {array.shape}, wanted {shape}")


def _check_integral(lighting: LightDistribution, environment: EnvironmentMap) -> None:
    """The density over the sphere, by its values at the middle of each texel."""
    height, width = environment.height, environment.width
    across = (np.arange(width) + 0.5) / width
    total = 0.0
    for first in range(0, height, ROWS_AT_ONCE):
        rows = np.arange(first, min(first + ROWS_AT_ONCE, height))
        direction = direction_from_uv(across[None], (rows[:, None] + 0.5) / height)
        pdf = np.asarray(lighting.pdf(direction.reshape(-1, 3).astype(np.float32)), np.float64)
        if not (pdf >= 0.0).all():
            raise EnvlightError("lighting: a density of pdf() is negative or NaN")
        total += float(
            pdf.reshape(len(rows), width).sum(axis=1) @ environment.row_solid_angle[rows]
        )
    if not math.isclose(total, 1.0, abs_tol=INTEGRAL):
        raise EnvlightError(f"lighting: the density integrates to {total:.4g} instead of 1")
