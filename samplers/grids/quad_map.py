"""Integrals of an environment map over HEALPix quads of any size, without resampling the map.

On a parallel a quad covers one interval of longitude, so its integral of radiance is a sum over
rows of differences of the row's running sum. The ends fall inside texels and neighbours share them
to the last bit, so energy is neither lost nor made. Each row is met at the parallel that halves its
solid angle; the rows of a low map are cut into thinner ones first.

Running sums are kept at every 8th texel and finished from the texels themselves: an eighth of the
memory, and as quick, since a look-up is a cache miss either way. Cost: one pass over the map, then
O(rows) per quad.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.healpix_quads import height_at, interval, sides_of
from samplers.grids.map_kernels import ROWS
from samplers.threads import for_blocks

STRIDE = 8
"""Texels between two stored running sums."""
LEAST_ROWS = 256
"""Rows that every map is cut into at least, so that quads of small maps are integrated well."""
FEW_QUADS = 16
"""Quads up to which handing them to other threads takes longer than summing them."""
QUADS = 2
"""Quads per block beyond that: few, since large ones cost far more than small ones."""


@kernel
def _prefix_rows(radiance, start, stop, prefix):
    width = radiance.shape[1]
    for r in range(start, stop):
        red = green = blue = 0.0
        for c in range(width):
            if c % STRIDE == 0:
                k = c // STRIDE
                prefix[r, k, 0], prefix[r, k, 1], prefix[r, k, 2] = red, green, blue
            red += radiance[r, c, 0]
            green += radiance[r, c, 1]
            blue += radiance[r, c, 2]
        prefix[r, -1, 0], prefix[r, -1, 1], prefix[r, -1, 2] = red, green, blue


@kernel
def _row_range(face, x0, x1, y0, y1, rows):
    """Rows [first, stop) outside of which the quad has nothing; a row to spare on both sides."""
    top, _ = height_at(face, x1, y1)
    bottom, _ = height_at(face, x0, y0)
    first = int(math.acos(min(1.0, top)) * (rows / math.pi)) - 1
    stop = int(math.acos(max(-1.0, bottom)) * (rows / math.pi)) + 2
    return max(0, first), min(rows, stop)


@kernel
def _running(row, prefix, column):
    """Integral of a row (W, 3) from column 0 to a real column in [−W, W], per channel."""
    width = len(row)
    back = column < 0.0
    if back:
        column += width
    k = min(int(column), width - 1)
    block = k // STRIDE
    red, green, blue = prefix[block, 0], prefix[block, 1], prefix[block, 2]
    for c in range(block * STRIDE, k):
        red += row[c, 0]
        green += row[c, 1]
        blue += row[c, 2]
    share = column - k
    red, green, blue = red + share * row[k, 0], green + share * row[k, 1], blue + share * row[k, 2]
    if back:
        return red - prefix[-1, 0], green - prefix[-1, 1], blue - prefix[-1, 2]
    return red, green, blue


@kernel
def _sum_quads(radiance, prefix, level_cosine, sigma, weight, thinner, quad, start, stop, out):
    per_quarter = 0.25 * radiance.shape[1]
    for i in range(start, stop):
        face = quad[i, 1]
        x0, x1, y0, y1 = sides_of(quad[i])
        red = green = blue = 0.0
        first, last = _row_range(face, x0, x1, y0, y1, len(sigma))
        for line in range(first, last):
            low, high = interval(face, x0, x1, y0, y1, level_cosine[line], sigma[line])
            if low < high:
                row = line // thinner
                a = _running(radiance[row], prefix[row], low * per_quarter)
                b = _running(radiance[row], prefix[row], high * per_quarter)
                red += weight[line] * (b[0] - a[0])
                green += weight[line] * (b[1] - a[1])
                blue += weight[line] * (b[2] - a[2])
        out[i, 0], out[i, 1], out[i, 2] = red, green, blue


@kernel
def _moments(luminance, level_cosine, sigma, weight, thinner, sine, cosine, quad, start, stop, out):
    width = luminance.shape[1]
    for i in range(start, stop):
        face = quad[i, 1]
        x0, x1, y0, y1 = sides_of(quad[i])
        out[i] = 0.0
        first, last = _row_range(face, x0, x1, y0, y1, len(sigma))
        for line in range(first, last):
            y = level_cosine[line]
            low, high = interval(face, x0, x1, y0, y1, y, sigma[line])
            a, b = low * 0.25 * width, high * 0.25 * width
            radius = math.sqrt((1.0 - y) * (1.0 + y))
            for c in range(math.floor(a), math.ceil(b)):
                share = weight[line] * max(0.0, min(b, c + 1.0) - max(a, c * 1.0))
                flux = share * luminance[line // thinner, c % width]
                out[i, 0] += flux * sine[c % width] * radius
                out[i, 1] += flux * y
                out[i, 2] -= flux * cosine[c % width] * radius


@dataclass(frozen=True, eq=False)
class QuadMap:
    """A map made ready for integrals over quads.

    prefix : (H, ⌈W/8⌉ + 1, 3) float64, running sums of each row at every 8th texel and at its end
    level_cosine, sigma, weight : (rows,) float64, the parallel that stands for each row of texels
        or part of it, √(3(1 − |cos θ|)) there, and the solid angle of a texel's part
    thinner : parts that each row of texels is cut into
    """

    environment: EnvironmentMap
    prefix: NDArray[np.float64]
    level_cosine: NDArray[np.float64]
    sigma: NDArray[np.float64]
    weight: NDArray[np.float64]
    thinner: int

    @classmethod
    def of(cls, environment: EnvironmentMap) -> "QuadMap":
        height, width = environment.height, environment.width
        thinner = -(-LEAST_ROWS // height)
        edge = np.arange(height * thinner + 1) * (0.5 * math.pi / (height * thinner))
        depth = 2.0 * np.sin(edge) ** 2
        # 1 − |cos θ| from the nearer pole, so that both hemispheres carry the same digits.
        middle = 0.5 * (depth[:-1] + depth[1:])
        middle = np.minimum(middle, middle[::-1])
        north = np.arange(len(middle)) < 0.5 * len(middle)
        cosine = np.where(north, 1.0 - middle, middle - 1.0)
        weight = np.repeat(environment.row_solid_angle, thinner)
        part = np.diff(depth) * (2.0 * math.pi / width)
        weight *= part / np.repeat(part.reshape(height, thinner).sum(1), thinner)
        prefix = np.empty((height, -(-width // STRIDE) + 1, 3))
        radiance = environment.radiance
        for_blocks(lambda a, b: _prefix_rows(radiance, a, b, prefix), height, ROWS)
        return cls(environment, prefix, cosine, np.sqrt(3.0 * middle), weight, thinner)

    @property
    def deepest_level(self) -> int:
        """The finest level whose quads are not smaller than a texel."""
        return int(math.log2(len(self.sigma) / math.sqrt(6.0)))

    def sums(self, quad: NDArray[np.int64]) -> NDArray[np.float64]:
        """∫ L dω (n, 3) over the quads (n, 4); no quad has more than the one that it is part of."""
        out = np.empty((len(quad), 3))

        def block(start: int, stop: int) -> None:
            _sum_quads(
                self.environment.radiance, self.prefix, self.level_cosine, self.sigma,
                self.weight, self.thinner, quad, start, stop, out,
            )  # fmt: skip

        for_blocks(block, len(quad), FEW_QUADS if len(quad) <= FEW_QUADS else QUADS)
        return out

    def moments(self, quad: NDArray[np.int64]) -> NDArray[np.float64]:
        """∫ luminance × direction dω (n, 3) over the quads (n, 4)."""
        out, luminance = np.empty((len(quad), 3)), self.environment.luminance
        phi = (np.arange(luminance.shape[1]) + 0.5) * (2.0 * math.pi / luminance.shape[1])
        sine, cosine = np.sin(phi), np.cos(phi)

        def block(start: int, stop: int) -> None:
            _moments(
                luminance, self.level_cosine, self.sigma, self.weight, self.thinner,
                sine, cosine, quad, start, stop, out,
            )  # fmt: skip

        for_blocks(block, len(quad), FEW_QUADS if len(quad) <= FEW_QUADS else QUADS)
        return out
