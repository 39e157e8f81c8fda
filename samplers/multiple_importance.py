"""Multiple importance sampling: directions drawn from the map's luminance, met by BRDF sampling.

A texel is found by tabulated inversion: a row by binary search in the marginal distribution of
luminance × solid angle, then a column by binary search in the row's conditional one; the direction
is uniform in solid angle within the texel. Its density is therefore exactly proportional to
luminance. The renderer draws half of the samples from the BRDF and weights both techniques by the
power heuristic, so bright lights and sharp highlights are both found. Unbiased; noisy where the
count is low.

Source: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering",
SIGGRAPH 1995; Pharr, Jakob and Humphreys, "Physically Based Rendering", third edition 2016, 14.2.4.
pbrt filters the map and takes the sine of a row's centre; here the map is constant over each texel
and solid angles are exact, so no density is lost between the table and the map.

Building the table costs one pass over the map, a sample O(log H + log W).

Parameters
    compensation : None (default, as pbrt-v3) or a fraction c in (0, 1]. Takes 2(1 − c) times the
        map's mean luminance off the density and clamps it at 0, because BRDF sampling covers the
        dim part already (Karlík et al., "MIS compensation", SIGGRAPH Asia 2019; c = ½ for a
        half-and-half split). Where nothing would be left, as on a constant map, it is not applied.
    guided : True (default) starts each binary search from a table of cut points (Chen and Asau,
        "On generating random variates from an empirical distribution", AIIE Transactions 1974),
        which leaves a step or two of it; False searches the whole row, as pbrt does. The samples
        are the same bit for bit.
    numbers : "low-discrepancy" (default), as pbrt's own samplers but one, or "independent"
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import LightDistribution
from samplers.map_kernels import ROWS
from samplers.sphere import TWO_PI, pixels_of, sine_cosine
from samplers.threads import for_blocks

UNIFORM_PDF = 1.0 / (4.0 * math.pi)
INSET = 2.0**-10
"""Share of a texel's side that samples keep from its edge, so that a direction rounded to float32
still lies in the texel whose density it was drawn with."""
RUN = 16
"""Samples whose directions are found side by side."""
LEAST_REMAINDER = 2.0**-20
"""A compensated density below this share of the map is rounding noise of float32 luminance."""


@njit(nogil=True, cache=True)
def _prefix_rows(luminance, offset, solid_angle, start, stop, prefix, row_flux):
    for r in range(start, stop):
        total = 0.0
        for c in range(luminance.shape[1]):
            total += max(0.0, np.float64(luminance[r, c]) - offset) * solid_angle[r]
            prefix[r, c] = total
        row_flux[r] = total


@njit(nogil=True, cache=True)
def _guide_rows(prefix, start, stop, guide):
    """guide[r, k]: the first cell of row r whose running sum exceeds k / G of the row's total."""
    size = guide.shape[1] - 1
    for r in range(start, stop):
        total, cell = prefix[r, -1], 0
        for k in range(size):
            while cell < prefix.shape[1] - 1 and prefix[r, cell] <= total * (k / size):
                cell += 1
            guide[r, k] = cell
        guide[r, size] = prefix.shape[1] - 1


@njit(nogil=True, cache=True)
def _first_above(prefix, value, low, high):
    """Index in [low, high] of the first element greater than `value`, `high` where none is."""
    while low < high:
        middle = (low + high) >> 1
        if prefix[middle] > value:
            high = middle
        else:
            low = middle + 1
    return low


@njit(nogil=True, cache=True)
def _invert(prefix, guide, u):
    """The cell in which the share u of the total falls, and where in it, in [0, 1].

    A guide narrows the binary search; with a guide of one entry it is the plain search.
    """
    value = u * prefix[-1]
    step = int(u * (len(guide) - 1))
    cell = _first_above(prefix, value, guide[step], guide[step + 1])
    below = prefix[cell - 1] if cell > 0 else 0.0
    return cell, (value - below) / (prefix[cell] - below)


@njit(nogil=True, cache=True, error_model="numpy")
def _directions(place, way):
    """Sixteen directions way (48,), x, y, z, of longitudes in turns and heights, place (32,)."""
    for k in range(RUN):
        sine, cosine = sine_cosine(place[k])
        y = place[RUN + k]
        sin_theta = math.sqrt(max(0.0, (1.0 - y) * (1.0 + y)))
        way[k], way[RUN + k], way[2 * RUN + k] = sine * sin_theta, y, -cosine * sin_theta


@njit(nogil=True, cache=True, error_model="numpy")
def _sample(
    u, prefix, guide, marginal, marginal_guide, luminance, offset, edge_cosine, direction, pdf
):
    """Each step is taken for all samples before the next, so that look-ups overlap in time."""
    count, width, total = len(u), prefix.shape[1], marginal[-1]
    row, column = np.empty(count, np.int32), np.empty(count, np.int32)
    along, down = np.empty(count), np.empty(count)
    for i in range(count):
        row[i], down[i] = _invert(marginal, marginal_guide, np.float64(u[i, 1]))
    for i in range(count):
        column[i], along[i] = _invert(prefix[row[i]], guide[row[i]], np.float64(u[i, 0]))
    place, way = np.zeros(2 * RUN), np.empty(3 * RUN)
    for first in range(0, count, RUN):
        used = min(RUN, count - first)
        for k in range(used):
            i = first + k
            top, bottom = edge_cosine[row[i]], edge_cosine[row[i] + 1]
            place[k] = (column[i] + min(max(along[i], INSET), 1.0 - INSET)) / width
            place[RUN + k] = top + min(max(down[i], INSET), 1.0 - INSET) * (bottom - top)
            pdf[i] = (np.float64(luminance[row[i], column[i]]) - offset) / total
        _directions(place, way)
        for k in range(used):
            for axis in range(3):
                direction[first + k, axis] = way[axis * RUN + k]


@njit(nogil=True, cache=True)
def _pdf(direction, luminance, offset, total, pdf):
    row, column = np.empty(len(pdf), np.int32), np.empty(len(pdf), np.int32)
    pixels_of(direction, len(luminance), row, column)
    for i in range(len(pdf)):
        pdf[i] = max(0.0, np.float64(luminance[row[i], column[i]]) - offset) / total


def _guided(prefix: NDArray[np.float64], size: int) -> NDArray[np.int32]:
    """Guides (rows, size + 1) of running sums (rows, cells)."""
    guide = np.empty((len(prefix), size + 1), np.int32)
    for_blocks(lambda a, b: _guide_rows(prefix, a, b, guide), len(prefix), ROWS)
    return guide


@dataclass(frozen=True, eq=False)
class TabulatedDistribution:
    """Directions by inversion of a map's luminance, less `offset`.

    prefix : (H, W) float64, running sums of flux along each row
    guide : (H, G + 1) int32, where to search in them
    marginal, marginal_guide : (H,) float64 and (G' + 1,) int32, the same for the rows' flux
    """

    luminance: NDArray[np.float32]
    offset: float
    prefix: NDArray[np.float64]
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
        offset: float,
        guided: bool,
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
            _guided(prefix, height if guided else 1),
            marginal,
            _guided(marginal[None], height if guided else 1)[0],
            np.cos(np.arange(height + 1) * (math.pi / height)),
            count,
            independent,
        )

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        direction, pdf = np.empty((len(u), 3), np.float32), np.empty(len(u), np.float32)
        _sample(
            u, self.prefix, self.guide, self.marginal, self.marginal_guide, self.luminance,
            self.offset, self.edge_cosine, direction, pdf,
        )  # fmt: skip
        return direction, pdf

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        pdf = np.empty(len(direction), np.float32)
        _pdf(direction, self.luminance, self.offset, self.marginal[-1], pdf)
        return pdf


@dataclass(frozen=True)
class UniformDistribution:
    """Every direction alike: all that a black map allows."""

    count: int

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        y = 1.0 - 2.0 * u[:, 1].astype(np.float64)
        sin_theta, phi = np.sqrt(1.0 - y * y), TWO_PI * u[:, 0].astype(np.float64)
        direction = np.stack([np.sin(phi) * sin_theta, y, -np.cos(phi) * sin_theta], axis=1)
        return direction.astype(np.float32), np.full(len(u), UNIFORM_PDF, np.float32)

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.full(len(direction), UNIFORM_PDF, np.float32)


@register("mis")
@dataclass(frozen=True)
class MultipleImportance(LightSampler):
    """Luminance and BRDF sampling, combined by the power heuristic (MIS)."""

    stochastic: ClassVar[bool] = True

    compensation: float | None = None
    guided: bool = True
    numbers: Literal["low-discrepancy", "independent"] = "low-discrepancy"

    def __post_init__(self) -> None:
        if self.compensation is not None and not 0.0 < self.compensation <= 1.0:
            raise EnvlightError(f"mis: compensation {self.compensation}; use a value in (0, 1]")
        if self.numbers not in ("low-discrepancy", "independent"):
            raise EnvlightError("mis: numbers is 'low-discrepancy' or 'independent'")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.is_black:
            return UniformDistribution(count)
        independent = self.numbers == "independent"
        if self.compensation is not None:
            mean = environment.luminous_flux * UNIFORM_PDF
            offset = 2.0 * (1.0 - self.compensation) * mean
            compensated = TabulatedDistribution.of(
                environment, count, offset, self.guided, independent
            )
            if compensated.marginal[-1] > LEAST_REMAINDER * environment.luminous_flux:
                return compensated
        return TabulatedDistribution.of(environment, count, 0.0, self.guided, independent)
