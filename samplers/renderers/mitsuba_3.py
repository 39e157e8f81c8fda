"""Mitsuba 3: luminance × sin θ, bilinear between the map's texels, drawn by descent.

The map's texels are the corners of a grid of patches: columns stand at their middles and close over
the seam, rows are spread from pole to pole, the first and the last being the poles themselves. A
patch is chosen by descent through sums of four (see `mip_table.py`), weighing the mean of its
corners; within it the density is bilinear. Weights are luminance × sin θ of the texel's row, which
is 0 at the poles' rows. Compensation is off unless asked for; then the mean over the texels, which
counts the poles too much, is taken off the luminance, unless no texel is 1 % darker than it.

Source: Mitsuba 3.9, `emitters/envmap.cpp` and `core/distr_2d.h` as read in 2026; the rules, not the
code. There the light is bilinear too; here the map is constant over each pixel, and its rows lie up
to half a texel from where the table has them.

Parameters
    compensation : False (default, as it ships) or True, its `mis_compensation`
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.mip_table import MipTable, descend
from samplers.grids.tabulated import INSET, UniformDistribution
from samplers.lighting import LightDistribution
from samplers.reference import Reference
from samplers.renderers.compensation import RendererTable
from samplers.sphere import sine_cosine, turns

LEAST_ROWS = 3
"""A map of fewer rows is refused there; here it is drawn from uniformly."""
FLAT = 0.01
"""Share by which the darkest texel must fall below the mean for compensation to be applied."""


@kernel
def _linear(u, first, last):
    """Where a density that goes linearly from `first` to `last` over [0, 1] has the share u."""
    root = math.sqrt((1.0 - u) * first * first + u * last * last)
    return u * (first + last) / (first + root) if first + root > 0.0 else u


@kernel
def _density(x, y, z, weight, scale):
    """The density of one direction."""
    patches, columns = weight.shape[0] - 1, weight.shape[1] - 1
    flat = math.sqrt(x * x + z * z)
    if flat == 0.0:
        return 0.0
    down = 2.0 * turns(flat, y) * patches
    along = turns(x, -z) * columns - 0.5
    along = along + columns if along < 0.0 else along
    row, column = min(int(down), patches - 1), min(int(along), columns - 1)
    down, along = down - row, along - column
    upper = (1.0 - along) * weight[row, column] + along * weight[row, column + 1]
    lower = (1.0 - along) * weight[row + 1, column] + along * weight[row + 1, column + 1]
    return ((1.0 - down) * upper + down * lower) * scale / flat


@kernel
def _sample(u, weight, scale, sums, start, width, direction, pdf):
    patches, columns = weight.shape[0] - 1, weight.shape[1] - 1
    for i in range(len(u)):
        row, column, x, y = descend(sums, start, width, np.float64(u[i, 0]), np.float64(u[i, 1]))
        v00, v01 = weight[row, column], weight[row, column + 1]
        v10, v11 = weight[row + 1, column], weight[row + 1, column + 1]
        y = min(max(_linear(y, v00 + v01, v10 + v11), INSET), 1.0 - INSET)
        x = _linear(x, (1.0 - y) * v00 + y * v10, (1.0 - y) * v01 + y * v11)
        x = min(max(x, INSET), 1.0 - INSET)
        theta, turn = (row + y) * (math.pi / patches), (column + x + 0.5) / columns
        sine, cosine = sine_cosine(turn if turn < 1.0 else turn - 1.0)
        sin_theta = math.sin(theta)
        direction[i, 0] = sine * sin_theta
        direction[i, 1] = math.cos(theta)
        direction[i, 2] = -cosine * sin_theta
        # Of the direction as it is rounded: the density has no steps.
        pdf[i] = _density(
            np.float64(direction[i, 0]), np.float64(direction[i, 1]), np.float64(direction[i, 2]),
            weight, scale,
        )  # fmt: skip


@kernel
def _pdf(direction, weight, scale, pdf):
    for i in range(len(pdf)):
        pdf[i] = _density(
            np.float64(direction[i, 0]), np.float64(direction[i, 1]), np.float64(direction[i, 2]),
            weight, scale,
        )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class BilinearDistribution:
    """Directions by descent through patches and bilinear placement within them.

    weight : (H, W + 1) float64, at the patches' corners; the last column is the first again
    """

    weight: NDArray[np.float64]
    table: MipTable
    count: int
    map_reads: int

    @classmethod
    def of(cls, weight: NDArray[np.float64], count: int) -> "BilinearDistribution":
        """The distribution of weights (H, W + 1), the last column the first again."""
        mean = weight[:-1, :-1] + weight[:-1, 1:]
        mean += weight[1:, :-1]
        mean += weight[1:, 1:]
        mean *= 0.25
        return cls(weight, MipTable.of(mean), count, weight.shape[0] * (weight.shape[1] - 1))

    @property
    def nbytes(self) -> int:
        return self.weight.nbytes + self.table.nbytes

    @property
    def _scale(self) -> float:
        patches = (self.weight.shape[0] - 1) * (self.weight.shape[1] - 1)
        return patches / (2.0 * math.pi**2 * self.table.total)

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        direction, pdf = np.empty((len(u), 3), np.float32), np.empty(len(u), np.float32)
        _sample(
            u, self.weight, self._scale, self.table.sums, self.table.start, self.table.width,
            direction, pdf,
        )  # fmt: skip
        return direction, pdf

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        pdf = np.empty(len(direction), np.float32)
        _pdf(direction, self.weight, self._scale, pdf)
        return pdf


@register("mitsuba-3")
@dataclass(frozen=True)
class Mitsuba3(RendererTable):
    """The table of Mitsuba 3's `envmap`, beside BRDF sampling."""

    label: ClassVar[str] = "Mitsuba 3 (Jakob 2022)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Wenzel Jakob, Sébastien Speierer, Nicolas Roussel, Merlin Nimier-David, "
            "Delio Vicini, Tizian Zeltner, Baptiste Nicolet, Miguel Crespo, Vincent Leroy, "
            "Ziyi Zhang",
            "Mitsuba 3 renderer",
            "EPFL",
            2022,
            kind="misc",
            url="https://mitsuba-renderer.org",
        ),
    )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.height < LEAST_ROWS:
            return UniformDistribution(count)
        weight = np.empty((environment.height, environment.width + 1))
        weight[:, :-1] = environment.luminance
        if self.compensation:
            mean = weight[:, :-1].astype(np.float64, order="C").mean()
            offset = mean if mean - environment.luminance.min() > FLAT * mean else 0.0
            weight -= offset
            np.maximum(weight, 0.0, out=weight)
        weight[:, -1] = weight[:, 0]
        sin_theta = np.sin(np.linspace(0.0, math.pi, environment.height))
        sin_theta[-1] = 0.0  # as the first is; sin π rounds to 10⁻¹⁶
        weight *= sin_theta[:, None]
        found = BilinearDistribution.of(weight, count)
        if not found.table.total > 0.0:  # black but for the poles' rows
            return UniformDistribution(count)
        return found
