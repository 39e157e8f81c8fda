"""What a map gives surfaces of all orientations, where nothing casts a shadow."""

import weakref
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.convolution import Kernel, convolve, zonal_coefficients
from samplers.environment import EnvironmentMap

AMBIENT_HEIGHT = 32
"""Rows of an ambient map's irradiance, which holds almost nothing above the second harmonic."""
SHARP_HEIGHT = 256
"""Rows where a map may hold a sun: light under it has an edge where it sets."""
LEAST_HEIGHT = 256
"""Rows, at least, that a map is cut into, so that its texels are points."""
IRRADIANCE, COATED = 0, 1

Maps = weakref.WeakKeyDictionary[EnvironmentMap, NDArray[np.float64]]
_ambient: Maps = weakref.WeakKeyDictionary()
_sharp: Maps = weakref.WeakKeyDictionary()


def irradiance_map(environment: EnvironmentMap) -> NDArray[np.float64]:
    """Irradiance ∫ L cos dω on planes of all orientations, (32, 64, 3); once per map.

    It may be π times what the map holds, which float32 cannot hold of the largest maps.
    """
    if environment not in _ambient:
        _ambient[environment] = _convolved(environment, [_cosine], AMBIENT_HEIGHT)[0]
    return _ambient[environment]


def diffuse_maps(environment: EnvironmentMap) -> NDArray[np.float64]:
    """IRRADIANCE, and COATED, ∫ L cos (1 − (1 − cos)⁵) dω, (2, 256, 512, 3); once per map.

    The latter, times 1 − F₀, is what a coat by Schlick's term lets through.
    """
    if environment not in _sharp:
        _sharp[environment] = _convolved(environment, [_cosine, _coated], SHARP_HEIGHT)
    return _sharp[environment]


def _cosine(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    return cosine


def _coated(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    return cosine * (1.0 - (1.0 - cosine) ** 5)


def _convolved(
    environment: EnvironmentMap, kernels: Sequence[Kernel], height: int
) -> NDArray[np.float64]:
    """The map through each kernel, (k, height, 2 · height, 3), by as many harmonics as rows."""
    if environment.is_black:
        return np.zeros((len(kernels), height, 2 * height, 3))
    finer = -(-LEAST_HEIGHT // environment.height)
    source = environment.radiance.repeat(finer, axis=0).repeat(finer, axis=1)
    coefficients = np.array([zonal_coefficients(kernel, height - 1) for kernel in kernels])
    # The harmonics that are cut off may leave less than nothing where a map is dark.
    maps: NDArray[np.float64] = np.maximum(convolve(source, coefficients, height), 0.0)
    return maps
