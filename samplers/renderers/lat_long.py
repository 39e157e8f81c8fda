"""A table over the map's latitude and longitude as a distribution of directions.

A direction is uniform in the two angles within its cell, as renderers have it, so its density per
solid angle carries 1 / sin θ: p(ω) = weight / Σ weight · cells / (2π² sin θ).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.grids.weight_table import WeightTable, cell_weight
from samplers.sphere import pixels_of, sine_cosine


@kernel
def _directions(place, prefix, scale, direction, pdf):
    height, width = prefix.shape
    for i in range(len(place)):
        row, column = place[i, 0], place[i, 1]
        theta = row * (math.pi / height)
        sin_theta = math.sin(theta)
        sine, cosine = sine_cosine(column / width)
        direction[i, 0] = sine * sin_theta
        direction[i, 1] = math.cos(theta)
        direction[i, 2] = -cosine * sin_theta
        pdf[i] = cell_weight(prefix, int(row), int(column)) * scale / sin_theta


@kernel
def _pdf(direction, prefix, scale, pdf):
    row, column = np.empty(len(pdf), np.int32), np.empty(len(pdf), np.int32)
    pixels_of(direction, len(prefix), row, column)
    for i in range(len(pdf)):
        x, z = np.float64(direction[i, 0]), np.float64(direction[i, 2])
        sin_theta = math.sqrt(x * x + z * z)
        weight = cell_weight(prefix, row[i], column[i])
        pdf[i] = weight * scale / sin_theta if sin_theta > 0.0 else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class LatLongDistribution:
    """Directions by inversion of a table of weights (rows, 2 · rows) per unit of both angles."""

    table: WeightTable
    count: int
    map_reads: int

    @property
    def nbytes(self) -> int:
        return self.table.nbytes

    @property
    def _scale(self) -> float:
        return self.table.prefix.size / (2.0 * math.pi**2 * self.table.total)

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        direction, pdf = np.empty((len(u), 3), np.float32), np.empty(len(u), np.float32)
        _directions(self.table.places(u), self.table.prefix, self._scale, direction, pdf)
        return direction, pdf

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        pdf = np.empty(len(direction), np.float32)
        _pdf(direction, self.table.prefix, self._scale, pdf)
        return pdf
