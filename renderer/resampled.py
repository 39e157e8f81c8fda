"""Shading by resampled light in place: nothing but a packet's sum leaves its pass.

What `surface.py` does with any distribution, for the one whose candidates come from a table of the
map and from the BRDF. The samples are the same, to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import LANES
from renderer.packet.resample import shade_resampled
from renderer.rays import RayCount
from renderer.surface import FIRST_STREAM
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.grids.resampled_light import ResampledLight
from samplers.grids.tabulated import TabulatedDistribution
from samplers.threads import block_of, for_blocks

POINT_BLOCK = 1024
"""Points that a thread takes at once, at least."""


def is_in_place(lighting: ResampledLight, environment: EnvironmentMap) -> bool:
    """Whether its table is one of the map that is looked up: densities come from that radiance."""
    table = lighting.table
    return (
        isinstance(table, TabulatedDistribution)
        and table.luminance is environment.luminance
        and lighting.radiance is environment.radiance
    )


def shade_in_place(
    view: View, environment: EnvironmentMap, lighting: ResampledLight, seed: int
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points, as by `renderer.surface.shade_surface`."""
    out = np.zeros((len(view), 3), np.float32)
    table, traced = lighting.table, []
    assert isinstance(table, TabulatedDistribution)

    def shade(start: int, stop: int) -> None:
        shadow = shade_resampled(
            view.embree.handle, view.surface, view.material, view.materials, view.pixel,
            view.subpixel, view.subpixels, (start, stop), environment.radiance, table.table,
            table.offset, lighting.curve, (lighting.from_map, lighting.from_brdf), lighting.count,
            seed, FIRST_STREAM, out,
        )  # fmt: skip
        traced.append(shadow)

    for_blocks(shade, len(view), block_of(len(view), POINT_BLOCK) // LANES * LANES)
    shadow = sum(traced)
    return out, RayCount(shadow=shadow, skipped=len(view) * lighting.count - shadow)
