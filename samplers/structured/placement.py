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
from samplers.sphere import CANCELLED

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


@kernel
def _direction(texel, row, column):
    r, c = texel // len(column), texel % len(column)
    return column[c, 0] * row[r, 0], row[r, 1], -column[c, 1] * row[r, 0]


@kernel
def _chord2(a, b):
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z


@kernel
def _block(texel, width):
    return texel // width // BLOCK * (width // BLOCK + 1) + texel % width // BLOCK


@kernel
def _by_block(region, width, height):
    """The texels (n,) of a region block by block, and where each block with any begins (b + 1,)."""
    end = np.zeros((height // BLOCK + 1) * (width // BLOCK + 1) + 1, np.int64)
    for texel in region:
        end[_block(texel, width) + 1] += 1
    for k in range(1, len(end)):
        end[k] += end[k - 1]
    start = np.unique(end)
    order = np.empty(len(region), region.dtype)
    for texel in region:
        k = _block(texel, width)
        order[end[k]] = texel
        end[k] += 1
    return order, start


@kernel
def _first(region, row, column, solid_angle, luminance):
    """Index of the texel nearest to the energy centroid of a region, the brightest of equals."""
    brightest = 0
    for i in range(1, len(region)):
        if luminance[region[i]] > luminance[region[brightest]]:
            brightest = i
    scale = np.float64(luminance[region[brightest]])
    x = y = z = total = 0.0
    for texel in region:
        flux = luminance[texel] / scale * solid_angle[texel // len(column)]
        d = _direction(texel, row, column)
        x, y, z, total = x + flux * d[0], y + flux * d[1], z + flux * d[2], total + flux
    length = math.sqrt(x * x + y * y + z * z)
    middle = _direction(region[brightest], row, column)
    if length > CANCELLED * total:
        middle = x / length, y / length, z / length
    nearest = FAR
    for texel in region:
        nearest = min(nearest, _chord2(_direction(texel, row, column), middle))
    best = -1
    for i in range(len(region)):
        if _chord2(_direction(region[i], row, column), middle) <= nearest * (1.0 + TIE) and (
            best < 0 or luminance[region[i]] > luminance[region[best]]
        ):
            best = i
    return best


@kernel
def _balls(region, start, row, column, middle, radius):
    for k in range(len(start) - 1):
        number = start[k + 1] - start[k]
        for i in range(start[k], start[k + 1]):
            d = _direction(region[i], row, column)
            for c in range(3):
                middle[k, c] += d[c] / number
        for i in range(start[k], start[k + 1]):
            apart = _chord2(_direction(region[i], row, column), middle[k])
            radius[k] = max(radius[k], math.sqrt(apart))


@kernel
def _take_in(region, start, row, column, middle, radius, sample, nearest, farthest):
    """Lower `nearest` (n,) to the squared chords to a sample, `farthest` being its block maxima."""
    for k in range(len(farthest)):
        apart = math.sqrt(_chord2(middle[k], sample)) - radius[k]
        if apart > 0.0 and apart * apart > farthest[k]:
            continue
        farthest[k] = 0.0
        for i in range(start[k], start[k + 1]):
            chord2 = _chord2(_direction(region[i], row, column), sample)
            nearest[i] = min(nearest[i], chord2)
            farthest[k] = max(farthest[k], nearest[i])


@kernel
def _farthest(region, start, luminance, nearest, farthest):
    """The brightest of the texels that are farthest from all samples."""
    least = farthest.max() * (1.0 - TIE)
    best = -1
    for k in range(len(farthest)):
        if farthest[k] >= least:
            for i in range(start[k], start[k + 1]):
                if nearest[i] >= least and (
                    best < 0 or luminance[region[i]] > luminance[region[best]]
                ):
                    best = i
    return best


@kernel
def _spread(region, row, column, solid_angle, luminance, samples, chosen):
    """Fill `chosen` with texels of a region."""
    region, start = _by_block(region, len(column), len(row))
    blocks = len(start) - 1
    middle, radius = np.zeros((blocks, 3)), np.zeros(blocks)
    _balls(region, start, row, column, middle, radius)
    nearest, farthest = np.full(len(region), FAR), np.full(blocks, FAR)
    for texel in samples:
        d = _direction(texel, row, column)
        _take_in(region, start, row, column, middle, radius, d, nearest, farthest)
    for k in range(len(chosen)):
        if k == 0 and len(samples) == 0:
            i = _first(region, row, column, solid_angle, luminance)
        else:
            i = _farthest(region, start, luminance, nearest, farthest)
        chosen[k] = region[i]
        d = _direction(region[i], row, column)
        _take_in(region, start, row, column, middle, radius, d, nearest, farthest)


def spread(
    texels: Texels, region: NDArray[np.int32], samples: NDArray[np.int64], number: int
) -> NDArray[np.int64]:
    """`number` more texels of a region (n,), far from each other and from the samples (m,) there.

    All are flat indices; the region has at least `number` texels that are no samples.
    """
    chosen = np.empty(number, np.int64)
    if number > 0:
        _spread(
            region, texels.row, texels.column, texels.solid_angle, texels.luminance, samples, chosen
        )
    return chosen
