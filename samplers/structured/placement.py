"""Samples spread over a region: always the texel that is farthest from all samples so far.

This is the 2-approximation of k-centre: no arrangement of as many samples has a covering radius
below half of the one reached. Of texels that are equally far the brightest is taken, so that the
choice depends on the map alone. The first sample of a region without any is the texel nearest to
its energy centroid.

Texels come in blocks of a few square degrees. A block whose texels are all nearer to some sample
than the new one can be to any of them is passed over, which leaves little to do for each sample.

Source: Hochbaum and Shmoys, "A best possible heuristic for the k-center problem", Mathematics of
Operations Research 10(2), 1985; with the first sample free, Gonzalez, "Clustering to minimize the
maximum intercluster distance", Theoretical Computer Science 38, 1985.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.sphere import normalized

BLOCK = 16
"""Rows and columns of a block of texels."""
TIE = 1e-9
"""Relative difference below which two squared chords are equal; rounding stays far below it."""
FAR = 9.0
"""More than any squared chord."""


@dataclass(frozen=True, eq=False)
class Texels:
    """The directions of a map's texels by rows and columns, and their luminance.

    row : (H, 2) sine and cosine of θ; column : (2H, 2) of φ; luminance : (H·2H,) float32
    solid_angle : (H,) of a row's texels
    """

    row: NDArray[np.float64]
    column: NDArray[np.float64]
    luminance: NDArray[np.float32]
    solid_angle: NDArray[np.float64]

    @classmethod
    def of(cls, environment: EnvironmentMap) -> "Texels":
        theta = (np.arange(environment.height) + 0.5) * (math.pi / environment.height)
        phi = (np.arange(environment.width) + 0.5) * (math.pi / environment.height)
        row, column = (np.stack([np.sin(a), np.cos(a)], axis=1) for a in (theta, phi))
        return cls(row, column, environment.luminance.reshape(-1), environment.row_solid_angle)

    def directions(self, texel: NDArray[np.int64]) -> NDArray[np.float64]:
        """Unit directions (n, 3) of texels by their flat indices."""
        r, c = np.divmod(texel, len(self.column))
        horizontal = self.row[r, 0]
        return np.stack(
            [self.column[c, 0] * horizontal, self.row[r, 1], -self.column[c, 1] * horizontal],
            axis=1,
        )


@kernel
def _chord2(a, b):
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z


@kernel
def _balls(direction, start, middle, radius):
    for k in range(len(start) - 1):
        for i in range(start[k], start[k + 1]):
            for c in range(3):
                middle[k, c] += direction[i, c] / (start[k + 1] - start[k])
        for i in range(start[k], start[k + 1]):
            radius[k] = max(radius[k], math.sqrt(_chord2(direction[i], middle[k])))


@kernel
def _take_in(direction, start, middle, radius, sample, nearest, farthest):
    """Lower `nearest` (n,) to the squared chords to a sample, `farthest` being its block maxima."""
    for k in range(len(farthest)):
        apart = math.sqrt(_chord2(middle[k], sample)) - radius[k]
        if apart > 0.0 and apart * apart > farthest[k]:
            continue
        farthest[k] = 0.0
        for i in range(start[k], start[k + 1]):
            nearest[i] = min(nearest[i], _chord2(direction[i], sample))
            farthest[k] = max(farthest[k], nearest[i])


@kernel
def _farthest(start, luminance, nearest, farthest):
    """The brightest of the texels that are farthest from all samples."""
    least = farthest.max() * (1.0 - TIE)
    best = -1
    for k in range(len(farthest)):
        if farthest[k] >= least:
            for i in range(start[k], start[k + 1]):
                if nearest[i] >= least and (best < 0 or luminance[i] > luminance[best]):
                    best = i
    return best


@kernel
def _spread(direction, start, luminance, samples, first, chosen):
    """Fill `chosen` with indices of texels; `first` is the first where there are no samples."""
    blocks = len(start) - 1
    middle, radius = np.zeros((blocks, 3)), np.zeros(blocks)
    _balls(direction, start, middle, radius)
    nearest, farthest = np.full(len(direction), FAR), np.full(blocks, FAR)
    for k in range(len(samples)):
        _take_in(direction, start, middle, radius, samples[k], nearest, farthest)
    for k in range(len(chosen)):
        alone = k == 0 and len(samples) == 0
        chosen[k] = first if alone else _farthest(start, luminance, nearest, farthest)
        new = direction[chosen[k]]
        _take_in(direction, start, middle, radius, new, nearest, farthest)


def spread(
    texels: Texels, region: NDArray[np.int64], samples: NDArray[np.int64], number: int
) -> NDArray[np.int64]:
    """`number` more texels of a region (n,), far from each other and from the samples (m,) there.

    All are flat indices; the region has at least `number` texels that are no samples.
    """
    if number == 0:
        return np.empty(0, np.int64)
    r, c = np.divmod(region, len(texels.column))
    block = (r // BLOCK) * len(texels.column) + c // BLOCK
    order = np.argsort(block, kind="stable")
    region, block = region[order], block[order]
    start = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [len(region)]])
    direction, luminance = texels.directions(region), texels.luminance[region]
    scale = np.float64(luminance.max())
    flux = luminance / scale * texels.solid_angle[region // len(texels.column)]
    middle = normalized(flux @ direction, direction[np.argmax(luminance)])
    apart = np.sum((direction - middle) ** 2, axis=1)
    tied = np.flatnonzero(apart <= apart.min() * (1.0 + TIE))
    first = tied[np.argmax(luminance[tied])]
    chosen = np.empty(number, np.int64)
    _spread(direction, start, luminance, texels.directions(samples), first, chosen)
    return region[chosen]
