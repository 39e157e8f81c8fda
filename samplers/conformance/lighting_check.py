"""Checks of a lighting at the time of a run, cheap enough for every one that is measured.

Lights check themselves when they are made (`lighting.py`). What remains is whether a sampler kept
to its budget, whether it returned a lighting at all, and whether a distribution is one: of a
density that is not, the renderer would make a wrong image without a word. `conformance.py` is
stricter.
"""

import math
import os
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager, redirect_stdout

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import (
    DirectionalLights,
    DiscLights,
    LayeredLights,
    LightDistribution,
    Lighting,
    SurfaceDistribution,
)
from samplers.sphere import direction_from_uv, pixel_of_direction

SAMPLES = 4096
UNIT, AGREEMENT, INTEGRAL = 1e-4, 1e-2, 0.05
"""Allowed error of a direction's length, of `pdf` against the density that comes with a sample, and
of the density's integral. Densities that are constant in each texel integrate exactly; 5 % leaves
room for others, which points in texels meet less well."""
PROBES = 1 << 15
"""Samples that show where the density is."""
FEW_PARTS, MANY_PARTS, OFTEN = 4, 32, 64
"""Points along each side of a texel in which probes fall, and in which at least so many do."""
TEXELS_AT_ONCE = 256
DISAGREEING = 1e-2
"""Share of samples whose densities may disagree: those that rounding puts over an edge."""
ROWS_AT_ONCE = 64


@contextmanager
def contained() -> Iterator[None]:
    """What a sampler of anybody's does inside: the folder and NumPy's errors are as before, for
    others; what it prints is no result, and goes to stderr; a copy of the process that it makes
    ends here."""
    process = os.getpid()
    try:
        with chdir("."), np.errstate(), redirect_stdout(sys.stderr):
            yield
    finally:
        if os.getpid() != process:
            os._exit(1)


def prepared(
    sampler: LightSampler, environment: EnvironmentMap, count: int, rng: np.random.Generator
) -> Lighting:
    """What a sampler of anybody's makes of a map, checked."""
    with contained():
        lighting = sampler.prepare(environment, count, rng)
        check_lighting(lighting, environment, count)
    return lighting


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
        case SurfaceDistribution():  # its samples are checked where they are drawn
            _check_number(lighting.count, count)
        case LightDistribution():
            _check_number(lighting.count, count)
            _check_samples(lighting)
            _check_integral(lighting, environment)
        case _:
            raise EnvlightError(
                f"lighting: the sampler returned {type(lighting).__name__}; wanted "
                "DirectionalLights, LayeredLights, DiscLights, a LightDistribution or a "
                "SurfaceDistribution"
            )


def _check_number(number: object, count: int) -> None:
    if not isinstance(number, int | np.integer) or not 0 <= number <= count:
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
    """The density over the sphere: finer where samples fall, once at the middle of other texels."""
    drawn, _ = lighting.sample(np.random.default_rng(1).random((PROBES, 3), np.float32))
    row, column = pixel_of_direction(drawn, environment.height)
    texel, number = np.unique(row * environment.width + column, return_counts=True)
    total = _coarse_integral(lighting, environment, texel)
    for often, parts in ((False, FEW_PARTS), (True, MANY_PARTS)):
        chosen = texel[(number >= OFTEN) == often]
        for first in range(0, len(chosen), TEXELS_AT_ONCE):
            total += _fine_integral(
                lighting, environment, chosen[first : first + TEXELS_AT_ONCE], parts
            )
    if not math.isclose(total, 1.0, abs_tol=INTEGRAL):
        raise EnvlightError(f"lighting: the density integrates to {total:.4g} instead of 1")


def _densities(lighting: LightDistribution, u: NDArray, v: NDArray) -> NDArray[np.float64]:
    direction = direction_from_uv(u, v)
    pdf = np.asarray(lighting.pdf(direction.reshape(-1, 3).astype(np.float32)), np.float64)
    if not (pdf >= 0.0).all():
        raise EnvlightError("lighting: a density of pdf() is negative or NaN")
    return pdf.reshape(direction.shape[:-1])


def _coarse_integral(
    lighting: LightDistribution, environment: EnvironmentMap, left_out: NDArray[np.int64]
) -> float:
    """By the middle of each texel but those left out."""
    height, width = environment.height, environment.width
    across, total = (np.arange(width) + 0.5) / width, 0.0
    counted = np.ones(height * width, np.bool_)
    counted[left_out] = False
    for first in range(0, height, ROWS_AT_ONCE):
        rows = np.arange(first, min(first + ROWS_AT_ONCE, height))
        pdf = _densities(lighting, across[None], (rows[:, None] + 0.5) / height)
        used = counted[first * width : (rows[-1] + 1) * width].reshape(pdf.shape)
        total += float((pdf * used).sum(axis=1) @ environment.row_solid_angle[rows])
    return total


def _fine_integral(
    lighting: LightDistribution, environment: EnvironmentMap, texel: NDArray[np.int64], parts: int
) -> float:
    """Over the texels (n,), by parts² midpoints in each."""
    height, width = environment.height, environment.width
    row, column = texel[:, None, None] // width, texel[:, None, None] % width
    fraction = (np.arange(parts) + 0.5) / parts
    v = (row + fraction[:, None]) / height
    pdf = _densities(lighting, (column + fraction) / width, v)
    # A texel's solid angle is shared out by sin θ.
    weight = np.sin(math.pi * v)
    weight /= weight.sum(axis=1, keepdims=True) * parts
    return float((pdf * weight).sum(axis=(1, 2)) @ environment.row_solid_angle[row[:, 0, 0]])
