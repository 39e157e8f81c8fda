"""Rectangles of an environment map: splitting them, and the light that stands for each.

A region is a row (top, left, bottom, right) of integers, bottom and right exclusive.
"""

import heapq
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.map_kernels import BAND, texel
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, extent_of
from samplers.sphere import normalized
from samplers.threads import for_blocks

Region = tuple[int, int, int, int]

REGIONS = 8
"""Regions per block of work."""
GAUSS_NODE, GAUSS_WEIGHT = np.polynomial.legendre.leggauss(8)


def split_until(
    count: int,
    root: Region,
    split: Callable[[Region], tuple[Region, Region] | None],
    importance: Callable[[Region], float],
    rounds: bool,
) -> list[Region]:
    """Regions from `root` by repeated splits: at most `count`, fewer where nothing more splits.

    rounds : split every region once a round, 2ⁿ in all; otherwise always the most important one,
        the older of two equals.
    """
    if rounds:
        regions = [root]
        for _ in range(count.bit_length() - 1):
            regions = [part for region in regions for part in (split(region) or (region,))]
        return regions
    heap: list[tuple[float, int, Region]] = [(-importance(root), 0, root)]
    final: list[Region] = []
    born = 1
    while heap and len(heap) + len(final) < count:
        _, _, region = heapq.heappop(heap)
        parts = split(region)
        if parts is None:
            final.append(region)
            continue
        for part in parts:
            heapq.heappush(heap, (-importance(part), born, part))
            born += 1
    return final + [region for _, _, region in sorted(heap, key=lambda item: item[1])]


@kernel
def _add_rows(radiance, solid_angle, sine, cosine, box, out):
    """Flux (3) and moment of luminous flux (3) over the rows of a box."""
    top, left, bottom, right = box
    height = len(solid_angle)
    for r in range(top, bottom):
        red = green = blue = along = across = total = 0.0
        for c in range(left, right):
            red += radiance[r, c, 0]
            green += radiance[r, c, 1]
            blue += radiance[r, c, 2]
            y = texel(radiance, r, c)
            total += y
            along += y * sine[c]
            across += y * cosine[c]
        theta = (r + 0.5) * math.pi / height
        horizontal = solid_angle[r] * math.sin(theta)
        out[0] += solid_angle[r] * red
        out[1] += solid_angle[r] * green
        out[2] += solid_angle[r] * blue
        out[3] += horizontal * along
        out[4] += solid_angle[r] * math.cos(theta) * total
        out[5] -= horizontal * across


@kernel
def _add_box(radiance, solid_angle, sine, cosine, band_table, box, out):
    """As `_add_rows`, with the whole bands of rows taken from the band table."""
    top, left, bottom, right = box
    first, last = -(-top // BAND), bottom // BAND
    tables = (radiance, solid_angle, sine, cosine)
    if first >= last:
        _add_rows(*tables, box, out)
        return
    _add_rows(*tables, (top, left, first * BAND, right), out)
    _add_rows(*tables, (last * BAND, left, bottom, right), out)
    for band in range(first, last):
        for k in range(6):
            out[k] += band_table[band, right, k] - band_table[band, left, k]


def region_sums(
    environment: EnvironmentMap, region: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """∫ L dω (n, 3) and ∫ Y ω dω (n, 3) over the regions."""
    phi = (np.arange(environment.width) + 0.5) * (2.0 * math.pi / environment.width)
    tables = (environment.radiance, environment.row_solid_angle)
    waves, bands = (np.sin(phi), np.cos(phi)), environment.band_table
    total = np.zeros((len(region), 6))

    def add(start: int, stop: int) -> None:
        for k in range(start, stop):
            _add_box(*tables, *waves, bands, tuple(region[k]), total[k])

    for_blocks(add, len(region), REGIONS)
    return total[:, :3], total[:, 3:]


def region_middle(region: NDArray[np.int64], height: int) -> NDArray[np.float64]:
    """Unit directions (n, 3) of the middles of the regions, halved by solid angle."""
    top, left, bottom, right = (region[:, k] * (math.pi / height) for k in range(4))
    y = 0.5 * (np.cos(top) + np.cos(bottom))
    sin_theta = np.sqrt(np.maximum(0.0, 1.0 - y * y))
    phi = 0.5 * (left + right)
    return np.stack([np.sin(phi) * sin_theta, y, -np.cos(phi) * sin_theta], axis=1)


@kernel
def _mean_angles(region, height, direction, node, weight, out):
    step = math.pi / height
    for i in range(len(region)):
        y_top, y_bottom = math.cos(region[i, 0] * step), math.cos(region[i, 2] * step)
        left, right = region[i, 1] * step, region[i, 3] * step
        dx, dy, dz = direction[i]
        total = 0.0
        for a in range(len(node)):
            y = 0.5 * (y_top + y_bottom) + 0.5 * (y_top - y_bottom) * node[a]
            sin_theta = math.sqrt(max(0.0, 1.0 - y * y))
            for b in range(len(node)):
                phi = 0.5 * (left + right) + 0.5 * (right - left) * node[b]
                x, z = math.sin(phi) * sin_theta, -math.cos(phi) * sin_theta
                cx, cy, cz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
                angle = math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), x * dx + y * dy + z * dz)
                total += 0.25 * weight[a] * weight[b] * angle
        out[i] = total


def mean_angle_to(
    region: NDArray[np.int64], height: int, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean angle (n,) between the directions (n, 3) and their regions, by 8 × 8 Gauss points.

    The points are uniform in solid angle (cos θ, φ); the result is a length scale for interleaved
    sampling, for which three digits are more than enough.
    """
    out = np.empty(len(region))
    _mean_angles(region, height, direction, GAUSS_NODE, GAUSS_WEIGHT, out)
    return out


def largest_angle_to(
    region: NDArray[np.int64], height: int, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest angle (n,) between the directions (n, 3) and any point of their regions, exactly.

    The cosine of the angle to (θ, φ) is cos θ cos θ₀ + sin θ sin θ₀ cos(φ − φ₀), which is least
    where φ is farthest from φ₀, on an edge or opposite; along that meridian it is a cosine of θ.
    """
    step = math.pi / height
    theta0 = np.arctan2(np.hypot(direction[:, 0], direction[:, 2]), direction[:, 1])
    phi0 = np.arctan2(direction[:, 0], -direction[:, 2])
    # From the point opposite, the nearest longitude of the region, in [0, π].
    after = (region[:, 1] * step - phi0 - math.pi) % (2.0 * math.pi)
    width = (region[:, 3] - region[:, 1]) * step
    inside = (after == 0.0) | (after + width >= 2.0 * math.pi)
    opposite = np.where(inside, 0.0, np.minimum(after, 2.0 * math.pi - after - width))
    # On that meridian: cos θ₀ cos θ − sin θ₀ cos(opposite) sin θ = R cos(θ + turn).
    across = np.sin(theta0) * np.cos(opposite)
    radius, turn = np.hypot(np.cos(theta0), across), np.arctan2(across, np.cos(theta0))
    low, high = region[:, 0] * step + turn, region[:, 2] * step + turn
    least = np.where(
        (low <= math.pi) & (math.pi <= high),
        -radius,
        radius * np.minimum(np.cos(low), np.cos(high)),
    )
    return np.arccos(np.clip(least, -1.0, 1.0))


def lights_of_regions(
    environment: EnvironmentMap,
    region: NDArray[np.int64],
    direction: NDArray[np.float64] | None = None,
    light_extent: LightExtent = LIGHT_EXTENT,
) -> DirectionalLights:
    """One light per region (n, 4): its integral of radiance, at its energy centroid.

    direction : (n, 3) to use in place of the energy centroids
    Regions without energy give no light.
    """
    irradiance, moment = region_sums(environment, region)
    lit = irradiance.any(axis=1)
    region, irradiance = region[lit], irradiance[lit]
    if direction is None:
        direction = normalized(moment[lit], region_middle(region, environment.height))
    else:
        direction = direction[lit]
    extent = extent_of(
        light_extent,
        lambda: mean_angle_to(region, environment.height, direction),
        lambda: largest_angle_to(region, environment.height, direction),
    )
    return DirectionalLights(direction, irradiance, extent)
