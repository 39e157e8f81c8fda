"""Distributions over a map's directions: by its tabulated luminance, or uniform.

A texel is found by inversion of running sums, a row first, then a column; the direction is uniform
in solid angle within it, so that the density is exactly proportional to what the table holds.
"""

import math
from dataclasses import dataclass

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
from samplers.sphere import TWO_PI, pixels_of, sine_cosine
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
Table = tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.int32],
    NDArray[np.float64],
    NDArray[np.int32],
    NDArray[np.float64],
]
"""`prefix` and `guide`, flat, with `row_flux` between them, `marginal`, `marginal_guide` and
`edge_cosine`, as kernels take them."""
NO_TABLE: Table = (
    np.empty(0), np.empty(0), np.empty(0, np.int32), np.empty(0), np.empty(0, np.int32),
    np.empty(0),
)  # fmt: skip
"""What stands for a table where there is none."""


@kernel
def _prefix_rows(luminance, offset, solid_angle, start, stop, prefix, row_flux):
    for r in range(start, stop):
        total = 0.0
        for c in range(luminance.shape[1]):
            total += max(0.0, np.float64(luminance[r, c]) - offset) * solid_angle[r]
            prefix[r, c] = total
        row_flux[r] = total


@inner
def begin_texels(table, whole, real):
    """The rows KEY of sixteen texels by the numbers in ALONG; asks for what comes next.

    whole : (WHOLE_SIZE,) int32; real : (DRAWN_SIZE,) float64, with numbers in ACROSS and ALONG
    """
    _, row_flux, guide, marginal, marginal_guide, _ = table
    find_rows(row_flux, marginal, marginal_guide, whole, real)
    steps = len(guide) // len(row_flux) - 1
    choose_steps(steps, whole, real)
    ask_for_guides(guide, steps, whole)


@inner
def narrow_texels(table, whole):
    """After `begin_texels`: where in the rows to search; asks for what comes next."""
    prefix, row_flux, guide, _, _, _ = table
    open_intervals(guide, len(guide) // len(row_flux) - 1, whole)
    ask_for_sums(prefix, len(prefix) // len(row_flux), whole)


@inner
def end_texels(table, whole, real):
    """After `narrow_texels`: sixteen texels, rows KEY and columns LOW, directions X, Y, Z in them.

    The directions keep a little away from their texels' edges.
    """
    prefix, row_flux, _, _, _, edge_cosine = table
    width = len(prefix) // len(row_flux)
    close_intervals(prefix, width, whole, real)
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
def texel_density(luminance, offset, total):
    """Density in sr⁻¹ of directions in a texel, if the whole table holds `total`."""
    return np.float32(max(0.0, np.float64(luminance) - offset) / total)


@kernel
def _sample(u, table, luminance, offset, total, direction, pdf):
    whole, real = np.empty(WHOLE_SIZE, np.int32), np.empty(DRAWN_SIZE)
    for first in range(0, len(u), RUN):
        take(u, first, real)
        begin_texels(table, whole, real)
        narrow_texels(table, whole)
        end_texels(table, whole, real)
        for k in range(min(RUN, len(u) - first)):
            texel = luminance[np.uint64(whole[KEY + k]), np.uint64(whole[LOW + k])]
            pdf[first + k] = texel_density(texel, offset, total)
            for axis in range(3):
                direction[first + k, axis] = real[X + axis * RUN + k]


@kernel
def _pdf(direction, luminance, offset, total, pdf):
    row, column = np.empty(len(pdf), np.int32), np.empty(len(pdf), np.int32)
    pixels_of(direction, len(luminance), row, column)
    for i in range(len(pdf)):
        pdf[i] = texel_density(luminance[row[i], column[i]], offset, total)


@dataclass(frozen=True, eq=False)
class TabulatedDistribution:
    """Directions by inversion of a map's luminance, less `offset`.

    prefix : (H, W) float64, running sums of flux along each row
    row_flux : (H,) float64, their last ones
    guide : (H, G + 1) int32, where to search in them
    marginal, marginal_guide : (H,) float64 and (G' + 1,) int32, the same for the rows' flux
    """

    luminance: NDArray[np.float32]
    offset: float
    prefix: NDArray[np.float64]
    row_flux: NDArray[np.float64]
    guide: NDArray[np.int32]
    marginal: NDArray[np.float64]
    marginal_guide: NDArray[np.int32]
    edge_cosine: NDArray[np.float64]
    count: int
    independent: bool = False

    @classmethod
    def of(
        cls,
        environment: EnvironmentMap,
        count: int,
        offset: float = 0.0,
        guided: bool = True,
        independent: bool = False,
    ) -> "TabulatedDistribution":
        """The distribution of max(0, luminance − offset)."""
        luminance, height = environment.luminance, environment.height
        prefix, row_flux = np.empty(luminance.shape), np.empty(height)
        solid_angle = environment.row_solid_angle

        def rows(start: int, stop: int) -> None:
            _prefix_rows(luminance, offset, solid_angle, start, stop, prefix, row_flux)

        for_blocks(rows, height, ROWS)
        marginal = np.cumsum(row_flux)
        return cls(
            luminance,
            offset,
            prefix,
            row_flux,
            guides_of(prefix, height if guided else 1),
            marginal,
            guides_of(marginal[None], height if guided else 1)[0],
            np.cos(np.arange(height + 1) * (math.pi / height)),
            count,
            independent,
        )

    @property
    def nbytes(self) -> int:
        """Bytes that sampling and the density of given directions read."""
        tables = (self.luminance, self.prefix, self.row_flux, self.guide, self.marginal,
                  self.marginal_guide, self.edge_cosine)  # fmt: skip
        return sum(table.nbytes for table in tables)

    @property
    def table(self) -> Table:
        """What `begin_texels` and those after it read."""
        return (
            self.prefix.reshape(-1), self.row_flux, self.guide.reshape(-1), self.marginal,
            self.marginal_guide, self.edge_cosine,
        )  # fmt: skip

    @property
    def total(self) -> float:
        """Flux of all texels."""
        return float(self.marginal[-1])

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        direction, pdf = np.empty((len(u), 3), np.float32), np.empty(len(u), np.float32)
        _sample(u, self.table, self.luminance, self.offset, self.total, direction, pdf)
        return direction, pdf

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        pdf = np.empty(len(direction), np.float32)
        _pdf(direction, self.luminance, self.offset, self.total, pdf)
        return pdf


@dataclass(frozen=True)
class UniformDistribution:
    """Every direction alike: all that a black map allows."""

    count: int
    nbytes: int = 0

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
    if compensation is not None:
        offset = 2.0 * (1.0 - compensation) * environment.luminous_flux * UNIFORM_PDF
        found = TabulatedDistribution.of(environment, count, offset, guided, independent)
        if found.marginal[-1] > LEAST_REMAINDER * environment.luminous_flux:
            return found
    return TabulatedDistribution.of(environment, count, 0.0, guided, independent)
