"""Filtered importance sampling: few BRDF samples, each of which reads the map blurred to its size.

A sample of density p among N stands for the solid angle 1/(N p). Where that is larger than a texel
the map is read from the level of a mip pyramid whose texels are as large, so that N samples cover
the whole lobe and no small bright light is missed between them. Nothing is traced: the method is
for previews and games, without noise and without shadows.

    level = max(0, ½ log₂(Ω_s / Ω_p) + bias),  Ω_s = 1/(N p),  Ω_p = 2π² sin θ / (W H)

Source: Křivánek and Colbert, "Real-time shading with filtered importance sampling", EGSR 2008;
Colbert and Křivánek, "GPU-based importance sampling", GPU Gems 3, 2007, chapter 20. The map is a
latitude-longitude image here, whose texels shrink towards the poles: Ω_p is that of the texel a
sample meets. The diffuse part is sampled as the rest is, where the chapter has spherical harmonics.

Levels are box-filtered by solid angle, each half the height of the one before, and read bilinearly
and linearly between two of them.

Biased, by its nature and in two ways: light is never shadowed, and a round blur stands for the
lobe's part around a sample, which is not round where the lobe is anisotropic or grazing. It uses no
rays. Building the pyramid costs one pass over the map, a sample two bilinear look-ups.

Parameters
    bias : levels of extra blur against the noise of few samples; 0 (default) is the formula as the
        chapter prints it, and the paper is said to take 1. `experiments.questions.readings`
        compares them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.compiled import inner, kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.bilinear import bilinear_at
from samplers.lighting import Surface, SurfaceDistribution, SurfaceSamples
from samplers.reference import Reference
from samplers.sphere import RUN, map_positions

STRIP = 128
"""Columns or rows of a level that are summed at a time."""
CHANNELS = 4
"""R, G, B and the solid angle: flux over it is the mean radiance of a box."""


@register("filtered-importance-sampling")
@dataclass(frozen=True)
class FilteredImportanceSampling(LightSampler):
    """BRDF samples in a blurred map, without rays (FIS)."""

    label: ClassVar[str] = "Filtered IS (Křivánek 2008)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Jaroslav Křivánek, Mark Colbert",
            "Real-time shading with filtered importance sampling",
            "Computer Graphics Forum",
            2008,
            kind="article",
            volume="27(4)",
            doi="10.1111/j.1467-8659.2008.01252.x",
        ),
    )
    stochastic: ClassVar[bool] = True

    bias: float = 0.0

    readings = (
        Reading("blurred by a level more", {"bias": 1.0}),
        Reading("blurred by no level more", {"bias": 0.0}),
        Reading("blurred by two levels more", {"bias": 2.0}),
    )

    def __post_init__(self) -> None:
        if not -8.0 <= self.bias <= 8.0:
            raise EnvlightError(
                f"filtered-importance-sampling: bias {self.bias}; use a value in [-8, 8]"
            )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        return FilteredLight(*_pyramid(environment), count, self.bias)


def _boxes(flux: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Sums (size, ...) over boxes along the first axis, whose edges may cut cells."""
    sums = np.concatenate([np.zeros((1, *flux.shape[1:])), np.cumsum(flux, axis=0)])
    edge = np.arange(size + 1) * (len(flux) / size)
    low = np.minimum(edge.astype(np.int64), len(flux) - 1)
    part = (edge - low).reshape(-1, *(1,) * (flux.ndim - 1))
    return np.diff(sums[low] + part * (sums[low + 1] - sums[low]), axis=0)


def _halved(flux: Callable[[slice, int], NDArray[np.float64]], width: int) -> NDArray[np.float64]:
    """Sums (rows, 2 rows, 4) over boxes of a grid half as fine, of `flux(columns, channel)`.

    Made strip by strip and channel by channel: the finest level in float64 is never held at once.
    """
    rows = width // 4
    upright, lying = np.empty((rows, width)), np.empty((rows, 2 * rows, CHANNELS))
    for channel in range(CHANNELS):
        for first in range(0, width, STRIP):
            part = slice(first, first + STRIP)
            upright[:, part] = _boxes(flux(part, channel), rows)
        for first in range(0, rows, STRIP):
            part = slice(first, first + STRIP)
            lying[part, :, channel] = _boxes(upright[part].T, 2 * rows).T
    return lying


def _pyramid(
    environment: EnvironmentMap,
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64]]:
    """All levels' texels (n, 3), where each level begins, and its rows."""
    scale = float(environment.radiance.max(initial=0.0)) or 1.0

    def finest(part: slice, channel: int) -> NDArray[np.float64]:
        sr = environment.row_solid_angle[:, None]
        if channel == CHANNELS - 1:
            return np.repeat(sr, len(range(*part.indices(environment.width))), axis=1)
        return environment.radiance[:, part, channel] / np.float64(scale) * sr

    rows = [environment.height]
    while rows[-1] > 1:
        rows.append(rows[-1] // 2)
    size = 2 * np.array(rows) ** 2
    begin = np.cumsum(size) - size
    texel = np.empty((size.sum(), 3), np.float32)
    columns = finest
    for at, fine in zip(begin[1:], rows, strict=False):
        flux = _halved(columns, 2 * fine)
        level = texel[at : at + flux[..., 0].size]
        level[:] = (flux[..., :3] / flux[..., 3:] * scale).reshape(-1, 3)
        columns = partial(_columns, flux)
    texel[: size[0]] = environment.radiance.reshape(-1, 3)
    return texel, begin, np.array(rows)


def _columns(flux: NDArray[np.float64], part: slice, channel: int) -> NDArray[np.float64]:
    return flux[:, part, channel]


@inner
def _read_level(texel, begin, rows, row, column, height, value):
    """A level of so many rows at a place of the finest one's, into value (3,)."""
    image = texel[begin : begin + 2 * rows * rows].reshape((rows, 2 * rows, 3))
    bilinear_at(image, row * rows / height, column * rows / height, value)


@kernel
def _read(texel, begin, rows, direction, pdf, samples, bias, radiance):
    """The blurred map in the directions (n, 3) of density pdf (n,), into radiance (n, 3)."""
    height, last = rows[0], len(rows) - 1
    way, place = np.zeros(3 * RUN), np.empty(2 * RUN)
    fine, coarse = np.empty(3), np.empty(3)
    for first in range(0, len(pdf), RUN):
        used = min(RUN, len(pdf) - first)
        map_positions(direction, first, used, height, way, place)
        for k in range(used):
            i = first + k
            if not pdf[i] > 0.0:
                radiance[i, 0] = radiance[i, 1] = radiance[i, 2] = 0.0
                continue
            # sin θ of the texel's row, which is never 0.
            theta = (min(math.floor(place[k]), height - 1) + 0.5) * math.pi / height
            texel_angle = math.pi * math.pi * math.sin(theta) / (height * height)
            covered = 1.0 / (samples * np.float64(pdf[i]) * texel_angle)
            level = min(max(0.5 * math.log2(covered) + bias, 0.0), np.float64(last))
            low = min(int(level), last)
            high = min(low + 1, last)
            part = level - low
            for at, value in ((low, fine), (high, coarse)):
                _read_level(texel, begin[at], rows[at], place[k], place[RUN + k], height, value)
            for channel in range(3):
                radiance[i, channel] = (1.0 - part) * fine[channel] + part * coarse[channel]


@dataclass(frozen=True, eq=False, repr=False)
class FilteredLight:
    """`count` BRDF samples that read a pyramid of the map.

    texel : (n, 3) float32, all levels; begin, rows : (levels,), where each begins and its height
    """

    texel: NDArray[np.float32]
    begin: NDArray[np.int64]
    rows: NDArray[np.int64]
    count: int
    bias: float

    @property
    def draws(self) -> tuple[int, ...]:
        return (self.count,)

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        direction = surface.draw(u[0])
        pdf = surface.reflect(direction)[1]
        radiance = np.empty_like(direction)
        _read(
            self.texel, self.begin, self.rows, direction.reshape(-1, 3), pdf.reshape(-1),
            self.count, self.bias, radiance.reshape(-1, 3),
        )  # fmt: skip
        weight = np.divide(1.0, pdf, out=np.zeros(pdf.shape), where=pdf > 0.0)
        return SurfaceSamples(direction, weight, radiance, shadowed=False)
