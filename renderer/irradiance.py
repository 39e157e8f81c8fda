"""The irradiance that a map gives planes of all orientations, where nothing casts a shadow."""

import weakref

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.sphere import pixel_directions, row_solid_angle
from samplers.threads import for_blocks

IRRADIANCE_HEIGHT = 32
"""Rows of the irradiance map: irradiance holds almost nothing above the second harmonic."""
CONVOLVED_HEIGHT = 64
"""Rows, at least, that a map is cut into before it is convolved."""

_irradiance_maps: weakref.WeakKeyDictionary[EnvironmentMap, NDArray[np.float64]] = (
    weakref.WeakKeyDictionary()
)


def irradiance_map(environment: EnvironmentMap) -> NDArray[np.float64]:
    """Irradiance ∫ L cos dω on planes of all orientations, (32, 64, 3); once per map.

    It may be π times what the map holds, which float32 cannot hold of the largest maps.
    """
    if environment not in _irradiance_maps:
        _irradiance_maps[environment] = _convolved(environment)
    return _irradiance_maps[environment]


def _convolved(environment: EnvironmentMap) -> NDArray[np.float64]:
    if environment.is_black:
        return np.zeros((IRRADIANCE_HEIGHT, 2 * IRRADIANCE_HEIGHT, 3))
    source = environment.radiance.astype(np.float64)
    finer = -(-CONVOLVED_HEIGHT // environment.height)
    source = source.repeat(finer, axis=0).repeat(finer, axis=1)
    factor = len(source) // CONVOLVED_HEIGHT
    while len(source) % factor:
        factor -= 1
    height = len(source) // factor
    flux = source * row_solid_angle(len(source), 2 * len(source))[:, None, None]
    flux = flux.reshape(height, factor, 2 * height, factor, 3).sum(axis=(1, 3)).reshape(-1, 3)
    towards = pixel_directions(height).reshape(-1, 3)
    normal = pixel_directions(IRRADIANCE_HEIGHT)
    out = np.empty_like(normal)
    for_blocks(lambda a, b: _add_cosines(normal[a:b], towards, flux, out[a:b]), len(normal), 1)
    return out


@kernel
def _add_cosines(normal, towards, flux, out):
    """Irradiance on planes of these normals, (rows, columns, 3): flux @ max(0, towards · n)."""
    for row in range(len(normal)):
        for column in range(normal.shape[1]):
            x, y, z = normal[row, column]
            red = green = blue = 0.0
            for k in range(len(towards)):
                cosine = max(0.0, x * towards[k, 0] + y * towards[k, 1] + z * towards[k, 2])
                red += cosine * flux[k, 0]
                green += cosine * flux[k, 1]
                blue += cosine * flux[k, 2]
            out[row, column, 0], out[row, column, 1], out[row, column, 2] = red, green, blue
