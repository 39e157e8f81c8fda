"""Distributions over a map's directions: by tabulated weights, its luminance, or uniform.

A texel is found by inversion of running sums, a row first, then a column; the direction is uniform
in solid angle within it, so that the density is exactly proportional to what the table holds.
"""

import math
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import inner, kernel
from samplers.environment import EnvironmentMap
from samplers.grids.map_kernels import ROWS
from samplers.grids.running_sums import (
    BELOW,
    DOWN,
    FOUND,
    KEY,
    LOW,
    REAL_SIZE,
    RUN,
    WHOLE_SIZE,
    WITHIN,
    ask_for_guides,
    ask_for_sums,
    choose_steps,
    close_intervals,
    find_rows,
    guides_of,
    open_intervals,
    take,
)
from samplers.lighting import TexelTable
from samplers.sphere import TWO_PI, pixels_of, row_solid_angle, sine_cosine
from samplers.threads import for_blocks

UNIFORM_PDF = 1.0 / (4.0 * math.pi)
LEAST_REMAINDER = 2.0**-20
"""A compensated density below this share of the map is rounding noise of float32 luminance."""
COMPENSATED_COUNT = 2
"""Samples that a compensated density needs: what it leaves out only a BRDF sample finds, and one
sample alone is the light's."""
INSET = 2.0**-10
"""Share of a texel's side that samples keep from its edge, so that a direction rounded to float32
still lies in the texel whose density it was drawn with."""
X, Y, Z = (REAL_SIZE + RUN * i for i in range(3))
"""Rows after those of the search: the direction."""
DRAWN_SIZE = REAL_SIZE + 3 * RUN
NO_TABLE = TexelTable(
    np.empty(0), np.empty(0), np.empty(0, np.int32), np.empty(0), np.empty(0, np.int32),
    np.empty(0),
)  # fmt: skip
"""What stands for a table where there is none."""


@kernel
def _prefix_rows(weight, offset, solid_angle, start, stop, prefix, row_sum):
    for r in range(start, stop):
        total = 0.0
        for c in range(weight.shape[1]):
            total += max(0.0, np.float64(weight[r, c]) - offset) * solid_angle[r]
            prefix[r, c] = total
        row_sum[r] = total


@inner
def begin_texels(table, whole, real):
    """The rows KEY of sixteen texels by the numbers in ALONG; asks for what comes next.

    whole : (WHOLE_SIZE,) int32; real : (DRAWN_SIZE,) float64, with numbers in ACROSS and ALONG
    """
    find_rows(table.row_sum, table.marginal, table.marginal_guide, whole, real)
    steps = len(table.guide) // len(table.row_sum) - 1
    choose_steps(steps, whole, real)
    ask_for_guides(table.guide, steps, whole)


@inner
def narrow_texels(table, whole):
    """After `begin_texels`: where in the rows to search; asks for what comes next."""
    rows = len(table.row_sum)
    open_intervals(table.guide, len(table.guide) // rows - 1, whole)
    ask_for_sums(table.prefix, len(table.prefix) // rows, whole)


@inner
def end_texels(table, whole, real):
    """After `narrow_texels`: sixteen texels, rows KEY and columns LOW, directions X, Y, Z in them.

    The directions keep a little away from their texels' edges.
    """
    edge_cosine, width = table.edge_cosine, len(table.prefix) // len(table.row_sum)
    close_intervals(table.prefix, width, whole, real)
    for k in range(RUN):  # the heights of the rows' upper and lower edges
        row = np.uint64(whole[KEY + k])
        real[FOUND + k], real[BELOW + k] = edge_cosine[row], edge_cosine[row + np.uint64(1)]
    for k in range(RUN):
        along = min(max(real[WITHIN + k], INSET), 1.0 - INSET)
        down = min(max(real[DOWN + k], INSET), 1.0 - INSET)
        sine, cosine = sine_cosine((whole[LOW + k] + along) / width)
        y = real[FOUND + k] + down * (real[BELOW + k] - real[FOUND + k])
        sin_theta = math.sqrt(max(0.0, (1.0 - y) * (1.0 + y)))
        real[X + k], real[Y + k], real[Z + k] = sine * sin_theta, y, -cosine * sin_theta


@inner
def texel_density(weight, offset, total):
    """Density in sr⁻¹ of directions in a texel, if the whole table holds `total`."""
    return np.float32(max(0.0, np.float64(weight) - offset) / total)


@kernel
def _sample(u, table, weight, offset, total, direction, pdf):
    whole, real = np.empty(WHOLE_SIZE, np.int32), np.empty(DRAWN_SIZE)
    for first in range(0, len(u), RUN):
        take(u, first, real)
        begin_texels(table, whole, real)
        narrow_texels(table, whole)
        end_texels(table, whole, real)
        for k in range(min(RUN, len(u) - first)):
            texel = weight[np.uint64(whole[KEY + k]), np.uint64(whole[LOW + k])]
            pdf[first + k] = texel_density(texel, offset, total)
            for axis in range(3):
                direction[first + k, axis] = real[X + axis * RUN + k]


@kernel
def _pdf(direction, weight, offset, total, pdf):
    row, column = np.empty(len(pdf), np.int32), np.empty(len(pdf), np.int32)
    pixels_of(direction, len(weight), row, column)
    for i in range(len(pdf)):
        pdf[i] = texel_density(weight[row[i], column[i]], offset, total)


@dataclass(frozen=True, eq=False)
class TabulatedDistribution:
    """Directions by inversion of a table of a map's texels: `samplers.lighting.TabulatedLight`.

    weight : (H, 2H) float32, none negative; what counts of it is what is above `offset`
    """

    weight: NDArray[np.float32] = field(repr=False)
    offset: float
    table: TexelTable = field(repr=False)
    count: int
    independent: bool = False
    denoised: bool = False

    @classmethod
    def of_weight(
        cls,
        weight: NDArray[np.float32],
        count: int,
        offset: float = 0.0,
        guided: bool = True,
        independent: bool = False,
    ) -> "TabulatedDistribution":
        """The distribution of density in proportion to max(0, weight − offset), some positive.

        guided : start each binary search from a table of cut points, else search whole rows
        """
        height = len(weight)
        prefix, row_sum = np.empty(weight.shape), np.empty(height)
        solid_angle = row_solid_angle(height, 2 * height)

        def rows(start: int, stop: int) -> None:
            _prefix_rows(weight, offset, solid_angle, start, stop, prefix, row_sum)

        for_blocks(rows, height, ROWS)
        marginal, steps = np.cumsum(row_sum), height if guided else 1
        table = TexelTable(
            prefix.reshape(-1), row_sum, guides_of(prefix, steps).reshape(-1), marginal,
            guides_of(marginal[None], steps)[0],
            np.cos(np.arange(height + 1) * (math.pi / height)),
        )  # fmt: skip
        return cls(weight, offset, table, count, independent)

    @property
    def nbytes(self) -> int:
        """Bytes that sampling and the density of given directions read."""
        return self.weight.nbytes + sum(array.nbytes for array in self.table)

    @property
    def total(self) -> float:
        """What the weights of all texels come to, by solid angle."""
        return float(self.table.marginal[-1])

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        direction, pdf = np.empty((len(u), 3), np.float32), np.empty(len(u), np.float32)
        _sample(u, self.table, self.weight, self.offset, self.total, direction, pdf)
        return direction, pdf

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        pdf = np.empty(len(direction), np.float32)
        _pdf(direction, self.weight, self.offset, self.total, pdf)
        return pdf


@dataclass(frozen=True)
class UniformDistribution:
    """Every direction alike: all that a black map allows."""

    count: int
    nbytes: int = 0
    denoised: bool = False

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        y = 1.0 - 2.0 * u[:, 1].astype(np.float64)
        sin_theta, phi = np.sqrt(1.0 - y * y), TWO_PI * u[:, 0].astype(np.float64)
        direction = np.stack([np.sin(phi) * sin_theta, y, -np.cos(phi) * sin_theta], axis=1)
        return direction.astype(np.float32), np.full(len(u), UNIFORM_PDF, np.float32)

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.full(len(direction), UNIFORM_PDF, np.float32)


def by_luminance(
    environment: EnvironmentMap,
    count: int,
    *,
    compensation: float | None = None,
    guided: bool = True,
    independent: bool = False,
) -> TabulatedDistribution | UniformDistribution:
    """Directions in proportion to luminance, uniform under a black map.

    compensation : None, or the share c of the samples that the table has, in (0, 1]: 2(1 − c) times
        the mean luminance over solid angle is taken off the density, which is clamped at 0, because
        BRDF sampling covers the dim part already (Karlík et al., "MIS compensation", SIGGRAPH Asia
        2019). Where nothing would be left, as on a constant map, it is not applied.
    guided : start each binary search from a table of cut points, else search whole rows
    """
    if environment.is_black:
        return UniformDistribution(count)
    of_weight = partial(
        TabulatedDistribution.of_weight, environment.luminance, count, guided=guided,
        independent=independent,
    )  # fmt: skip
    if compensation is not None:
        found = of_weight(
            offset=2.0 * (1.0 - compensation) * environment.luminous_flux * UNIFORM_PDF
        )
        if found.total > LEAST_REMAINDER * environment.luminous_flux:
            return found
    return of_weight()
