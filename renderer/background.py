"""What a view shows where no surface is: the map itself."""

import numpy as np
from numpy.typing import NDArray

from renderer.view import View
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.bilinear import bilinear_at
from samplers.sphere import RUN, map_positions
from samplers.threads import for_blocks


@kernel
def _lookup(image, direction, start, stop, out):
    way, place, value = np.zeros(3 * RUN), np.empty(2 * RUN), np.empty(3)
    for first in range(start, stop, RUN):
        used = min(RUN, stop - first)
        map_positions(direction, first, used, len(image), way, place)
        for k in range(used):
            bilinear_at(image, place[k], place[RUN + k], value)
            i = first + k
            out[i, 0], out[i, 1], out[i, 2] = value[0], value[1], value[2]


def background_radiance(view: View, environment: EnvironmentMap) -> NDArray[np.float32]:
    """What the view's background sub-pixels see, (b, 3): the map itself, interpolated for looks."""
    out = np.empty((len(view.background_pixel), 3), np.float32)
    for_blocks(
        lambda a, b: _lookup(environment.radiance, view.background_direction, a, b, out),
        len(out),
        1 << 14,
    )
    return out
