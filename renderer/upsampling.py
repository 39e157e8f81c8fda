"""Joint bilateral upsampling: a small image brought to full size along the edges of its guides.

A full-size pixel is the weighted mean of the 5 × 5 low-resolution pixels around it; a weight is a
Gaussian of the distance in low-resolution pixels times Gaussians of the differences of normal,
depth and albedo. Source: Kopf et al., "Joint bilateral upsampling", SIGGRAPH 2007; parameters from
Wu, "Efficient environment map rendering based on decomposition", 2025, 3.4: 0.005 for each guide,
1.0 in space. With guides that sharp all weights of a pixel can underflow, so exponents are compared
before they are taken. Depth is scaled to [0, 1] over the visible surface.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer import brdf
from renderer.view import View
from samplers.threads import for_blocks

GUIDE_SIGMA = 0.005
SPATIAL_SIGMA = 1.0
RADIUS = 2
ROW_BLOCK = 16
GUIDES = 7


@dataclass(frozen=True, eq=False)
class Guides:
    """Means over each pixel's surface samples.

    feature : (h, w, 7) float32, normal (3), depth, albedo (3)
    coverage : (h, w) float64, share of sub-pixels that see a surface
    """

    feature: NDArray[np.float32]
    coverage: NDArray[np.float64]


def albedo_table(view: View) -> NDArray[np.float64]:
    """Diffuse plus specular colour of each material, (m, 3): the albedo guide."""
    table = view.materials
    return table[:, brdf.DIFFUSE : brdf.DIFFUSE + 3] + table[:, brdf.SPECULAR : brdf.SPECULAR + 3]


def guides_of(view: View, depth_range: tuple[float, float]) -> Guides:
    """The guides of a view; depth is scaled by the given range."""
    near, far = depth_range
    depth = (view.depth.astype(np.float64) - near) / max(far - near, np.finfo(np.float64).tiny)
    per_point = np.concatenate(
        [view.normal, depth[:, None], albedo_table(view)[view.material]], axis=1
    )
    size = view.width * view.height
    count = np.bincount(view.pixel, minlength=size)
    feature = np.empty((size, GUIDES), np.float32)
    for k in range(GUIDES):
        total = np.bincount(view.pixel, per_point[:, k], minlength=size)
        feature[:, k] = total / np.maximum(count, 1)
    return Guides(feature.reshape(view.height, view.width, GUIDES), view.coverage)


@njit(nogil=True, cache=True)
def _upsample_rows(
    small, small_feature, small_coverage, feature, coverage, guide_sigma, spatial_sigma,
    start, stop, out,
):  # fmt: skip
    height, width = coverage.shape
    small_height, small_width = small_coverage.shape
    side = 2 * RADIUS + 1
    exponent = np.empty(side * side)
    for y in range(start, stop):
        centre_y = (y + 0.5) * small_height / height - 0.5
        for x in range(width):
            if coverage[y, x] == 0.0:
                continue
            centre_x = (x + 0.5) * small_width / width - 0.5
            first_y, first_x = round(centre_y) - RADIUS, round(centre_x) - RADIUS
            largest = -np.inf
            for k in range(side * side):
                qy, qx = first_y + k // side, first_x + k % side
                exponent[k] = -np.inf
                if qy < 0 or qx < 0 or qy >= small_height or qx >= small_width:
                    continue
                if small_coverage[qy, qx] == 0.0:
                    continue
                dy, dx = qy - centre_y, qx - centre_x
                e = -0.5 * (dy * dy + dx * dx) / (spatial_sigma * spatial_sigma)
                for g in range(GUIDES):
                    d = (feature[y, x, g] - small_feature[qy, qx, g]) / guide_sigma
                    e -= 0.5 * d * d
                exponent[k] = e
                largest = max(largest, e)
            if largest == -np.inf:
                continue
            total = red = green = blue = 0.0
            for k in range(side * side):
                if exponent[k] == -np.inf:
                    continue
                weight = np.exp(exponent[k] - largest)
                qy, qx = first_y + k // side, first_x + k % side
                total += weight
                red += weight * small[qy, qx, 0]
                green += weight * small[qy, qx, 1]
                blue += weight * small[qy, qx, 2]
            scale = coverage[y, x] / total
            out[y, x, 0], out[y, x, 1], out[y, x, 2] = red * scale, green * scale, blue * scale


def upsample(
    small: NDArray[np.float32],
    small_guides: Guides,
    guides: Guides,
    guide_sigma: float = GUIDE_SIGMA,
    spatial_sigma: float = SPATIAL_SIGMA,
) -> NDArray[np.float32]:
    """The small image (h, w, 3), a mean over surface samples only, at the size of `guides`.

    The result is multiplied by the coverage, so that a background can be added to it. Pixels whose
    5 × 5 neighbours see no surface stay black.
    """
    out = np.zeros((*guides.coverage.shape, 3), np.float32)
    for_blocks(
        lambda a, b: _upsample_rows(
            small, small_guides.feature, small_guides.coverage, guides.feature, guides.coverage,
            guide_sigma, spatial_sigma, a, b, out,
        ),
        len(out),
        ROW_BLOCK,
    )  # fmt: skip
    return out
