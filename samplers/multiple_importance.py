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


# Sixteen searches go side by side, in scratch arrays whose rows are named here: whole numbers and
# real ones. One array of each kind, at constant places, lets the compiler see that rows do not
# overlap, so that all but the look-ups become vector instructions, without a jump to mispredict.
KEY, STEP, LOW, HIGH, MIDDLE = (RUN * i for i in range(5))
SHARE, VALUE, FOUND, BELOW, WITHIN, DOWN, X, Y, Z = (RUN * i for i in range(9))


@njit(nogil=True, cache=True)
def _begin(size, whole, real):
    for k in range(RUN):
        whole[STEP + k] = np.int32(real[SHARE + k] * size)


@njit(nogil=True, cache=True)
def _bounds(guide, size, whole):
    for k in range(RUN):
        at = np.uint64(whole[KEY + k]) * np.uint64(size + 1) + np.uint64(whole[STEP + k])
        whole[LOW + k], whole[HIGH + k] = guide[at], guide[at + np.uint64(1)]


@njit(nogil=True, cache=True)
def _halve(whole):
    for k in range(RUN):
        whole[MIDDLE + k] = np.int32((whole[LOW + k] + whole[HIGH + k]) >> 1)


@njit(nogil=True, cache=True)
def _probe(prefix, width, whole, real):
    for k in range(RUN):
        at = np.uint64(whole[KEY + k]) * np.uint64(width) + np.uint64(whole[MIDDLE + k])
        real[FOUND + k] = prefix[at]


@njit(nogil=True, cache=True)
def _narrow(whole, real):
    """Halve the intervals by what was found in their middles; returns how many go on."""
    going = 0
    for k in range(RUN):
        low, high, middle = whole[LOW + k], whole[HIGH + k], whole[MIDDLE + k]
        is_open, above = low < high, real[FOUND + k] > real[VALUE + k]
        low = np.int32(middle + 1) if is_open & (not above) else low
        high = middle if is_open & above else high
        whole[LOW + k], whole[HIGH + k] = low, high
        whole[MIDDLE + k] = np.int32((low + high) >> 1)
        going += 1 if low < high else 0
    return going


@njit(nogil=True, cache=True)
def _ends(prefix, width, whole, real):
    for k in range(RUN):
        cell = whole[LOW + k]
        at = np.uint64(whole[KEY + k]) * np.uint64(width) + np.uint64(cell)
        real[FOUND + k] = prefix[at]
        real[BELOW + k] = prefix[at - np.uint64(1)] if cell > 0 else 0.0


@njit(nogil=True, cache=True, error_model="numpy")
def _place(real):
    for k in range(RUN):
        below = real[BELOW + k]
        real[WITHIN + k] = (real[VALUE + k] - below) / (real[FOUND + k] - below)


@njit(nogil=True, cache=True)
def _invert(prefix, width, guide, size, whole, real):
    """Where the shares SHARE of the totals of the rows KEY fall: cells LOW, and WITHIN them.

    prefix, guide : flat; `width` running sums and `size` + 1 guides to a row
    VALUE : the shares times their rows' totals

    A guide narrows the binary search, for the first running sum that is greater than a value; with
    one step it is the plain search.
    """
    _begin(size, whole, real)
    _bounds(guide, size, whole)
    _halve(whole)
    _probe(prefix, width, whole, real)
    while _narrow(whole, real) > 0:
        _probe(prefix, width, whole, real)
    _ends(prefix, width, whole, real)
    _place(real)


@njit(nogil=True, cache=True)
def _take(u, first, last, axis, real):
    for k in range(RUN):
        real[SHARE + k] = u[min(first + k, last), axis]


@njit(nogil=True, cache=True)
def _scale_by(total, real):
    for k in range(RUN):
        real[VALUE + k] = real[SHARE + k] * total


@njit(nogil=True, cache=True)
def _scale_by_rows(row_flux, whole, real):
    for k in range(RUN):
        real[VALUE + k] = real[SHARE + k] * row_flux[np.uint64(whole[KEY + k])]


@njit(nogil=True, cache=True)
def _enter_rows(whole, real):
    for k in range(RUN):
        whole[KEY + k], real[DOWN + k] = whole[LOW + k], real[WITHIN + k]


@njit(nogil=True, cache=True)
def _edges(edge_cosine, whole, real):
    """The heights of the rows' upper and lower edges, into FOUND and BELOW."""
    for k in range(RUN):
        row = np.uint64(whole[KEY + k])
        real[FOUND + k], real[BELOW + k] = edge_cosine[row], edge_cosine[row + np.uint64(1)]


@njit(nogil=True, cache=True, error_model="numpy")
def _directions(width, whole, real):
    """Directions X, Y, Z of the places in their texels, a little away from the texels' edges."""
    for k in range(RUN):
        along = min(max(real[WITHIN + k], INSET), 1.0 - INSET)
        down = min(max(real[DOWN + k], INSET), 1.0 - INSET)
        sine, cosine = sine_cosine((whole[LOW + k] + along) / width)
        y = real[FOUND + k] + down * (real[BELOW + k] - real[FOUND + k])
        sin_theta = math.sqrt(max(0.0, (1.0 - y) * (1.0 + y)))
        real[X + k], real[Y + k], real[Z + k] = sine * sin_theta, y, -cosine * sin_theta


@njit(nogil=True, cache=True, error_model="numpy")
def _sample(
    u, prefix, row_flux, guide, marginal, marginal_guide, luminance, offset, edge_cosine,
    direction, pdf,
):  # fmt: skip
    (height, width), total, last = prefix.shape, marginal[-1], len(u) - 1
    sums, guides, size = prefix.reshape(-1), guide.reshape(-1), guide.shape[1] - 1
    whole, real = np.empty(5 * RUN, np.int32), np.empty(9 * RUN)
    for first in range(0, len(u), RUN):
        whole[KEY : KEY + RUN] = 0
        _take(u, first, last, 1, real)
        _scale_by(total, real)
        _invert(marginal, height, marginal_guide, len(marginal_guide) - 1, whole, real)
        _enter_rows(whole, real)
        _take(u, first, last, 0, real)
        _scale_by_rows(row_flux, whole, real)
        _invert(sums, width, guides, size, whole, real)
        _edges(edge_cosine, whole, real)
        _directions(width, whole, real)
        for k in range(min(RUN, len(u) - first)):
            texel = luminance[np.uint64(whole[KEY + k]), np.uint64(whole[LOW + k])]
            pdf[first + k] = (np.float64(texel) - offset) / total
            for axis in range(3):
                direction[first + k, axis] = real[X + axis * RUN + k]


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
            row_flux,
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
            u, self.prefix, self.row_flux, self.guide, self.marginal, self.marginal_guide,
            self.luminance, self.offset, self.edge_cosine, direction, pdf,
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
