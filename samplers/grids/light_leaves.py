"""A map as many small lights of about equal solid angle: one per HEALPix cell.

Each pixel belongs to the cell that holds its centre; pixels under a mask belong to none. A cell
keeps its solid angle, its flux and the moment of its luminous flux, so that sums over cells are
sums over pixels. Cells without energy are left out. One pass over the map.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.grids.healpix_grid import cell_count, face_cell, next_edge
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, extent_of
from samplers.sphere import DISC_MEAN, centroid, normalized
from samplers.threads import for_blocks

PARTS = 8
"""Partial sums of a map; a constant, so that they never depend on the number of threads."""
COLUMNS = 7
"""Per cell: solid angle, flux in R, G and B, moment of luminous flux along x, y and z."""


@dataclass(frozen=True, eq=False)
class LightLeaves:
    """The cells with energy, in the order of their HEALPix faces.

    direction : (n, 3) energy centroid of the cell, unit
    solid_angle : (n,) of the cell's pixels, in sr
    flux : (n, 3) ∫ L dω; luminous_flux : (n,) ∫ Y dω; moment : (n, 3) ∫ Y ω dω
    """

    direction: NDArray[np.float64]
    solid_angle: NDArray[np.float64]
    flux: NDArray[np.float64]
    luminous_flux: NDArray[np.float64]
    moment: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.direction)


@kernel
def add_run(radiance, masked, r, left, right, sine, cosine, scale, sin_theta, cos_theta, cell):
    """Add the unmasked pixels of columns [left, right) of row r to a cell."""
    count = red = green = blue = luminance = east = south = 0.0
    for c in range(left, right):
        if masked[r, c]:
            continue
        rr = np.float64(radiance[r, c, 0])
        gg = np.float64(radiance[r, c, 1])
        bb = np.float64(radiance[r, c, 2])
        y = 0.2126 * rr + 0.7152 * gg + 0.0722 * bb
        count += 1.0
        red += rr
        green += gg
        blue += bb
        luminance += y
        east += y * sine[c]
        south -= y * cosine[c]
    cell[0] += count * scale
    cell[1] += red * scale
    cell[2] += green * scale
    cell[3] += blue * scale
    cell[4] += east * (scale * sin_theta)
    cell[5] += luminance * (scale * cos_theta)
    cell[6] += south * (scale * sin_theta)


@kernel
def _add_rows(radiance, masked, row_solid_angle, sine, cosine, side, start, stop, cells):
    """Add the unmasked pixels of some rows to the cells, a run of pixels in one cell at a time."""
    height, width = masked.shape
    for r in range(start, stop):
        theta = (r + 0.5) * math.pi / height
        sin_theta, cos_theta = math.sin(theta), math.cos(theta)
        left = 0
        while left < width:
            quarter = 4.0 * (left + 0.5) / width
            face, i, j = face_cell(cos_theta, sin_theta, quarter, side)
            edge = next_edge(cos_theta, sin_theta, quarter, side)
            right = min(max(left + 1, math.ceil(0.25 * edge * width - 0.5)), width)
            add_run(radiance, masked, r, left, right, sine, cosine, row_solid_angle[r], sin_theta,
                    cos_theta, cells[(face * side + j) * side + i])  # fmt: skip
            left = right


def light_leaves(environment: EnvironmentMap, masked: NDArray[np.bool_], side: int) -> LightLeaves:
    """The unmasked part of the map in the 12 · side² cells of a HEALPix grid.

    masked : (H, W), pixels to leave out
    """
    height, width = masked.shape
    phi = (np.arange(width) + 0.5) * (2.0 * math.pi / width)
    sine, cosine = np.sin(phi), np.cos(phi)
    partial = np.zeros((PARTS, cell_count(side), COLUMNS))
    block = -(-height // PARTS)

    def add(start: int, stop: int) -> None:
        _add_rows(environment.radiance, masked, environment.row_solid_angle, sine, cosine, side,
                  start, stop, partial[start // block])  # fmt: skip

    for_blocks(add, height, block)
    cells = partial.sum(axis=0)
    cells = cells[cells[:, 1:4].any(axis=1)]
    moment = np.ascontiguousarray(cells[:, 4:7])
    flux = np.ascontiguousarray(cells[:, 1:4])
    luminous = flux @ LUMINANCE_WEIGHTS
    return LightLeaves(
        normalized(moment, [0.0, 1.0, 0.0]), cells[:, 0].copy(), flux, luminous, moment
    )


def _sum_by(label: NDArray[np.int64], value: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([np.bincount(label, column) for column in value.T], axis=1)


def _largest_by(label: NDArray[np.int64], value: NDArray[np.float64]) -> NDArray[np.float64]:
    largest = np.zeros(int(label.max()) + 1)
    np.maximum.at(largest, label, value)
    return largest


def lights_of_leaves(
    leaves: LightLeaves, label: NDArray[np.int64], light_extent: LightExtent = LIGHT_EXTENT
) -> DirectionalLights:
    """One light per label (n,), 0 to k − 1 each in use, at the energy centroid of its leaves."""
    luminous = leaves.luminous_flux / leaves.luminous_flux.max()
    moment = _sum_by(label, leaves.moment / leaves.luminous_flux.max())
    order = np.lexsort((-luminous, label))
    brightest = order[np.searchsorted(label[order], np.arange(len(moment)))]
    direction = centroid(moment, np.bincount(label, luminous), leaves.direction[brightest])
    chord = np.linalg.norm(leaves.direction - direction[label], axis=1)
    angle = np.hypot(
        2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)), DISC_MEAN * np.sqrt(leaves.solid_angle)
    )
    by_solid_angle = np.bincount(label, leaves.solid_angle)
    extent = extent_of(
        light_extent,
        lambda: np.bincount(label, leaves.solid_angle * angle) / by_solid_angle,
        lambda: _largest_by(label, angle),
    )
    return DirectionalLights(direction, _sum_by(label, leaves.flux), extent)
