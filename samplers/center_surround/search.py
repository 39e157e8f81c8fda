"""Where on a map a centre-surround filter answers most, kept up to date as lights are taken out.

The search runs on a small grid of the map's flux. Responses are computed only for pixels among the
brightest, and only again where a light that was taken out lies within a filter's reach.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.center_surround.filters import FilterBank
from samplers.center_surround.kernels import prefix_rows, reduce_rows, respond
from samplers.sphere import angular_distance, pixel_direction, pixel_directions, row_solid_angle
from samplers.threads import for_blocks

SUB_ROWS = 512
"""Sub-rows from pole to pole, at least: a third of a degree, a tenth of the smallest disc."""
TIE = 1e-9
"""Relative difference below which two responses are equal; rounding stays far below it."""


@dataclass(frozen=True)
class Found:
    """The best place for a light: row and column of the search grid, filter, direction (3,)."""

    row: int
    column: int
    filter: int
    direction: NDArray[np.float64]


def cap_half_widths(
    height: int, parts: int, radius: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Half-widths (height, caps, k) in columns of caps about the rows' centres, and first sub-rows.

    sin²(Δφ/2) = (sin²(ρ/2) − sin²((θ − θ₀)/2)) / (sin θ₀ sin θ), which keeps its digits for small
    caps; a cap that holds a whole parallel has Δφ = π.
    """
    step = math.pi / (height * parts)
    theta0 = (np.arange(height) + 0.5) * (math.pi / height)
    largest = float(radius.max())
    first = np.maximum(np.floor((theta0 - largest) / step), 0).astype(np.int64)
    last = np.minimum(np.ceil((theta0 + largest) / step), height * parts).astype(np.int64)
    row = first[:, None] + np.arange((last - first).max())
    theta = (row + 0.5) * step
    off = np.sin(0.5 * (theta - theta0[:, None])) ** 2
    product = np.sin(theta0)[:, None] * np.sin(theta)
    reach = np.sin(0.5 * radius)[None, :, None] ** 2 - off[:, None, :]
    inside = (reach > 0.0) & (row < last[:, None])[:, None, :]
    sine2 = np.divide(reach, product[:, None, :], out=np.zeros_like(reach), where=inside)
    half = np.arcsin(np.sqrt(np.minimum(sine2, 1.0))) * (2.0 * height / math.pi)
    return np.where(inside, half, -1.0), first


def first_of_ties(row: NDArray[np.int64], column: NDArray[np.int64], width: int) -> int:
    """Which of several equal places to take: in the uppermost row the one after the widest gap.

    The seam plays no part in it, so a rolled map gives rolled lights.
    """
    top = np.flatnonzero(row == row.min())
    order = top[np.argsort(column[top])]
    gap = np.diff(column[order], prepend=column[order[-1]] - width)
    return int(order[np.argmax(gap)])


class SurroundSearch:
    """Responses of a filter bank on the search grid of a map that loses light step by step.

    flux : (height, 2·height) float64, luminous flux of the grid's cells
    """

    def __init__(
        self,
        radiance: NDArray[np.float32],
        bank: FilterBank,
        rows: int,
        brightest: float,
        by_solid_angle: bool,
    ) -> None:
        self.bank, self.brightest, self.by_solid_angle = bank, brightest, by_solid_angle
        self.height = min(len(radiance), rows)
        shape = (self.height, 2 * self.height)
        parts = -(-SUB_ROWS // self.height)
        self.solid_angle = row_solid_angle(*shape)
        share = row_solid_angle(self.height * parts, 1).reshape(self.height, parts)
        self.share = share / share.sum(axis=1, keepdims=True)
        self.half_width, self.first = cap_half_widths(self.height, parts, bank.cap_radius)
        self.flux = np.zeros(shape)
        self.prefix = np.zeros((self.height, 3 * shape[1] + 1))
        self.response = np.zeros(shape[0] * shape[1])
        self.size = np.zeros(len(self.response), np.int64)
        self.known = np.zeros(len(self.response), np.bool_)
        self._reduce(radiance, 0, self.height)

    def _reduce(self, radiance: NDArray[np.float32], top: int, bottom: int) -> None:
        def rows(start: int, stop: int) -> None:
            reduce_rows(radiance, self.height, top + start, top + stop, self.flux)
            prefix_rows(self.flux, top + start, top + stop, self.prefix)

        for_blocks(rows, bottom - top, 8)

    def candidates(self) -> NDArray[np.int64]:
        """Flat indices of the brightest pixels, all those as bright as the last one included."""
        luminance = (self.flux / self.solid_angle[:, None]).ravel()
        order = np.argsort(-luminance, kind="stable")
        if self.by_solid_angle:
            covered = np.cumsum(self.solid_angle[order // self.flux.shape[1]])
            number = int(np.searchsorted(covered, self.brightest * 4.0 * math.pi)) + 1
        else:
            number = math.ceil(self.brightest * len(order))
        least = luminance[order[min(number, len(order)) - 1]]
        return np.flatnonzero((luminance >= least) & (luminance > 0.0))

    def best(self) -> Found | None:
        """The place and filter of the largest response; None where none is positive."""
        pixel = self.candidates()
        new = pixel[~self.known[pixel]]

        def block(start: int, stop: int) -> None:
            respond(
                self.prefix, self.share, self.half_width, self.first, self.bank.cap_weight,
                self.bank.cap_filter, len(self.bank.inner), new, start, stop,
                self.response, self.size,
            )  # fmt: skip

        for_blocks(block, len(new), 64)
        self.known[new] = True
        largest = self.response[pixel].max(initial=0.0)
        if not largest > 0.0:
            return None
        tied = pixel[self.response[pixel] >= (1.0 - TIE) * largest]
        row, column = np.divmod(tied, self.flux.shape[1])
        k = first_of_ties(row, column, self.flux.shape[1])
        direction = pixel_direction(row[k], column[k], self.height)
        return Found(int(row[k]), int(column[k]), int(self.size[tied[k]]), direction)

    def forget(self, radiance: NDArray[np.float32], found: Found) -> None:
        """Take in that the filter's inner disc at `found` has become black in `radiance`."""
        inner, step = self.bank.inner[found.filter], math.pi / self.height
        # The disc's rim runs through cells, one on either side at most.
        rows = math.ceil(inner / step) + 1
        top, bottom = max(0, found.row - rows), min(self.height, found.row + rows + 1)
        self._reduce(radiance, top, bottom)
        reach = inner + self.bank.outer.max() + 2.0 * step
        near = angular_distance(pixel_directions(self.height), found.direction) <= reach
        self.known &= ~near.ravel()
