"""Shading by resampled light in place: nothing but a packet's sum leaves its pass.

What `surface.py` does with any distribution, for those whose candidates come from a table of the
map and from the BRDF. The samples are the same, to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.monte_carlo import density_in_place, is_independent
from renderer.packet.embree import LANES
from renderer.packet.layout import Density, Numbers
from renderer.packet.resample import shade_resampled
from renderer.rays import RayCount
from renderer.surface import FIRST_STREAM
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.grids.resampled_light import NO_CURVE
from samplers.lighting import ResampledCandidates
from samplers.threads import block_of, for_blocks

POINT_BLOCK = 1024
"""Points that a thread takes at once, at least."""


def candidates_in_place(lighting: object, environment: EnvironmentMap) -> Density | None:
    """The table of a lighting's candidates, where all can be done in place: where it has
    candidates, judged by the map that is looked up, from a table that kernels can draw from."""
    if isinstance(lighting, ResampledCandidates) and lighting.radiance is environment.radiance:
        return density_in_place(lighting.candidates, environment)
    return None


def shade_in_place(
    view: View,
    environment: EnvironmentMap,
    lighting: ResampledCandidates,
    density: Density,
    seed: int,
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points, as by `renderer.surface.shade_surface`.

    density : of `candidates_in_place`
    """
    out = np.zeros((len(view), 3), np.float32)
    candidates, traced = (lighting.from_map, lighting.from_brdf), []
    numbers = Numbers(seed, is_independent(lighting))

    def shade(start: int, stop: int) -> None:
        shadow = shade_resampled(
            view.embree.handle, view.points, (start, stop), environment.radiance, density,
            lighting.curve or NO_CURVE, candidates, lighting.count, FIRST_STREAM, numbers, out,
        )  # fmt: skip
        traced.append(shadow)

    for_blocks(shade, len(view), block_of(len(view), POINT_BLOCK) // LANES * LANES)
    shadow = sum(traced)
    return out, RayCount(shadow=shadow, skipped=len(view) * lighting.count - shadow)
