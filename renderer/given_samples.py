"""Samples that a distribution of anybody's making gives, checked before they are shaded.

A sample too many would be light, and rays, beyond the budget; a direction that is not unit scales
cosines; what is negative or not a number spoils a whole pixel. One look at each sample finds them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.errors import EnvlightError

UNIT = 2.0**-16
"""How far off a unit direction's length may be: by 256 roundings of float32, 2⁻²⁴ of it each."""


@kernel
def _are_good(direction, density, radiance):
    """Whether all are; there may be more densities than directions, and no radiance."""
    good = True
    for i in range(len(direction)):
        x, y, z = np.float64(direction[i, 0]), np.float64(direction[i, 1]), direction[i, 2]
        off = abs(x * x + y * y + z * z - 1.0)
        # Where none is drawn, any direction will do from which an angle can be found.
        good &= (off <= 2.0 * UNIT) | ((density[i] == 0.0) & (off <= 1.0))
    for i in range(len(density)):
        good &= (density[i] >= 0.0) & (density[i] < np.inf)
    for i in range(len(radiance)):
        for channel in range(3):
            good &= (radiance[i, channel] >= 0.0) & (radiance[i, channel] < np.inf)
    return good


def require_shape(lighting: Any, what: str, array: NDArray, shape: tuple[int, ...]) -> None:
    """Raise EnvlightError where an array that the lighting gave has another shape."""
    if array.shape != shape:
        raise refusal(lighting, f"{what} of shape {array.shape}", f"{shape} is wanted")


def require_good(
    lighting: Any,
    direction: NDArray[np.float32],
    density: NDArray[np.float64],
    radiance: NDArray[np.float32],
    divisor: str = "density",
) -> None:
    """Raise EnvlightError with what is wrong with samples that a lighting gave.

    direction : (n, 3); density : (m,) in sr⁻¹, of these and of m − n other directions
    radiance : (n, 3), or (0, 3) where the map's is taken
    divisor : what the lighting calls the density, or gives in its place
    """
    if _are_good(direction, density, radiance):
        return
    if not ((density >= 0.0) & (density < np.inf)).all():
        raise refusal(
            lighting, f"a {divisor} that is negative or not finite", "0 or more is wanted"
        )
    dark = radiance[~((radiance >= 0.0) & (radiance < np.inf))]
    if len(dark):
        raise refusal(lighting, f"a radiance of {dark[0]:.4g}", "0 or more, finite, is wanted")
    length = np.linalg.norm(direction.astype(np.float64), axis=1)
    off = np.where(density[: len(length)] > 0.0, np.abs(length - 1.0), 0.0)
    off = np.where(np.isfinite(length), off, np.inf)
    raise refusal(
        lighting,
        f"a direction of length {length[np.argmax(off)]:.6g}",
        f"1 is wanted, to within {UNIT:.1e}",
    )


def refusal(lighting: Any, given: str, wanted: str) -> EnvlightError:
    """The error that names a lighting, what it gave and what was wanted of it."""
    return EnvlightError(f"lighting {type(lighting).__name__}: it gave {given}; {wanted}")
